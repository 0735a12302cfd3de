"""Paths with symbolic links in them, and names that stay in a folder."""

from __future__ import annotations

import errno
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

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


def is_inside(name: str) -> bool:
    """Whether a name that a list has of a file or a folder (with a slash) stays in its folder."""
    place = PurePosixPath(name)
    plain = str(place) == name.removesuffix("/") and "\0" not in name
    return plain and bool(place.parts) and not place.is_absolute() and ".." not in place.parts


def first_odd(folder: Path) -> str:
    """What first in a folder is no plain file or folder, or has no printable name, in words.

    Empty if there is none. A folder that is a link itself is called `.`, and not looked into.
    """
    if folder.is_symlink():
        return "the link ."
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))
    return next(filter(None, (_odd(folder / name, name) for name in names)), "")


def _odd(path: Path, name: str) -> str:
    """Why a path in a folder is odd, with its name there; empty if it is not."""
    if path.is_symlink():
        return f"the link {name}"
    if not (path.is_file() or path.is_dir()):  # who opens a pipe may wait for ever
        return f"{name!a}, which is neither a file nor a folder,"
    return "" if name.isprintable() else f"{name!a}, a name with what cannot be printed,"


def require_unlinked(folder: Path, name: str | PurePosixPath) -> Path:
    """The place of a name in a folder, to which no link within the folder leads.

    Raises:
        OutputError: names the part of it that is a link, the last one too.
    """
    place = folder
    for part in PurePosixPath(name).parts:
        place /= part
        if place.is_symlink():
            raise OutputError(f"{place} is a link, which is not followed: move it away")
    return place
