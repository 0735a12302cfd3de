"""Files that are there whole or not at all, also after a power cut."""

from __future__ import annotations

import os
from pathlib import Path

from terrain_forge.base.errors import OutputError
from terrain_forge.base.threads import worker_threads

_WRITERS = 8
"""Files that are written through at once."""


def write_whole(path: Path, text: str) -> Path:
    """Write a text in UTF-8 beside a file, and then in its place; returns the file.

    A pipe or a link there is replaced, and not written to or through.

    Raises:
        OutputError: if it is a folder.
        OSError: if the disk does not take it; the file is as it was.
    """
    if path.is_dir() and not path.is_symlink():
        raise OutputError(f"{path} is a folder, where a file goes: move it away")
    fresh = path.with_name(f".{path.name}-{os.getpid()}")
    fresh.unlink(missing_ok=True)  # a link, which would be followed
    try:
        fresh.write_text(text, encoding="utf-8")
        sync(fresh)
        return fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


def write_through(folder: Path) -> None:
    """Write a folder's files through to the disk, side by side, which is quicker."""
    paths = [path for path in (folder, *folder.rglob("*")) if not path.is_symlink()]
    with worker_threads(_WRITERS) as pool:
        for _ in pool.map(sync, paths):
            pass


def sync(path: Path) -> None:
    """Write a file, or the names in a folder, through to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
