"""A rover as triangles: what rays meet, and the mesh files that all formats share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from terrain_forge.base import (
    Array,
    linear_from_srgb,
    matrix_from_quaternion,
    quaternion_from_rpy,
)
from terrain_forge.model import Mesh, Rover, Shape
from terrain_forge.scene import Instances
from terrain_forge.writers import MattMaterial, write_mtl, write_obj

_MATERIALS = "rover.mtl"
_SIDES = 20
_SMOOTH = 1e-6
"""Size that rover parts have for the renderer, which grows no grain on what is so small [m]."""


def rover_mesh(link: int, shape: int) -> str:
    """Name of the file of a link's shape, both counted from 0."""
    return f"rover_{link}_{shape}.obj"


def write_rover_meshes(rover: Rover, folder: Path) -> list[str]:
    """Write the meshes of a rover's shapes, in metres, and their colours; returns the files' names.

    RViz colours a mesh of OBJ by the file's own material alone, grey without one.
    """
    looks = []
    for number, link in enumerate(rover.links):
        for part, shape in enumerate(link.shapes):
            if shape.mesh is None:
                continue
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / rover_mesh(number, part)
            looks.append(MattMaterial(name=path.stem, rgb=shape.rgb))
            material = _MATERIALS, path.stem
            mesh = shape.mesh
            write_obj(path, vertices=mesh.vertices, faces=mesh.faces, material=material)
    if not looks:
        return []
    write_mtl(folder / _MATERIALS, looks)
    return [*(f"{look.name}.obj" for look in looks), _MATERIALS]


class RoverLook(NamedTuple):
    """The visible shapes of one colour on a link."""

    link: str
    """Name of the link."""
    mesh: Mesh
    """In the link's frame; faces share no vertex, so that they are shaded with sharp edges."""
    rgb: tuple[float, float, float]
    """sRGB colour, 0 to 1."""


def rover_looks(rover: Rover) -> list[RoverLook]:
    """A rover's visible shapes, one mesh for each link and colour."""
    looks = []
    for link in rover.links:
        meshes = dict[tuple[float, float, float], list[Array]]()
        for shape in link.shapes:
            if shape.visible:
                meshes.setdefault(shape.rgb, []).append(shape_triangles(shape))
        for rgb, parts in meshes.items():
            corners = np.concatenate(parts).reshape(-1, 3)
            faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
            looks.append(RoverLook(link.name, Mesh(vertices=corners, faces=faces), rgb))
    return looks


def rover_instances(looks: Sequence[RoverLook], places: Mapping[str, Array]) -> Instances:
    """A rover's looks where their links are in its frame at rest [m], for the renderer."""
    count = len(looks)
    colours = np.array([look.rgb for look in looks]).reshape(-1, 3)
    return Instances(
        meshes=tuple(look.mesh for look in looks),
        mesh=np.arange(count, dtype=np.int32),
        position=np.array([places[look.link] for look in looks]).reshape(-1, 3),
        rotation=np.tile(np.eye(3), (count, 1, 1)),
        scale=np.ones(count),
        grain=np.full(count, _SMOOTH),
        rgb=linear_from_srgb(np.round(255.0 * colours) / 255.0),
    )


def shape_triangles(shape: Shape) -> Array:
    """Corners of a shape's triangles in its link's frame [m], shape [triangles, 3, 3]."""
    import trimesh

    if shape.kind == "mesh" and shape.mesh is not None:
        corners = shape.mesh.vertices[shape.mesh.faces]
    else:
        made = {
            "box": lambda: trimesh.creation.box(shape.size),
            "cylinder": lambda: trimesh.creation.cylinder(
                radius=shape.size[0], height=shape.size[1], sections=_SIDES
            ),
            "sphere": lambda: trimesh.creation.icosphere(2, shape.size[0]),
        }[shape.kind]()
        corners = np.asarray(made.triangles)
    rotation = matrix_from_quaternion(quaternion_from_rpy(shape.rpy))
    return np.asarray(corners @ rotation.T + shape.position)
