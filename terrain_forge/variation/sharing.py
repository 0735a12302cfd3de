"""Files of equal content in many folders, kept once: hard links to one of them.

Each world stays a folder of its own that any program reads, that can be copied and taken away.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

LEAST = 2048
"""Bytes from which on a file is worth a link."""


def share(files: Iterable[Path], pool: Path) -> None:
    """Let files be one with what the pool has of their content; what it lacks it gets.

    Where the file system has no more links for it, or none at all, a file stays as it is.
    """
    for file in files:
        if file.is_symlink() or file.stat().st_size < LEAST:
            continue
        kept = pool / f"{sha256(file.read_bytes()).hexdigest()[:32]}{file.suffix}"
        with suppress(OSError):
            try:
                os.link(file, kept)
            except FileExistsError:
                one = file.with_name(f".{file.name}-shared")
                os.link(kept, one)
                one.replace(file)


def drop_unshared(pool: Path) -> None:
    """Take out of the pool what only one folder has."""
    for file in pool.iterdir():
        if file.stat().st_nlink <= 2:
            file.unlink()
