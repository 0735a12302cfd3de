"""A raster that is given where a recipe belongs: what to do."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.base import RecipeError
from terrain_forge.dtm import ARRAYS, file_to_open

_RASTERS = {
    *(".tif", ".tiff", ".img", ".lbl", ".cub", ".jp2", ".png", ".jpg", ".jpeg", ".vrt", ".asc"),
    *(".dem", ".hgt", ".bil", ".bsq", ".bip", ".dat", ".raw", ".grd", ".nc", ".dt1", ".dt2"),
    *(*ARRAYS, ".hdr"),
}
"""Endings of files that hold heights."""


def refuse_raster(path: Path) -> None:
    """Refuse a file of heights in a recipe's place.

    Raises:
        RecipeError: with what to write instead.
    """
    if path.suffix.lower() not in _RASTERS or not path.is_file():
        return
    if path.suffix.lower() in ARRAYS:
        raise RecipeError(
            f"{path}: this is an array, no recipe: save it as a GeoTIFF and write a recipe with "
            "dtm: {source: …}, or in Python give it to terrain_forge.plan as `heights`, with "
            "dtm: {kind: array} in the recipe"
        )
    name = file_to_open(path).name
    raise RecipeError(
        f"{path}: this is a raster, no recipe: write one with dtm: {{source: {name}, size_m: [40, "
        f"40]}} (`terrain-forge init` makes a first one); `terrain-forge check {name}` describes it"
    )
