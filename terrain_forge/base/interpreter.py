"""Python in other processes, which runs nothing that happens to lie in the current folder."""

from __future__ import annotations

import sys
from pathlib import Path


def python_words(code: str, python: Path | str = sys.executable) -> list[str]:
    """The words that run code in another process; what follows them are its arguments.

    `python -m` and `python -c` look into the current folder first, where a `random.py` beside a
    recipe would be taken for the standard library's. This Python finds what it finds here, another
    one what it is set up to find, whatever its version (`-P` came with 3.11).
    """
    own = str(python) == sys.executable
    path = repr(sys.path) if own else "[place for place in sys.path if place]"
    return [str(python), "-c", f"import sys; sys.path[:] = {path}; exec({code!r})"]
