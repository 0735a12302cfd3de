"""How programs open a USD export."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening:
    """The lines for a terminal."""
    del options
    others = "or File › Open in Isaac Sim, Omniverse, Blender"
    return Opening(title="USD", commands=f"usdview {quote(folder.name)}/scene.usda   # {others}")
