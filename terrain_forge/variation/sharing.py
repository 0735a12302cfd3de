"""Files of equal content in many folders, kept once: hard links to one of them.

Each world stays a folder of its own that any program reads, that can be copied and taken away.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from filecmp import cmp
from pathlib import Path

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
        kept = pool / f"{digest[:32]}{file.suffix}"
        with suppress(OSError):
            try:
                os.link(file, kept)
            except FileExistsError:
                # What stands there may have been cut short with the power, or be another's.
                same = _is_plain(kept) and cmp(kept, file, shallow=False)
                source, target = (kept, file) if same else (file, kept)
                one = file.with_name(f".{file.name}-shared")
                os.link(source, one)
                one.replace(target)


def drop_unshared(pool: Path) -> None:
    """Take out of the pool what only one folder has."""
    for file in pool.iterdir():
        if _POOLED.fullmatch(file.name) and _is_plain(file) and file.stat().st_nlink <= 2:
            file.unlink()


def _is_plain(file: Path) -> bool:
    return file.is_file() and not file.is_symlink()
