"""Files of equal content in many folders, kept once: hard links to one of them.

Each world stays a folder of its own that any program reads, that can be copied and taken away.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from filecmp import cmp
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from terrain_forge.model import SHARED_ARRAYS, write_archive

LEAST = 2048
"""Bytes from which on a file is worth a link."""
_POOLED = re.compile(r"[0-9a-f]{32}(\..+)?")
"""A file of the pool: a hash of what it holds, and an ending."""


def share(folder: Path, hashes: Mapping[str, str], pool: Path) -> None:
    """Let files be one with what the pool has of their content; what it lacks it gets.

    Where the file system has no more links for it, or none at all, a file stays as it is.

    Args:
        folder: Where they lie.
        hashes: SHA-256 of each, by its path in the folder.
        pool: The folder of what many have alike.
    """
    for name, digest in sorted(hashes.items()):
        file = folder / name
        if file.is_symlink() or file.stat().st_size < LEAST:
            continue
        kept = _place(pool, name, digest)
        with suppress(OSError):
            try:
                os.link(file, kept)
            except FileExistsError:
                if _is_plain(kept) and kept.samefile(file):
                    continue
                # What stands there may have been cut short with the power, or be another's.
                same = _is_plain(kept) and cmp(kept, file, shallow=False)
                source, target = (kept, file) if same else (file, kept)
                one = file.with_name(f".{file.name}-shared")
                os.link(source, one)
                one.replace(target)


class SharedArchive:
    """Writes the arrays of a world, but links those that the last one had too.

    A rock library is larger than all else of a small world.
    """

    def __init__(self, pool: Path) -> None:
        """Args: pool: The folder of what many have alike."""
        self.known: dict[str, str] = {}
        """SHA-256 of what was linked, by its path in the world's folder."""
        self._pool = pool
        self._written: tuple[Path, dict[str, NDArray[Any]]] | None = None

    def write(self, path: Path, arrays: dict[str, NDArray[Any]]) -> None:
        """Write or link one of the world's archives."""
        if path.name == Path(SHARED_ARRAYS).name:
            for last in _last:
                if last.file.parent == self._pool and last.is_of(arrays):
                    with suppress(OSError):
                        os.link(last.file, path)
                        self.known[SHARED_ARRAYS] = last.digest
                        return
            self._written = path, arrays
        write_archive(path, arrays)

    def keep(self, hashes: Mapping[str, str]) -> None:
        """Have the next world link what this one wrote and shared; its files' SHA-256 are given."""
        if self._written is None:
            return
        written, arrays = self._written
        digest = hashes[SHARED_ARRAYS]
        file = _place(self._pool, SHARED_ARRAYS, digest)
        _last.clear()
        # What stands there is another's where no link could be made.
        if (state := _state(file)) and file.samefile(written):
            _last.append(_Kept(arrays, digest, file, state))


@dataclass(frozen=True, eq=False)
class _Kept:
    """Arrays that a file of the pool holds, as this process has left it."""

    arrays: dict[str, NDArray[Any]]
    digest: str
    file: Path
    state: tuple[int, ...]

    def is_of(self, arrays: dict[str, NDArray[Any]]) -> bool:
        """Whether it holds these, and nobody has changed it."""
        return (
            [*self.arrays] == [*arrays]
            and all(_are_alike(self.arrays[name], array) for name, array in arrays.items())
            and _state(self.file) == self.state
        )


_last: list[_Kept] = []
"""What the last world shared, if anything."""


def drop_unshared(pool: Path) -> None:
    """Take out of the pool what only one folder has, and let go of what the last world shared."""
    _last.clear()
    for file in pool.iterdir():
        if _POOLED.fullmatch(file.name) and _is_plain(file) and file.stat().st_nlink <= 2:
            file.unlink()


def _place(pool: Path, name: str, digest: str) -> Path:
    """Where the pool keeps a file."""
    return pool / f"{digest[:32]}{Path(name).suffix}"


def _are_alike(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Whether a file has the same bytes of them; 0 and -0 are equal, and are not alike."""
    return one is other or (
        (one.dtype, one.shape, one.flags.fnc) == (other.dtype, other.shape, other.flags.fnc)
        and one.tobytes() == other.tobytes()
    )


def _state(file: Path) -> tuple[int, ...] | None:
    """What changes with a file; None where there is no file."""
    if not _is_plain(file):
        return None
    found = file.stat()
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def _is_plain(file: Path) -> bool:
    return file.is_file() and not file.is_symlink()
