"""The recipes that `terrain-forge init` writes, each with its DTM."""

from __future__ import annotations

import os
import re
import shutil
from importlib.resources import as_file, files
from pathlib import Path

from terrain_forge.base import OutputError, RecipeError, StorageError

_RECIPES, _SAMPLES = "terrain_forge.recipes", "terrain_forge.dtm_samples"
_SAMPLE = re.compile(r"\.\./dtm_samples/([\w.-]+)")


def starters() -> dict[str, str]:
    """The recipes that ship, by name, and the first sentence of each."""
    found = {}
    for entry in files(_RECIPES).iterdir():
        if entry.name.endswith(".yaml"):
            found[entry.name.removesuffix(".yaml")] = _about(entry.read_text(encoding="utf-8"))
    return dict(sorted(found.items(), key=lambda one: (one[0] != "hello", one[0])))


def _about(text: str) -> str:
    """The first sentence of the comment that a recipe begins with."""
    comment = []
    for line in text.splitlines():
        if not re.match(r"# \S", line):
            break
        comment.append(line[2:].strip())
    return re.split(r"(?<=[.;]) ", " ".join(comment))[0].rstrip(".;")


def write_starter(directory: Path, name: str = "hello") -> Path:
    """Write a recipe that ships, and its DTM, into a folder; returns the recipe.

    Raises:
        RecipeError: if there is no recipe of that name, or the folder is called like a recipe.
        OutputError: if one of them is there already; a DTM may be, where it is the very same.
        StorageError: if the folder cannot be written.
    """
    name = name.removesuffix(".yaml")
    if name not in starters():
        raise RecipeError(f"no recipe is called {name!r}, there are: {', '.join(starters())}")
    called = re.sub(r"\.ya?ml$", "", directory.name, flags=re.IGNORECASE)
    odd = called != directory.name or called in {*starters()} - {name}
    if odd and not directory.is_dir():
        wanted = called if called in starters() else name
        raise RecipeError(
            f"{directory} is called like a recipe: name a folder, or --recipe {wanted}"
        )
    text = files(_RECIPES).joinpath(f"{name}.yaml").read_text(encoding="utf-8")
    samples = dict.fromkeys(_SAMPLE.findall(text))
    recipe = directory / f"{name}.yaml"
    missing = [sample for sample in samples if not _is_there(directory / sample, sample)]
    for path in (recipe, *(directory / sample for sample in missing)):
        if os.path.lexists(path):
            raise OutputError(f"{path} exists already: choose another folder")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for sample in missing:
            with as_file(files(_SAMPLES).joinpath(sample)) as source:
                shutil.copyfile(source, directory / sample)
        recipe.write_text(_SAMPLE.sub(r"\1", text), encoding="utf-8")
    except (FileExistsError, NotADirectoryError):
        raise OutputError(f"{directory} is no folder: choose another") from None
    except OSError as error:
        raise StorageError(f"{directory} cannot be written: {error.strerror}") from None
    return recipe


def _is_there(path: Path, sample: str) -> bool:
    """Whether a file is the sample, byte for byte."""
    try:
        return path.is_file() and path.read_bytes() == files(_SAMPLES).joinpath(sample).read_bytes()
    except OSError:
        return False
