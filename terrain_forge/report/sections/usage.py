"""The parts of the report page that say how to open a world and what lies where."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from shlex import quote
from typing import Any

from terrain_forge.report.blocks import Block, Shown, heading, paragraph, table
from terrain_forge.report.section import Built, Section

_FOLDERS = {
    "preview.png": "the picture above",
    "world": "the world itself; World.load reads it back",
    "truth": "GeoTIFFs of ground, top surface and rock ids; rocks.csv; size-frequency verification",
    "paths": "trajectories as CSV and in the TUM format",
    "validation": "every check with its figure, the driven path, pictures",
    "manifest.json": "the resolved recipe, versions, SHA-256 of every file",
    "timings.json": "wall times",
}

_EXPORT = "an export: world.* is the place, scene.* adds what moves in it"


class Usage(Section):
    """How to open the exports that lie in a built folder."""

    kind, title, place = "usage", "Open it", 20

    def blocks(self, built: Built) -> Sequence[Block]:
        """Commands for each export, and for Python."""
        exports = built.recipe.get("exports", {})
        options = exports if isinstance(exports, dict) else {}
        opened = []
        for folder in sorted(path for path in built.directory.iterdir() if path.is_dir()):
            found = ((sorted(folder.glob(pattern)), explain) for pattern, explain in _SIMULATORS)
            scenes, explain = next((pair for pair in found if pair[0]), ([], _gazebo))
            if scenes and folder.name not in _FOLDERS:
                opened.append(explain(folder.name, scenes[0].name, options.get(folder.name, {})))
        opened.append(("Python", 'from terrain_forge import World\nworld = World.load(".")'))
        columns = [[heading(name), Block(kind="command", text=lines)] for name, lines in opened]
        note = paragraph("Commands are run in the folder that holds this page.", "note")
        return [note, Block(kind="pair", columns=columns)]


def _gazebo(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    if options.get("flavour") == "classic":
        lines = f'GAZEBO_MODEL_PATH="$PWD"/{quote(folder)}/models gazebo {quote(folder)}/{scene}'
        return "Gazebo Classic", lines
    models = f'"$PWD"/{quote(folder)}/models'
    lines = (
        f"GZ_SIM_RESOURCE_PATH={models} gz sim {quote(folder)}/{scene}\n"
        f"IGN_GAZEBO_RESOURCE_PATH={models} ign gazebo {quote(folder)}/{scene}   # Fortress"
    )
    return "Gazebo", lines


def _mujoco(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    del options
    lines = f"python -m mujoco.viewer --mjcf={quote(folder)}/{scene}"
    return "MuJoCo", lines


def _usd(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    del options
    lines = f"usdview {quote(folder)}/{scene}   # or File › Open in Isaac Sim, Omniverse, Blender"
    return "USD", lines


def _drake(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    del options
    lines = (
        "from pydrake.multibody.parsing import Parser\n"
        f'Parser(plant).AddModels("{folder}/{scene}")   # contact: see docs/exporters/drake.md'
    )
    return "Drake", lines


def _gltf(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    del options
    load = f'import bpy; bpy.ops.import_scene.gltf(filepath="{folder}/{scene}")'
    lines = f"blender --python-expr {quote(load)}   # or any viewer of glTF"
    return "Blender, glTF", lines


def _mesh(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    del options
    lines = f"meshlab {quote(folder)}/{scene}   # or any reader of meshes; metres, z up"
    return "Meshes", lines


def _maps(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    del options
    return "Maps", f"qgis {quote(folder)}/{scene}"


def _robot(folder: str, scene: str, options: dict[str, Any]) -> tuple[str, str]:
    del options
    lines = f'ros2 launch urdf_tutorial display.launch.py model:="$PWD"/{quote(folder)}/{scene}'
    return "The rover in ROS 2", lines


_SIMULATORS: tuple[tuple[str, Callable[[str, str, dict[str, Any]], tuple[str, str]]], ...] = (
    ("scene.sdf", _gazebo),
    ("scene.xml", _mujoco),
    ("scene.usd*", _usd),
    ("world.sdf", _drake),
    ("world.glb", _gltf),
    ("world.obj", _mesh),
    ("world.ply", _mesh),
    ("world.stl", _mesh),
    ("elevation.tif", _maps),
    ("*.urdf", _robot),
)
"""The file by which an export is known, and what to do with it; the first that fits counts."""


class Files(Section):
    """What lies in the folder."""

    kind, title, place = "files", "Files", 120

    def blocks(self, built: Built) -> Sequence[Block]:
        """A table of files and folders."""
        entries = built.directory.iterdir()
        names = [path.name for path in entries if path.suffix not in (".log", ".html")]
        # The manifest is written last and the timings after it, but whoever reads this has them.
        present = sorted({*names, "manifest.json", "timings.json"})
        rows: list[list[Shown]] = [[name, _FOLDERS.get(name, _EXPORT)] for name in present]
        return [table(("File or folder", "What it holds"), rows, figures="ll")]
