"""How rasters are opened."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening:
    """The lines for a terminal."""
    return Opening(title="Maps", commands=f"qgis {quote(folder.name)}/{options.products[0]}.tif")
