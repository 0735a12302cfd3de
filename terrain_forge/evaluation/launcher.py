"""Runs a program and notes what it used: `launcher.py NOTE WORDS…`, alone and without any package.

Linux counts to a program's largest memory that of the process which started it: this one is small.
What the program starts belongs to this process even in a session of its own, and ends with it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time

GRACE = 3
"""How long a program has to end after it was asked to [s]."""
_DEATH_SIGNAL, _SUBREAPER = 1, 36


def main(note: str, words: list[str]) -> int:
    """Write processor time [s] and memory [bytes] to `note`, or why it cannot be started.

    SIGTERM, also that of its caller's end, asks the program to end, and soon ends it.
    """
    if sys.platform == "linux":
        system = ctypes.CDLL(None)
        system.prctl(_SUBREAPER, 1, 0, 0, 0)
        system.prctl(_DEATH_SIGNAL, int(signal.SIGTERM), 0, 0, 0)
    try:
        child = os.posix_spawnp(words[0], words, os.environ, setpgroup=0)
    except OSError as error:
        with open(note, "w", encoding="utf-8") as file:  # noqa: PTH123 (pathlib takes as long)
            why = _lacking(words[0]) or (error.strerror or str(error)).lower()
            file.write(f"{words[0]}: {why}")
        return 127

    def stop(*_: object) -> None:
        _kill_group(child, signal.SIGTERM)
        signal.alarm(GRACE)

    signal.signal(signal.SIGALRM, lambda *_: _kill_group(child, signal.SIGKILL))
    signal.signal(signal.SIGTERM, stop)
    _, status, usage = os.wait4(child, 0)
    signal.alarm(0)
    _kill_group(child, signal.SIGKILL)
    _end_adopted()
    factor = 1 if sys.platform == "darwin" else 1024
    with open(note, "w", encoding="utf-8") as file:  # noqa: PTH123
        file.write(f"{usage.ru_utime + usage.ru_stime} {usage.ru_maxrss * factor}")
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        signal.signal(-code, signal.SIG_DFL) if -code != signal.SIGKILL else None
        os.kill(os.getpid(), -code)
    return code


def _lacking(program: str) -> str:
    """What is not there where a script is: its interpreter; empty where that is not why."""
    import shutil

    try:
        with open(shutil.which(program) or program, "rb") as file:  # noqa: PTH123
            first = file.readline(256).rstrip(b"\n")
    except OSError:
        return ""
    named = first[2:].lstrip().partition(b" ")[0].decode(errors="replace")
    if not first.startswith(b"#!") or not named or os.path.exists(named):  # noqa: PTH110
        return ""
    return f"its interpreter {named!r} is not there"


def _kill_group(group: int, number: int) -> None:
    try:
        os.killpg(group, number)
    except (ProcessLookupError, PermissionError):
        pass


def _end_adopted() -> None:
    """End what the program left behind, wherever it put itself."""
    until = time.monotonic() + GRACE
    while time.monotonic() < until:
        for number in _children():
            try:
                os.kill(number, signal.SIGKILL)
            except (ProcessLookupError, PermissionError):
                pass
        try:
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                time.sleep(0.01)
        except ChildProcessError:  # there are none any more
            return


def _children() -> list[int]:
    """Processes that this one is the parent of, where the system tells."""
    try:
        path = f"/proc/self/task/{os.getpid()}/children"
        with open(path, encoding="utf-8") as file:  # noqa: PTH123
            return [int(word) for word in file.read().split()]
    except (OSError, ValueError):
        return []


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
