"""GLB scenes and plain meshes in trimesh, which shares nothing with our writers."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Mesh
from terrain_forge.validation.conformance.consumer import Consumer
from terrain_forge.validation.conformance.outlines import split_merged
from terrain_forge.validation.conformance.probe import is_ground, rock_of
from terrain_forge.validation.conformance.reading import Reading, SolidsOfRocks, Track
from terrain_forge.validation.conformance.sample import Sample, free_of_rocks
from terrain_forge.validation.surface_mesh import heights_on

_Z_UP = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)])
"""From glTF's axes, y up, to the world's."""


def read_glb(sample: Sample, folder: Path, scratch: Path) -> Reading:
    """A GLB as trimesh has it, turned to the world's axes; its animations as the file has them."""
    import trimesh

    del scratch
    path = folder / "world.glb"
    scene = trimesh.load(path, force="scene", process=False)
    parts = ((node, _Z_UP @ matrix[:3], mesh) for node, matrix, mesh in _nodes(scene))
    ground, solids = _sorted(sample, parts)
    unsaid = "glTF has no physics"
    reasons = dict.fromkeys(("masses", "gravity", "balls"), unsaid)
    return Reading(
        consumer=f"trimesh {trimesh.__version__}",
        ground=tuple(ground),
        seen=solids.solids(),
        tracks=tuple(_animations(path)),
        reasons={**reasons, "findings": "trimesh has no validator"},
    )


def read_meshes(sample: Sample, folder: Path, scratch: Path) -> Reading:
    """An OBJ, STL or PLY export as trimesh has it.

    Where ground and rocks are one mesh, the ground is asked where no rock reaches.
    """
    import trimesh

    del scratch
    options: dict[str, dict[str, Any]] = {
        "obj": {"split_objects": True, "group_material": False},
        "stl": {},
        "ply": {},
    }
    scenes = [
        trimesh.load(file, force="scene", process=False, **more)
        for ending, more in options.items()
        for file in sorted(folder.glob(f"*.{ending}"))
    ]
    parts = [(node, matrix[:3], mesh) for scene in scenes for node, matrix, mesh in _nodes(scene)]
    ground, solids = _sorted(sample, parts)
    reasons = dict.fromkeys(("masses", "gravity", "path", "balls"), "a mesh carries shapes alone")
    reading = Reading(
        consumer=f"trimesh {trimesh.__version__}",
        ground=tuple(ground),
        seen=solids.solids(),
        reasons={**reasons, "findings": "trimesh has no validator"},
    )
    return reading if ground else _without_names(sample, reading, parts)


def _without_names(
    sample: Sample, reading: Reading, parts: Sequence[tuple[str, Array, Any]]
) -> Reading:
    """The reading of files that do not tell ground from rocks."""
    heights = np.full(len(sample.points), np.nan)
    for _, matrix, mesh in parts:
        surface = Mesh(vertices=mesh.vertices @ matrix[:, :3].T + matrix[:, 3], faces=mesh.faces)
        heights = np.fmax(heights, heights_on(surface, sample.points))
    hidden = ~free_of_rocks(sample.world, sample.points, margin=0.0)
    reasons = {**reading.reasons, "frames": "ground and rocks are one mesh"}
    return replace(reading, heights=heights, hidden=hidden, reasons=reasons)


def _nodes(scene: Any) -> Iterator[tuple[str, Array, Any]]:
    """Name, matrix and mesh of every node of a trimesh scene that has one."""
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        yield str(node), matrix, scene.geometry[geometry]


def _sorted(
    sample: Sample, parts: Iterable[tuple[str, Array, Any]]
) -> tuple[list[Mesh], SolidsOfRocks]:
    """Ground and rocks of placed meshes."""
    ground: list[Mesh] = []
    solids = SolidsOfRocks(sample.rocks)
    for name, matrix, mesh in parts:
        rock = rock_of(name)
        if rock is not None and not solids.wants(rock):
            continue
        vertices = mesh.vertices @ matrix[:, :3].T + matrix[:, 3]
        placed = Mesh(vertices=vertices, faces=mesh.faces)
        if rock is not None:
            solids.add(rock, vertices)
        elif is_ground(name):
            ground.append(placed)
        else:
            solids.add_merged(*split_merged(sample, placed))
    return ground, solids


def _animations(path: Path) -> Iterator[Track]:
    """The moving nodes of a GLB, turned to the world's axes; trimesh leaves animations out.

    A node's motion is in the frame of its parent, the root, whose own turn makes it y up.
    """
    content = path.read_bytes()
    length, _ = struct.unpack_from("<II", content, 12)
    asset = json.loads(content[20 : 20 + length])
    binary = memoryview(content)[20 + length + 8 :]

    def values(accessor: int) -> Array:
        said = asset["accessors"][accessor]
        view = asset["bufferViews"][said["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[said["type"]]
        start = view.get("byteOffset", 0) + said.get("byteOffset", 0)
        found = np.frombuffer(binary, "<f4", count=width * said["count"], offset=start)
        return found.reshape(-1, width).astype(np.float64)

    for animation in asset.get("animations", []):
        found = {}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            found[channel["target"]["path"]] = values(sampler["output"])
            found["time"] = values(sampler["input"])[:, 0]
        yield Track(
            name=animation["name"],
            time=found["time"],
            position=found["translation"],
            quaternion=np.roll(found["rotation"], 1, axis=1),
        )


GLB = Consumer(name="trimesh", kinds=("glb",), read=read_glb)
"""trimesh's reader of GLB."""
MESHES = Consumer(name="trimesh", kinds=("mesh",), read=read_meshes)
"""trimesh's readers of OBJ, STL and PLY."""
