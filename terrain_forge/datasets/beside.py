"""Which further formats lie beside a recording, and of which state of it each of them is."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from terrain_forge.base import read_text, reading
from terrain_forge.datasets.reader import INDEX

FORMATS = "formats.json"
"""Which formats were made, with what options, of what state."""
_MOST = 2**24


def state_of(folder: Path) -> str:
    """What tells a state of the recording in a folder from those before it grew."""
    return hashlib.sha256((folder / INDEX).read_bytes()).hexdigest()


def made_formats(folder: Path) -> dict[str, Any]:
    """What is told of the formats that were made, by their names; `of` is their `state_of`.

    Raises:
        DataError: if that cannot be read.
    """
    if not (folder / FORMATS).exists():
        return {}
    with reading(FORMATS):
        return dict(json.loads(read_text(folder / FORMATS, FORMATS, most=_MOST)))


def holds_format(folder: Path, name: str) -> bool:
    """Whether a format lies there and is of the recording as it now is.

    Raises:
        DataError: if what is told of it cannot be read.
    """
    told = made_formats(folder)
    with reading(FORMATS):
        return name in told and told[name]["of"] == state_of(folder) and (folder / name).is_dir()
