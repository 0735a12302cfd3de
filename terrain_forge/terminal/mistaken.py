"""A raster that is given where a recipe belongs: what to do."""

from __future__ import annotations

import glob
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
_BESIDE = {_HEADER: (".img", ".dat", ".bsq", ".bil", ".bip", ".raw"), ".img": (".lbl",)}
"""Endings of the files that are opened instead of such a one."""


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
    """The file that is opened: of an ENVI header the data beside it, of PDS3 data the label."""
    if path.suffix.lower() == _HEADER and path.with_suffix("").is_file():  # dem.img.hdr
        return path.with_suffix("")
    endings = _BESIDE.get(path.suffix.lower(), ())
    beside = {file.suffix.lower(): file for file in path.parent.glob(f"{glob.escape(path.stem)}.*")}
    return next((beside[ending] for ending in endings if ending in beside), path)
