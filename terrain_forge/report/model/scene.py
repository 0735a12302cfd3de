"""The model of the 3-D view, from a built world to the bytes of a GLB."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, linear_from_srgb, quaternion_from_rpy, xyzw
from terrain_forge.geometry import grid_faces
from terrain_forge.model import World
from terrain_forge.report.blocks import jpeg
from terrain_forge.report.lines import Line
from terrain_forge.report.model.ground import Overlay, Relief, coarsen
from terrain_forge.report.model.rocks import INSTANCING, add_painted, rock_nodes
from terrain_forge.report.model.rover import rover_nodes
from terrain_forge.report.recorded.measures import WorldSweep
from terrain_forge.writers import Gltf

_UNLIT = "KHR_materials_unlit"
_HALF = 0.5**0.5
_Z_UP_TO_Y_UP = (-_HALF, 0.0, 0.0, _HALF)
"""Turns the world's axes (east, north, up) into glTF's (x, z, -y), as (x, y, z, w)."""
_POINTS, _LINE_STRIP = 0, 3
_MOST_POINTS, _POINT_HEIGHT = 40_000, 0.02
_LINE_HEIGHT = 0.12
_QUALITY = 82
_BEHIND = 4.0
"""Distance of the first view from the rover [m], besides twice the rover's length."""


def page_model(
    world: World,
    *,
    picture: NDArray[np.uint8],
    overlays: Sequence[Overlay],
    lines: Sequence[Line],
    sweep: WorldSweep | None = None,
) -> bytes:
    """The GLB: ground of at most 257² nodes, the largest rocks, lines, the rover at its start.

    The children of its one root are named `ground`, `rocks`, `lines`, `sweep` and `rover`. The
    ground has the picture, the world from above with north up, which is the first material; those
    of the overlays, which nothing wears, follow. Lines are laid a little above the ground.
    """
    relief = coarsen(world.ground)
    with TemporaryDirectory() as folder, (Path(folder) / "arrays").open("w+b") as binary:
        gltf = Gltf(binary)
        groups = {"ground": [_ground(gltf, relief, picture)]}
        for overlay in overlays:
            _paint(gltf, overlay.name, overlay.pixels)
        groups["rocks"] = list(rock_nodes(world, relief, gltf))
        groups["lines"] = [_line(gltf, relief, line) for line in lines]
        groups["sweep"] = [_points(gltf, world, relief, sweep)] if sweep else []
        groups["rover"] = rover_nodes(world.rover, gltf)
        # The root stands upright in glTF's frame; its children are the groups.
        root = {"name": world.site.name, "rotation": _Z_UP_TO_Y_UP}
        nodes: list[dict[str, Any]] = [{**root, "children": []}]
        for name, parts in groups.items():
            place = _start(world, relief) if name == "rover" else {}
            nodes[0]["children"].append(len(nodes))
            first = len(nodes) + 1
            below = {"children": list(range(first, first + len(parts)))} if parts else {}
            nodes += [{"name": name, **place, **below}, *parts]
        path = Path(folder) / "world.glb"
        gltf.write(
            path,
            nodes=map(json.dumps, nodes),
            in_nodes=[INSTANCING] if len(world.field) else [],
            scene=0,
            scenes=[{"nodes": [0]}],
        )
        return path.read_bytes()


def _ground(gltf: Gltf, relief: Relief, picture: NDArray[np.uint8]) -> dict[str, Any]:
    attributes = {
        "POSITION": gltf.add_vertices(relief.vertices(), bounded=True),
        "TEXCOORD_0": gltf.add_vertices(relief.texture_coordinates()),
    }
    primitive = {
        "attributes": attributes,
        "indices": gltf.add_indices(grid_faces(*relief.unit.shape)),
        "material": _paint(gltf, "Picture", picture),
    }
    return {"mesh": gltf.add("meshes", {"primitives": [primitive]})}


def _paint(gltf: Gltf, name: str, pixels: NDArray[np.uint8]) -> int:
    """Add a material that shows an image as it is."""
    image = jpeg(pixels, _QUALITY)
    return add_painted(gltf, name, image, tiles=False, extensions={_UNLIT: {}})


def _line(gltf: Gltf, relief: Relief, line: Line) -> dict[str, Any]:
    heights = relief.height_at(line.points) + _LINE_HEIGHT
    points = np.column_stack([line.points, heights]).astype(np.float32)
    rgb = np.frombuffer(bytes.fromhex(line.colour[1:]), np.uint8) / 255.0
    colour = [*linear_from_srgb(rgb).tolist(), 1.0]
    look = {"pbrMetallicRoughness": {"baseColorFactor": colour}, "extensions": {_UNLIT: {}}}
    primitive = {
        "attributes": {"POSITION": gltf.add_vertices(points, bounded=True)},
        "material": gltf.add("materials", {"name": line.name, **look}),
        "mode": _LINE_STRIP,
    }
    mesh = gltf.add("meshes", {"primitives": [primitive]})
    return {"name": line.name, "mesh": mesh, "extras": {"driven": line.driven}}


def _points(gltf: Gltf, world: World, relief: Relief, sweep: WorldSweep) -> dict[str, Any]:
    """Points coloured by ring, which rise and sink with the ground below them."""
    from matplotlib import colormaps

    rows = np.unique(np.linspace(0, len(sweep.points) - 1, _MOST_POINTS).astype(np.int64))
    points = sweep.points[rows].copy()
    west, south, east, north = world.ground.bounds
    inside = np.clip(points[:, :2], (west, south), (east, north))
    own = world.ground.height_at(inside[:, 0], inside[:, 1])
    points[:, 2] += relief.height_at(inside) - own + _POINT_HEIGHT
    share = sweep.ring[rows] / max(sweep.rings - 1, 1)
    colours = colormaps["plasma"](0.3 + 0.7 * share)[:, :3]
    attributes = {
        "POSITION": gltf.add_vertices(points.astype(np.float32), bounded=True),
        "COLOR_0": gltf.add_vertices(linear_from_srgb(colours).astype(np.float32)),
    }
    look = gltf.add("materials", {"name": "sweep", "extensions": {_UNLIT: {}}})
    primitive = {"attributes": attributes, "material": look, "mode": _POINTS}
    return {"name": "sweep of a lidar", "mesh": gltf.add("meshes", {"primitives": [primitive]})}


def _start(world: World, relief: Relief) -> dict[str, Any]:
    """Where the rover stands: at the start of the first path, or else amid the ground."""
    if world.trajectories:
        position, rpy = world.trajectories[0].position[0].copy(), world.trajectories[0].rpy[0]
    else:
        west, south, east, north = world.ground.bounds
        position, rpy = np.array([0.5 * (west + east), 0.5 * (south + north), 0.0]), np.zeros(3)
        position[2] = world.ground.height_at(position[0], position[1])
    own = world.ground.height_at(position[0], position[1])
    position[2] += relief.height_at(position[None, :2])[0] - own
    turn = xyzw(quaternion_from_rpy(rpy))
    look = _look(world, relief, position, ahead=np.array([np.cos(rpy[2]), np.sin(rpy[2])]))
    return {"translation": position.tolist(), "rotation": turn.tolist(), "extras": look}


def _look(world: World, relief: Relief, start: Array, *, ahead: Array) -> dict[str, Any]:
    """Where the view begins: some metres behind the rover, over all that stands between."""
    wheels = [np.ptp(world.rover.wheel_centres, axis=0).max()] if world.rover.wheels else []
    behind = _BEHIND + 2.0 * max(wheels, default=0.0)
    line = start[:2] + np.linspace(-behind, 0.0, 25)[:, None] * ahead
    eye, target = line[0], start[:2] + behind * ahead
    field = world.field
    apart = np.linalg.norm(field.position[:, None, :2] - line, axis=-1).min(axis=1)
    near = apart < 0.5 * field.diameter + 0.5
    tops = field.position[near, 2] + field.diameter[near]
    highest = np.append(tops, relief.height_at(line)).max()
    return {
        "eye": [*eye.tolist(), float(highest + 0.4 * behind)],
        "target": [*target.tolist(), float(relief.height_at(target[None])[0])],
    }
