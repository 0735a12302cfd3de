"""Paths with symbolic links in them."""

from __future__ import annotations

import errno
from collections.abc import Iterable
from pathlib import Path

from terrain_forge.base.errors import OutputError


def resolved(path: Path | str) -> Path:
    """A path from the root, all links followed, whether something is there or not.

    Raises:
        OutputError: if its links lead in a circle, which `Path.resolve` tells as a RuntimeError
            before Python 3.13 and not at all from then on.
    """
    path = Path(path)
    try:
        path.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OutputError(f"{path}: its symbolic links lead in a circle") from None
    return path.resolve()


def lies_within(path: Path, folders: Iterable[Path]) -> bool:
    """Whether a path lies in one of some folders, all links in it followed.

    Raises:
        OSError, RuntimeError, ValueError: for what is no path.
    """
    whole = path.resolve()
    return any(whole.is_relative_to(folder) for folder in folders)
