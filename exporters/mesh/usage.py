"""How meshes are opened."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening:
    """The lines for a terminal."""
    files = "*" if options.tiles == "tiled" else "world"
    return Opening(
        title="Meshes",
        commands=f"meshlab {quote(folder.name)}/{files}.{options.format}"
        "   # or any reader of meshes; metres, z up",
    )
