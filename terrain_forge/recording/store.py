"""The files of a recording: each is whole or not there, and a list tells which ones are ours."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path, PurePosixPath

from terrain_forge.base import OutputError

WRITTEN = "written.csv"
"""The list: size and name of each file, before it takes its place; the last of a name counts."""
_HEADER = "#size [bytes],file"
_FRESH = ".writing"
"""Where a file is written before it takes its place."""


class Store:
    """A recording's folder. Use it in a `with` block, or close it.

    One thread writes. What a killed one has begun is not on the list, or is shorter than the list
    says, and is written again.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._sizes = _listed(folder / WRITTEN)
        self._list: TextIOWrapper | None = None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        if self._list:
            self._list.close()
            self._list = None
        (self.folder / _FRESH).unlink(missing_ok=True)

    @property
    def size(self) -> int:
        """Bytes that were written."""
        return sum(self._sizes.values())

    def holds(self, name: str) -> bool:
        """Whether a file of ours is there and as long as it was written."""
        size = self._sizes.get(name)
        try:
            return size is not None and (self.folder / name).stat().st_size == size
        except OSError:
            return False

    def require_free(self, name: str) -> None:
        """Refuse a place where a file of others lies.

        Raises:
            OutputError: names it.
        """
        if name not in self._sizes and os.path.lexists(self.folder / name):
            raise OutputError(f"{self.folder / name} is in the way: move it away")

    def put(self, name: str, content: bytes | Callable[[Path], None]) -> None:
        """Write a file, or let it be written, and let it take its place.

        Raises:
            OutputError: if a file of others lies there.
        """
        self.require_free(name)
        path, fresh = self.folder / name, self.folder / _FRESH
        path.parent.mkdir(parents=True, exist_ok=True)
        if callable(content):
            content(fresh)
        else:
            fresh.write_bytes(content)
        size = fresh.stat().st_size
        if self._list is None:
            self._list = _opened(self.folder / WRITTEN)
        self._list.write(f"{size},{name}\n")
        self._list.flush()
        self._sizes[name] = size
        fresh.replace(path)

    def clear(self) -> None:
        """Remove all files of ours, and folders that they leave empty."""
        for name in self._sizes:
            (self.folder / name).unlink(missing_ok=True)
        (self.folder / WRITTEN).unlink(missing_ok=True)
        above = {part for name in self._sizes for part in PurePosixPath(name).parents}
        for place in sorted(above, key=lambda part: -len(part.parts)):
            with suppress(OSError):  # those that hold something stay
                (self.folder / place).rmdir()
        self._sizes = {}


def _listed(path: Path) -> dict[str, int]:
    """Sizes of files by their names; a line that was cut short is none."""
    try:
        first, *lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except FileNotFoundError:
        return {}
    if first != _HEADER:
        raise OutputError(f"{path} is in the way: move it away")
    found = (line.partition(",") for line in lines)
    return {name: int(size) for size, _, name in found if size.isdecimal() and _is_inside(name)}


def _opened(path: Path) -> TextIOWrapper:
    """The list, whose next line is one of its own."""
    try:
        cut = path.read_bytes()[-1:] != b"\n"
    except FileNotFoundError:
        cut = False
    begun = path.exists()
    found = path.open("a", encoding="utf-8")
    found.write("\n" * cut if begun else f"{_HEADER}\n")
    return found


def _is_inside(name: str) -> bool:
    """Whether a name of the list stays in the folder."""
    place = PurePosixPath(name)
    return bool(name) and not place.is_absolute() and ".." not in place.parts and "\0" not in name
