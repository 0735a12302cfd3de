"""Folders that pass for worlds, written as builds write theirs."""

from __future__ import annotations

import json
from pathlib import Path

from terrain_forge.building import replacing


def fill(folder: Path, *, number: int) -> None:
    """Write what passes for a world of one file."""
    from hashlib import sha256

    text = f"world {number}\n"
    (folder / "sub").mkdir()
    (folder / "sub" / "world.txt").write_text(text)
    manifest = {
        "terrain_forge": "0",
        "format": 2,
        "exports": {},
        "outputs": {"sub/world.txt": sha256(text.encode()).hexdigest()},
        "varying": [],
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))


def write(target: Path, *, number: int, force: bool = False) -> None:
    with replacing(target, force=force) as folder:
        fill(folder, number=number)


def content(target: Path) -> str:
    """What the world in a folder says; it is whole."""
    paths = {p.relative_to(target).as_posix() for p in target.rglob("*")}
    paths -= {".terrain-forge", ".terrain-forge/lock"}  # a killed one leaves its lock
    assert paths == {"manifest.json", "sub", "sub/world.txt"}
    return (target / "sub" / "world.txt").read_text()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())
