"""The recipe that a command is given, and errors in it with file and line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from terrain_forge.base import Progress, RecipeError, TerrainForgeError
from terrain_forge.dtm import ARRAYS, RasterDtm, at_hand, data_beside, fetch_product, open_dataset
from terrain_forge.model import BODIES
from terrain_forge.recipe import RecipeFile, load_recipe
from terrain_forge.terminal.lines import word

_RASTERS = {
    *(".tif", ".tiff", ".img", ".lbl", ".cub", ".jp2", ".png", ".jpg", ".jpeg", ".vrt", ".asc"),
    *(".dem", ".hgt", ".bil", ".bsq", ".bip", ".dat", ".raw", ".grd", ".nc", ".dt1", ".dt2"),
    *(*ARRAYS, ".hdr"),
}
"""Endings of files that hold heights."""
_HEAD = 4096
"""Bytes by which a text is told from other files."""


def load_given(path: Path, *, seed: int | None = None, changes: tuple[str, ...] = ()) -> RecipeFile:
    """The recipe of a file, with the changes of the command line.

    Raises:
        RecipeError: if it is wrong; for a file of heights, with what to write instead.
    """
    _refuse_raster(path)
    return load_recipe(path, changes=changes if seed is None else (*changes, f"seed={seed}"))


@contextmanager
def located(file: RecipeFile) -> Iterator[None]:
    """Add the recipe's file and line to errors that name a key of it."""
    try:
        yield
    except TerrainForgeError as error:
        if not error.key:
            raise
        raise type(error)(file.locate(error)) from None


def fetch_given(name: str, *, progress: Progress) -> str:
    """Fetch a product, a place, or what a recipe (.yaml) needs; returns what it is.

    Raises:
        RecipeError, DataError: if there is no such, or it cannot be fetched.
    """
    if not name.endswith((".yaml", ".yml")):
        return str(fetch_product(name, progress=progress))
    file = load_given(Path(name))
    dtm, body = file.recipe.dtm, BODIES[file.recipe.body]
    if not isinstance(dtm, RasterDtm):
        return "needs no file"
    with located(file):
        return at_hand(dtm, body=body, progress=progress).name


def _refuse_raster(path: Path) -> None:
    if not path.is_file() or not (path.suffix.lower() in _RASTERS or _opens(path)):
        return
    if path.suffix.lower() in ARRAYS:
        raise RecipeError(
            f"{path}: this is an array, no recipe: save it as a GeoTIFF and write a recipe with "
            "dtm: {source: …}, or in Python give it to terrain_forge.plan as `heights`, with "
            "dtm: {kind: array} in the recipe"
        )
    found = data_beside(path)
    raise RecipeError(
        f"{path}: this is a raster, no recipe: write one with dtm: {{source: {found}, size_m: [40, "
        f"40]}} (`terrain-forge init` makes a first one); `terrain-forge check {word(found)}` "
        "describes it"
    )


def _opens(path: Path) -> bool:
    """Whether a file that is no text is a raster, whatever its name ends with."""
    with suppress(OSError, UnicodeDecodeError), path.open("rb") as file:
        file.read(_HEAD).decode("utf-8")
        return False
    try:
        open_dataset(path).close()
    except Exception:  # GDAL's, of many kinds
        return False
    return True
