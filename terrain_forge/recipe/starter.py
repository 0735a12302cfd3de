"""The first recipe that `terrain-forge init` writes, with its DTM."""

from __future__ import annotations

import os
import shutil
from importlib.resources import as_file, files
from pathlib import Path

from terrain_forge.base import OutputError

RECIPE = "hello.yaml"
DTM = "gale_floor_synthetic.tif"


def write_starter(directory: Path) -> Path:
    """Write hello.yaml and its DTM into a folder; returns the recipe.

    Raises:
        OutputError: if one of them is there already, or the folder cannot be written.
    """
    recipe, dtm = directory / RECIPE, directory / DTM
    for path in (recipe, dtm):
        if os.path.lexists(path):
            raise OutputError(f"{path} exists already")
    text = files("terrain_forge.recipes").joinpath(RECIPE).read_text(encoding="utf-8")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with as_file(files("terrain_forge.dtm_samples").joinpath(DTM)) as source:
            shutil.copyfile(source, dtm)
        recipe.write_text(text.replace(f"../dtm_samples/{DTM}", DTM), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{directory} cannot be written: {error.strerror}") from None
    return recipe
