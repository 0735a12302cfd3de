"""The rover of the 3-D view: its simple solids where it starts."""

from __future__ import annotations

from functools import cache
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, linear_from_srgb, quaternion_from_rpy, xyzw
from terrain_forge.model import Rover, Shape
from terrain_forge.writers import Gltf, vertex_normals

_SIDES = 24
_RINGS = 12
MOST_FACES = 100_000


class Solids:
    """The meshes of a rover's shapes; simple ones are scaled from unit solids, each added once.

    Args:
        gltf: The asset.
        most_faces: A mesh of more faces is shown as the box around it.
    """

    def __init__(self, gltf: Gltf, *, most_faces: int) -> None:
        self._gltf = gltf
        self._most_faces = most_faces
        self._solid = cache(lambda kind: self._add(*SOLIDS[kind]()))
        self._look = cache(self._add_look)
        self._mesh = cache(self._add_mesh)

    def node(self, shape: Shape, origin: Array) -> dict[str, Any]:
        """The node of a shape whose link's frame begins at `origin`, in base_link's frame [m]."""
        turn = xyzw(quaternion_from_rpy(shape.rpy))
        place = {"translation": (origin + shape.position).tolist(), "rotation": turn.tolist()}
        if shape.mesh is not None and len(shape.mesh.faces) <= self._most_faces:
            mesh = shape.mesh
            normals = vertex_normals(mesh.vertices, mesh.faces)
            primitive = self._add(mesh.vertices, normals, mesh.faces)
            primitive["material"] = self._look(tuple(shape.rgb))
            return {"mesh": self._gltf.add("meshes", {"primitives": [primitive]}), **place}
        kind = "box" if shape.kind == "mesh" else shape.kind
        return {"mesh": self._mesh(kind, tuple(shape.rgb)), **place, "scale": _lengths(shape)}

    def _add_mesh(self, kind: str, rgb: tuple[float, ...]) -> int:
        primitive = {**self._solid(kind), "material": self._look(rgb)}
        return self._gltf.add("meshes", {"primitives": [primitive]})

    def _add_look(self, rgb: tuple[float, ...]) -> int:
        colour = [*linear_from_srgb(np.array(rgb)).tolist(), 1.0]
        look = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.8}
        return self._gltf.add("materials", {"pbrMetallicRoughness": look})

    def _add(self, vertices: Array, normals: Array, faces: NDArray[Any]) -> dict[str, Any]:
        attributes = {
            "POSITION": self._gltf.add_vertices(vertices.astype(np.float32), bounded=True),
            "NORMAL": self._gltf.add_vertices(normals.astype(np.float32)),
        }
        return {"attributes": attributes, "indices": self._gltf.add_indices(faces)}


def rover_nodes(rover: Rover, gltf: Gltf) -> list[dict[str, Any]]:
    """Nodes of the rover's visible shapes in base_link's frame, as it stands at rest.

    Where its meshes have too many faces in all, the largest ones are shown as boxes.
    """
    shapes = [shape for link in rover.links for shape in link.shapes if shape.visible]
    faces = sorted(len(shape.mesh.faces) for shape in shapes if shape.mesh is not None)
    fitting = [n for n, total in zip(faces, accumulate(faces), strict=True) if total <= MOST_FACES]
    solids = Solids(gltf, most_faces=max(fitting, default=0))
    origins: dict[str, Array] = {}
    nodes = []
    for link in rover.links:
        origin = origins[link.parent] + link.origin if link.parent else np.zeros(3)
        origins[link.name] = origin
        nodes += [solids.node(shape, origin) for shape in link.shapes if shape.visible]
    return nodes


def _lengths(shape: Shape) -> list[float]:
    """Scale of the unit solid: a box of side 1, a cylinder and a sphere of diameter 1."""
    if shape.kind in ("box", "mesh"):
        return list(shape.size)
    across = 2.0 * shape.size[0]
    return [across, across, shape.size[1] if shape.kind == "cylinder" else across]


def _box() -> tuple[Array, Array, NDArray[np.int64]]:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    vertices, normals = [], []
    for axis in range(3):
        for side in (-0.5, 0.5):
            first = corners[:: 1 if side > 0 else -1]
            vertices.append(np.roll(np.insert(first, 2, side, axis=1), axis + 1, axis=1))
            normals.append(np.tile(np.roll((0, 0, 2 * side), axis + 1), (4, 1)))
    halves = np.array([(0, 1, 2), (0, 2, 3)])
    faces = (4 * np.arange(6)[:, None, None] + halves).reshape(-1, 3)
    return np.concatenate(vertices), np.concatenate(normals), faces


def _lathe(profile: Array, slopes: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """A profile (radius, z) from the bottom up, with its normals, turned about z."""
    angle = 2.0 * np.pi * np.arange(_SIDES + 1) / _SIDES
    around = np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def turned(rows: Array) -> Array:
        plan = rows[:, None, :1] * around[None]
        height = np.broadcast_to(rows[:, None, 1:], (len(rows), len(angle), 1))
        return np.concatenate([plan, height], axis=-1).reshape(-1, 3)

    ring, side = np.meshgrid(np.arange(len(profile) - 1), np.arange(_SIDES), indexing="ij")
    a = (ring * (_SIDES + 1) + side).ravel()
    b, c, d = a + 1, a + _SIDES + 2, a + _SIDES + 1
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return turned(profile), turned(slopes), faces


def _cylinder() -> tuple[Array, Array, NDArray[np.int64]]:
    profile = np.array([(0, -0.5), (0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (0.5, 0.5), (0, 0.5)])
    slopes = np.array([(0, -1), (0, -1), (1, 0), (1, 0), (0, 1), (0, 1)], np.float64)
    return _lathe(profile, slopes)


def _sphere() -> tuple[Array, Array, NDArray[np.int64]]:
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _RINGS + 1)
    slopes = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return _lathe(0.5 * slopes, slopes)


SOLIDS = {"box": _box, "cylinder": _cylinder, "sphere": _sphere}
