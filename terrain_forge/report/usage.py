"""The parts of the report page that say how to open a world and what lies where."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from shlex import quote
from typing import Any

from terrain_forge.report.style import Cell, Html, command, join, paragraph, section, table
from terrain_forge.world import World

_FOLDERS = {
    "preview.png": "the picture above",
    "world": "the world itself; World.load reads it back",
    "truth": "GeoTIFFs of ground, top surface and rock ids; rocks.csv; proof of the rocks' sizes",
    "paths": "trajectories as CSV and in the TUM format",
    "validation": "every check with its figure, the driven path, pictures",
    "manifest.json": "the resolved recipe, versions, SHA-256 of every file",
    "timings.json": "wall times",
}

_EXPORT = "an export: world.* is the place, scene.* adds what moves in it"


def usage(world: World, directory: Path) -> list[Html]:
    """How to open the exports that lie in a built folder, and a list of the folder."""
    recipe = json.loads(world.site.recipe_json)
    exports = recipe.get("exports", {})
    options = exports if isinstance(exports, dict) else {}
    opened = []
    for folder in sorted(path for path in directory.iterdir() if path.is_dir()):
        for pattern, explain in _SIMULATORS:
            scenes = sorted(folder.glob(pattern))
            if scenes and folder.name not in _FOLDERS:
                opened.append(explain(folder.name, scenes[0].name, options.get(folder.name, {})))
    python = 'from terrain_forge.world import World\nworld = World.load(".")'
    opened += [
        Html("<h3>Python</h3>"),
        command(python),
    ]
    listed = section("Files", _files(directory))
    commands = paragraph("Commands are run in the folder that holds this page.", "note")
    return [section("Open it", commands, *opened), listed]


def _gazebo(folder: str, scene: str, options: dict[str, Any]) -> Html:
    if options.get("flavour") == "classic":
        lines = f'GAZEBO_MODEL_PATH="$PWD"/{quote(folder)}/models gazebo {quote(folder)}/{scene}'
        return join([Html("<h3>Gazebo Classic</h3>"), command(lines)])
    models = f'"$PWD"/{quote(folder)}/models'
    lines = (
        f"GZ_SIM_RESOURCE_PATH={models} gz sim {quote(folder)}/{scene}\n"
        f"IGN_GAZEBO_RESOURCE_PATH={models} ign gazebo {quote(folder)}/{scene}   # Fortress"
    )
    return join([Html("<h3>Gazebo</h3>"), command(lines)])


def _mujoco(folder: str, scene: str, options: dict[str, Any]) -> Html:
    del options
    lines = f"python -m mujoco.viewer --mjcf={quote(folder)}/{scene}"
    return join([Html("<h3>MuJoCo</h3>"), command(lines)])


def _usd(folder: str, scene: str, options: dict[str, Any]) -> Html:
    del options
    lines = f"usdview {quote(folder)}/{scene}   # or File › Open in Isaac Sim, Omniverse, Blender"
    return join([Html("<h3>USD</h3>"), command(lines)])


_SIMULATORS: tuple[tuple[str, Callable[[str, str, dict[str, Any]], Html]], ...] = (
    ("scene.sdf", _gazebo),
    ("scene.xml", _mujoco),
    ("scene.usd*", _usd),
)
"""The file by which an export is known, and what to do with it."""


def _files(directory: Path) -> Html:
    names = [path.name for path in directory.iterdir() if path.suffix not in (".log", ".html")]
    # The manifest is written last and the timings after it, but whoever reads this has them.
    present = sorted({*names, "manifest.json", "timings.json"})
    rows: list[list[Cell]] = [
        [
            name,
            _FOLDERS.get(
                name, "the world in that format; world.* is the place, scene.* adds what moves"
            ),
        ]
        for name in present
    ]
    return table(("File or folder", "What it holds"), rows, figures="ll")
