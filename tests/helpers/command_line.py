"""The command line within the tests' own process: starting a new one takes seconds."""

from __future__ import annotations

import gc
import io
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from typing import NamedTuple

_STAGE = re.compile(r"terrain-forge: \d+:\d\d ")


class Done(NamedTuple):
    """What a command left behind."""

    returncode: int
    stdout: str
    stderr: str

    @property
    def complaints(self) -> list[str]:
        """Lines of the error stream but those of the progress."""
        return [line for line in self.stderr.splitlines() if not _STAGE.match(line)]


def run(*arguments: object) -> Done:
    """Run a command as `terrain-forge ARGUMENTS` would."""
    from terrain_forge.cli import main  # the one that is imported now, see plugins.fresh

    out, err = io.StringIO(), io.StringIO()
    with process_as_it_was(), redirect_stdout(out), redirect_stderr(err):
        told = logging.StreamHandler(err)  # pytest has handlers, so basicConfig adds none
        told.setLevel(logging.WARNING)
        logging.getLogger().addHandler(told)
        try:
            status = main([str(argument) for argument in arguments])
        finally:
            logging.getLogger().removeHandler(told)
    return Done(status, out.getvalue(), err.getvalue())


@contextmanager
def process_as_it_was() -> Iterator[None]:
    """Undo what a command does to its process: garbage collection."""
    thresholds = gc.get_threshold()
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
