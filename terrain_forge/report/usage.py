"""The parts of the report page that say how to open a world and what lies where."""

from __future__ import annotations

from collections.abc import Callable
from shlex import quote
from typing import Any

from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import Cell, Html, command, join, paragraph, table

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


def usage_section(built: Built) -> Section:
    """How to open the exports that lie in a built folder."""
    exports = built.recipe.get("exports", {})
    options = exports if isinstance(exports, dict) else {}
    opened = []
    for folder in sorted(path for path in built.directory.iterdir() if path.is_dir()):
        found = ((sorted(folder.glob(pattern)), explain) for pattern, explain in _SIMULATORS)
        scenes, explain = next((pair for pair in found if pair[0]), ([], _gazebo))
        if scenes and folder.name not in _FOLDERS:
            opened.append(explain(folder.name, scenes[0].name, options.get(folder.name, {})))
    python = 'from terrain_forge import World\nworld = World.load(".")'
    opened.append(join([Html("<h3>Python</h3>"), command(python)]))
    commands = paragraph("Commands are run in the folder that holds this page.", "note")
    columns = "".join(f"<div>{way.text}</div>" for way in opened)
    return Section("Open it", (commands, Html(f'<div class="pair">{columns}</div>')))


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


def _drake(folder: str, scene: str, options: dict[str, Any]) -> Html:
    del options
    lines = (
        "from pydrake.multibody.parsing import Parser\n"
        f'Parser(plant).AddModels("{folder}/{scene}")   # contact: see docs/exporters/drake.md'
    )
    return join([Html("<h3>Drake</h3>"), command(lines)])


def _gltf(folder: str, scene: str, options: dict[str, Any]) -> Html:
    del options
    load = f'import bpy; bpy.ops.import_scene.gltf(filepath="{folder}/{scene}")'
    lines = f"blender --python-expr {quote(load)}   # or any viewer of glTF"
    return join([Html("<h3>Blender, glTF</h3>"), command(lines)])


def _mesh(folder: str, scene: str, options: dict[str, Any]) -> Html:
    del options
    lines = f"meshlab {quote(folder)}/{scene}   # or any reader of meshes; metres, z up"
    return join([Html("<h3>Meshes</h3>"), command(lines)])


def _maps(folder: str, scene: str, options: dict[str, Any]) -> Html:
    del options
    return join([Html("<h3>Maps</h3>"), command(f"qgis {quote(folder)}/{scene}")])


def _robot(folder: str, scene: str, options: dict[str, Any]) -> Html:
    del options
    lines = f'ros2 launch urdf_tutorial display.launch.py model:="$PWD"/{quote(folder)}/{scene}'
    return join([Html("<h3>The rover in ROS 2</h3>"), command(lines)])


_SIMULATORS: tuple[tuple[str, Callable[[str, str, dict[str, Any]], Html]], ...] = (
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


def files_section(built: Built) -> Section:
    """What lies in the folder."""
    entries = built.directory.iterdir()
    names = [path.name for path in entries if path.suffix not in (".log", ".html")]
    # The manifest is written last and the timings after it, but whoever reads this has them.
    present = sorted({*names, "manifest.json", "timings.json"})
    rows: list[list[Cell]] = [[name, _FOLDERS.get(name, _EXPORT)] for name in present]
    return Section("Files", (table(("File or folder", "What it holds"), rows, figures="ll"),))
