"""The files that a recipe names: reading its images, their hashes, and names without a place."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields
from pathlib import Path

from terrain_forge.dtm.raster import files_of_raster, read_image
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.recipe import Recipe, recipe_json
from terrain_forge.site import Image


def read_images(recipe: Recipe, folder: Path) -> tuple[Image, ...]:
    """The images of all layers, under their portable names.

    Raises:
        DataError: for a file that is missing or no image.
    """
    names = portable_names(recipe)
    images = {}
    for number, layer in enumerate(recipe.terrain.layers):
        for path in layer.images():
            key = next(f.name for f in fields(layer) if getattr(layer, f.name) == path)
            values = read_image(path, folder, ("terrain", "layers", number, key))
            images[path] = Image(path=names[path], values=values)
    return tuple(images.values())


def hash_inputs(recipe: Recipe, folder: Path) -> tuple[tuple[str, str], ...]:
    """SHA-256 of every input, by its portable name; a label's image counts as an input."""
    names = portable_names(recipe)
    hashes = {names[path]: sha256(folder / path) for path in _paths(recipe)}
    if isinstance(recipe.dtm, RasterDtm):
        source = folder / recipe.dtm.source
        for other in files_of_raster(source):
            name = Path(names[recipe.dtm.source]).with_name(other.name).as_posix()
            hashes.setdefault(name, sha256(other))
    return tuple(hashes.items())


def portable_json(recipe: Recipe) -> str:
    """Canonical JSON of a recipe whose absolute paths have become names."""
    text = recipe_json(recipe)
    for path, name in portable_names(recipe).items():
        text = text.replace(json.dumps(path), json.dumps(name))
    return text


def portable_names(recipe: Recipe) -> dict[str, str]:
    """For each input's path, how the world calls it: as the recipe does, but never absolutely."""
    names: dict[str, str] = {}
    for path in _paths(recipe):
        name = Path(path).name if Path(path).is_absolute() else path
        names[path] = name if name not in names.values() else f"{len(names)}-{name}"
    return names


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _paths(recipe: Recipe) -> list[str]:
    """Paths of all inputs as the recipe writes them, each once."""
    paths = [recipe.dtm.source] if isinstance(recipe.dtm, RasterDtm) else []
    paths += [path for layer in recipe.terrain.layers for path in layer.images()]
    return list(dict.fromkeys(paths))
