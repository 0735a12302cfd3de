"""A raster that is given where a recipe belongs: what to do."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.base import RecipeError

_ARRAYS = {".npy", ".npz"}
_HEADER = ".hdr"
_RASTERS = {
    *(".tif", ".tiff", ".img", ".lbl", ".cub", ".jp2", ".png", ".jpg", ".jpeg", ".vrt", ".asc"),
    *(".dem", ".hgt", ".bil", ".bsq", ".bip", ".dat", ".raw", ".grd", ".nc", ".dt1", ".dt2"),
    *(_ARRAYS | {_HEADER}),
}
"""Endings of files that hold heights."""


def refuse_raster(path: Path) -> None:
    """Refuse a file of heights in a recipe's place.

    Raises:
        RecipeError: with what to write instead.
    """
    if path.suffix.lower() not in _RASTERS or not path.is_file():
        return
    if path.suffix.lower() in _ARRAYS:
        raise RecipeError(
            f"{path}: this is an array, no recipe: save it as a GeoTIFF and write a recipe with "
            "dtm: {source: …}, or in Python give it to terrain_forge.plan as `heights`, with "
            "dtm: {kind: array} in the recipe"
        )
    name = raster_of(path).name
    raise RecipeError(
        f"{path}: this is a raster, no recipe: write one with dtm: {{source: {name}, size_m: [40, "
        f"40]}} (`terrain-forge init` makes a first one); `terrain-forge check {name}` describes it"
    )


def raster_of(path: Path) -> Path:
    """The file that is opened: of an ENVI header, the data beside it."""
    if path.suffix.lower() != _HEADER:
        return path
    named = path.with_suffix("")  # dem.img.hdr, or dem.hdr beside dem
    beside = (path.with_suffix(ending) for ending in (".img", ".dat", ".bsq", ".bil", ".bip"))
    return next((file for file in (named, *beside) if file.is_file()), path)
