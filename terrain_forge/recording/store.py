"""The files of a recording: each is whole or not there, and a list tells which ones are ours."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path, PurePosixPath

from terrain_forge.base import (
    MAX_STATE,
    DataError,
    OutputError,
    is_inside,
    require_file,
    require_unlinked,
    sync,
)

WRITTEN = "written.csv"
"""The list: size and name of each file, before it takes its place; the last of a name counts."""
_HEADER = "#size [bytes],file"
_SIZE = re.compile("[0-9]{1,18}")
_CLAIMED, _ADOPTED = 0, 1
"""What stands in place of a size where a folder is about to be made, and when it was."""
_FRESH = ".writing"
"""Where a file is written before it takes its place."""


class Store:
    """A recording's folder. Use it in a `with` block, or close it.

    One thread writes. What a killed one has begun is not on the list, or is shorter than the list
    says, and is written again.

    Raises:
        OutputError: if a file of others stands in place of the list, or a link leads to what it
            lists.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._sizes = _listed(folder / WRITTEN)
        for place in {PurePosixPath(name).parent for name in self._sizes}:
            require_unlinked(folder, place)
        self._list: TextIOWrapper | None = None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()
        _free(self.folder / _FRESH)

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
            OutputError: if a file of others lies there, or a link leads there.
        """
        self.require_free(name)
        above = require_unlinked(self.folder, PurePosixPath(name).parent)
        path, fresh = self.folder / name, self.folder / _FRESH
        above.mkdir(parents=True, exist_ok=True)
        _free(fresh)
        if callable(content):
            content(fresh)
        else:
            fresh.write_bytes(content)
        # Not synced one by one, which would cost more than many measurements: what a failing power
        # supply leaves is shorter than the list says, and measured anew.
        self._note({name: fresh.stat().st_size})
        fresh.replace(path)

    def holds_folder(self, name: str) -> bool:
        """Whether all files of a folder that was adopted are there."""
        return self._sizes.get(f"{name}/") == _ADOPTED and all(
            self.holds(file) for file in self._inside(name)
        )

    def free_folder(self, name: str) -> None:
        """Remove what is ours of a folder, and note that what comes to be there is.

        Raises:
            OutputError: if a link stands there.
        """
        require_unlinked(self.folder, name)
        if self._sizes.get(f"{name}/") == _CLAIMED:  # killed before it was adopted: all is ours
            shutil.rmtree(self.folder / name, ignore_errors=True)
        self._remove(self._inside(name))
        self._note({f"{name}/": _CLAIMED})

    def adopt(self, name: str) -> None:
        """Take all files of a folder that was claimed and has come to be there as ours."""
        paths = (path for path in sorted((self.folder / name).rglob("*")) if path.is_file())
        sizes = {path.relative_to(self.folder).as_posix(): path.stat().st_size for path in paths}
        self._note({**sizes, f"{name}/": _ADOPTED})

    def _inside(self, name: str) -> list[str]:
        start = f"{name}/"
        return [file for file in self._sizes if file.startswith(start) and file != start]

    def _note(self, sizes: Mapping[str, int]) -> None:
        if self._list is None:
            self._list = _opened(self.folder / WRITTEN)
        self._list.writelines(f"{size},{name}\n" for name, size in sizes.items())
        self._list.flush()
        self._sizes |= sizes

    def _remove(self, names: Collection[str]) -> None:
        """Remove files, and folders that they leave empty."""
        for name in names:
            (self.folder / name).unlink(missing_ok=True)
            self._sizes.pop(name, None)
        above = {part for name in names for part in PurePosixPath(name).parents}
        for place in sorted(above, key=lambda part: -len(part.parts)):
            with suppress(OSError):  # those that hold something stay
                (self.folder / place).rmdir()

    def settle(self) -> None:
        """Write the list anew, in order, so that equal recordings have equal lists."""
        self._close()
        kept = {n: s for n, s in self._sizes.items() if n.endswith("/") or self.holds(n)}
        lines = [_HEADER, *(f"{size},{name}" for name, size in sorted(kept.items()))]
        fresh = self.folder / _FRESH
        _free(fresh)
        fresh.write_text("\n".join(lines) + "\n", encoding="utf-8")
        sync(fresh)
        fresh.replace(self.folder / WRITTEN)

    def _close(self) -> None:
        if self._list:
            self._list.close()
            self._list = None

    def clear(self) -> None:
        """Remove all files of ours, and folders that they leave empty."""
        for name in [name for name in self._sizes if name.endswith("/")]:
            self.free_folder(name[:-1])
        self._remove([name for name in self._sizes if not name.endswith("/")])
        self._close()
        (self.folder / WRITTEN).unlink(missing_ok=True)
        self._sizes = {}


def _listed(path: Path) -> dict[str, int]:
    """Sizes of files by their names; a line that was cut short is none."""
    try:
        if not os.path.lexists(path):
            return {}
        require_file(path, WRITTEN, most=MAX_STATE)
        first, *lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except DataError:
        first, lines = "", []
    if first != _HEADER or path.is_symlink():
        raise OutputError(f"{path} is in the way: move it away")
    found = (line.partition(",") for line in lines)
    return {name: int(size) for size, _, name in found if _SIZE.fullmatch(size) and is_inside(name)}


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


def _free(fresh: Path) -> None:
    """Remove what was left where a file is written.

    Raises:
        OutputError: if that is a folder, which is not ours.
    """
    try:
        fresh.unlink(missing_ok=True)
    except IsADirectoryError:
        raise OutputError(f"{fresh} is in the way: move it away") from None
