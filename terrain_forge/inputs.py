"""The files that a recipe names: reading its images, and the hashes that go into the manifest."""

from __future__ import annotations

import hashlib
from pathlib import Path

from terrain_forge.dtm.raster import read_image
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.recipe import Recipe
from terrain_forge.site import Image


def read_images(recipe: Recipe, folder: Path) -> tuple[Image, ...]:
    """The images of all layers.

    Raises:
        DataError: for a file that is missing or no image.
    """
    images = {}
    for number, layer in enumerate(recipe.terrain.layers):
        for path in layer.images():
            values = read_image(path, folder, ("terrain", "layers", number))
            images[path] = Image(path=path, values=values)
    return tuple(images.values())


def hash_inputs(recipe: Recipe, folder: Path) -> tuple[tuple[str, str], ...]:
    """SHA-256 of every input, by its path as the recipe writes it."""
    paths = [path for layer in recipe.terrain.layers for path in layer.images()]
    if isinstance(recipe.dtm, RasterDtm):
        paths.insert(0, recipe.dtm.source)
        paths += _pixels_of_label(folder / recipe.dtm.source, recipe.dtm.source)
    return tuple((path, sha256(folder / path)) for path in dict.fromkeys(paths))


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _pixels_of_label(path: Path, source: str) -> list[str]:
    """Files that belong to a raster besides the one that is opened, such as a label's image."""
    import warnings

    import rasterio

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path) as dataset:
            others = sorted(Path(name).name for name in dataset.files if Path(name) != path)
    return [str(Path(source).with_name(name)) for name in others]
