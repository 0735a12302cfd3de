"""Text files that are there whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path


def write_whole(path: Path, text: str) -> Path:
    """Write a text in UTF-8 beside a file, and then in its place; returns the file.

    A pipe or a link there is replaced, and not written to or through.

    Raises:
        OSError: if the disk does not take it; the file is as it was.
    """
    fresh = path.with_name(f".{path.name}-{os.getpid()}")
    try:
        fresh.write_text(text, encoding="utf-8")
        return fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)
