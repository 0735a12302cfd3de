"""terrain-forge: planetary worlds for people who build and test rovers.

    import terrain_forge as tf

    file = tf.load_recipe("recipes/hello.yaml")
    result = tf.build(file.recipe, "out", folder=file.folder)      # what the command line does
    site = tf.plan(file.recipe, folder=file.folder)                # or stage by stage
    world = tf.realise(site)
    world.ground.height_at(1.0, 2.0)

Names are imported when they are first used, so that `import terrain_forge` is fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for editors and type checkers; at run time __getattr__ imports
    from terrain_forge.building import BuildResult, build, write_world
    from terrain_forge.editing import add_rock, remove_rocks
    from terrain_forge.errors import (
        DataError,
        ExportError,
        OutputError,
        RecipeError,
        SimulationError,
        TerrainForgeError,
    )
    from terrain_forge.motion import Trajectory
    from terrain_forge.pipeline import plan, realise
    from terrain_forge.recipe import Recipe
    from terrain_forge.recipe_file import RecipeFile, load_recipe, save_recipe
    from terrain_forge.registry import ExportReport, exporter, exporter_names
    from terrain_forge.site import Site, Window
    from terrain_forge.world import Heightfield, RockField, RockLibrary, World

__version__ = "0.1.0"

_HOMES = {
    "build": "building",
    "BuildResult": "building",
    "write_world": "building",
    "add_rock": "editing",
    "remove_rocks": "editing",
    "plan": "pipeline",
    "realise": "pipeline",
    "Recipe": "recipe",
    "RecipeFile": "recipe_file",
    "load_recipe": "recipe_file",
    "save_recipe": "recipe_file",
    "ExportReport": "registry",
    "exporter": "registry",
    "exporter_names": "registry",
    "Site": "site",
    "Window": "site",
    "Heightfield": "world",
    "RockField": "world",
    "RockLibrary": "world",
    "Trajectory": "motion",
    "World": "world",
    "TerrainForgeError": "errors",
    "RecipeError": "errors",
    "DataError": "errors",
    "OutputError": "errors",
    "ExportError": "errors",
    "SimulationError": "errors",
}

__all__ = [
    "BuildResult",
    "DataError",
    "ExportError",
    "ExportReport",
    "Heightfield",
    "OutputError",
    "Recipe",
    "RecipeError",
    "RecipeFile",
    "RockField",
    "RockLibrary",
    "SimulationError",
    "Site",
    "TerrainForgeError",
    "Trajectory",
    "Window",
    "World",
    "__version__",
    "add_rock",
    "build",
    "exporter",
    "exporter_names",
    "load_recipe",
    "plan",
    "realise",
    "remove_rocks",
    "save_recipe",
    "write_world",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
