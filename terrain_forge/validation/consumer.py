"""What a consumer is to the conformance test, and how programs outside of this process are run."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from terrain_forge.base import SimulationError, python_words
from terrain_forge.validation.reading import Reading
from terrain_forge.validation.sample import Sample

LONGEST = 300.0
"""How long a program may take [s]."""


class NotRun(Exception):
    """A consumer that cannot be run here, and why."""


@dataclass(frozen=True, kw_only=True)
class Consumer:
    """A program that reads an exporter's folders."""

    name: str
    """Its name."""
    read: Callable[[Sample, Path, Any, Path], Reading]
    """Reads the export of a folder, given the sample, the folder, the exporter's options, and a
    folder for what it likes to keep.

    Raises:
        NotRun: if the consumer is not installed.
    """
    quick: bool = False
    """Whether a build asks it too, with a quick sample: it needs nothing that may be missing, and
    little time."""
    full: bool = True
    """Whether it has a row in the conformance table."""


def run(command: Sequence[str | Path], *, text: str = "", log: Path | None = None) -> str:
    """What a program prints.

    Args:
        command: The program and its arguments.
        text: What it reads from its standard input.
        log: Where its complaints are kept, if anywhere.

    Raises:
        SimulationError: if it fails.
        NotRun: if it takes too long, which says nothing of the export.
    """
    name = Path(command[0]).name
    try:
        done = subprocess.run(
            list(map(str, command)),
            input=text,
            capture_output=True,
            text=True,
            check=False,
            timeout=LONGEST,
        )
    except subprocess.TimeoutExpired:
        raise NotRun(f"{name} took longer than {LONGEST:g} s") from None
    if log is not None:
        log.write_text(done.stderr, encoding="utf-8")
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or [f"exit status {done.returncode}"]
        raise SimulationError(f"{name} failed: {last[0]}")
    return done.stdout


def read_probe(beside: str, name: str) -> str:
    """The text of a program that lies beside a file, for `python_words`.

    Run as a file it would find what lies beside it before the packages that it imports.
    """
    return Path(beside).with_name(name).read_text(encoding="utf-8")


def python_with(module: str, variable: str) -> Path:
    """A Python interpreter that can import a module: our own, or the one that a variable names.

    Raises:
        NotRun: if neither can.
    """
    chosen = os.environ.get(variable)
    if not chosen:
        if find_spec(module) is None:
            raise NotRun(f"{module} is not installed here, and {variable} names no Python with it")
        return Path(sys.executable)
    code = f"import importlib.util as u, sys; sys.exit(not u.find_spec({module!r}))"
    try:
        found = subprocess.run(python_words(code, chosen), capture_output=True, check=False)
    except OSError:
        raise NotRun(f"{variable}={chosen} is no Python") from None
    if found.returncode:
        raise NotRun(f"{variable}={chosen} has no {module}")
    return Path(chosen)
