"""A program that is watched: it ends with whoever started it, and with all that it started."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

_GRACE = 15.0
"""How long a launcher has to end its program and itself [s]."""
_NOTE = ".used"
_LAUNCHER = str(Path(__file__).with_name("launcher.py"))
_STYLE = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]")
"""What colours a terminal's text (ECMA-48's control sequences)."""
_LONGEST = 300
"""Characters of a line that are told."""
_BESIDE = {"PYTHONSAFEPATH": ""}
"""What a driver imports lies beside it, and it runs in a folder of its own."""


class Program:
    """A program from its start to the end of the `with` block, when what still runs is ended.

    Args:
        words: The program and its arguments.
        folder: Where it runs; `.used` in it is ours meanwhile.
        log: File that what it prints is written to.
        environment: Variables beside those of this process.
    """

    def __init__(
        self, words: Sequence[str], *, folder: Path, log: Path, environment: Mapping[str, str]
    ) -> None:
        self._note, self._log = folder / _NOTE, log
        for path in (log, self._note):
            path.unlink(missing_ok=True)  # a link would be written through
        with log.open("wb") as file:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", _LAUNCHER, str(self._note), *words], cwd=folder,
                stdout=file, env={**os.environ, **_BESIDE, **environment}, stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:  # too late, or an interrupt: nothing goes on alone
            self._process.terminate()
            if not self.ended(_GRACE):
                self._process.kill()
                self._process.wait()
        try:
            os.killpg(self._process.pid, signal.SIGKILL)
        except (ProcessLookupError, PermissionError):
            pass
        self._told = self._note.read_text(encoding="utf-8") if self._note.is_file() else "0 0"
        self._note.unlink(missing_ok=True)

    def ended(self, seconds: float) -> bool:
        """Whether it ends within a time [s]."""
        try:
            self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True

    @property
    def status(self) -> int:
        """How it ended; below 0 by a signal."""
        return int(self._process.returncode)

    @property
    def ending(self) -> str:
        """How it ended, and the last that it printed."""
        how = f"signal {-self.status}" if self.status < 0 else f"status {self.status}"
        return ": ".join([f"ended with {how}", *_last_words(self._log)])

    @property
    def used(self) -> tuple[float, float] | str:
        """Processor time [s] and largest memory [bytes], known after the block; 0 if it was killed.

        Or why it could not be started.
        """
        try:
            processor, memory = map(float, self._told.split())
        except ValueError:
            return self._told
        return processor, memory


def _last_words(log: Path) -> list[str]:
    """The last line that a program printed, as tables can hold it; none where it said nothing."""
    text = _STYLE.sub("", end_of(log, 4000).decode(errors="replace"))
    plain = ("".join(c if c.isprintable() else " " for c in line) for line in text.splitlines())
    return [" ".join(line.split())[:_LONGEST] for line in plain if line.strip()][-1:]


def end_of(path: Path, most: int) -> bytes:
    """The last bytes of a file; none where it is not there."""
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - most, 0))
        return file.read(most)
