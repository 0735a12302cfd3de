"""Runs a program and notes what it used: `launcher.py NOTE WORDS…`, alone and without any package.

Linux counts to a program's largest memory that of the process which started it: this one is small.
"""

from __future__ import annotations

import os
import signal
import sys


def main(note: str, words: list[str]) -> int:
    """Write processor time [s] and memory [bytes] to `note`, or why it cannot be started.

    SIGTERM is left to the program; as it ends so does this.
    """
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        child = os.posix_spawnp(words[0], words, os.environ, setsigdef=[signal.SIGTERM])
    except OSError as error:
        with open(note, "w", encoding="utf-8") as file:  # noqa: PTH123 (pathlib takes as long)
            file.write(f"{words[0]}: {(error.strerror or str(error)).lower()}")
        return 127
    _, status, usage = os.wait4(child, 0)
    factor = 1 if sys.platform == "darwin" else 1024
    with open(note, "w", encoding="utf-8") as file:  # noqa: PTH123
        file.write(f"{usage.ru_utime + usage.ru_stime} {usage.ru_maxrss * factor}")
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        signal.signal(-code, signal.SIG_DFL) if -code != signal.SIGKILL else None
        os.kill(os.getpid(), -code)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
