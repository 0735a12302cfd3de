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
        self._solid = cache(lambda kind: self._add(*unit_solid(kind)))
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
    origins = rover.origins
    return [
        solids.node(shape, origins[link.name])
        for link in rover.links
        for shape in link.shapes
        if shape.visible
    ]


def _lengths(shape: Shape) -> list[float]:
    """Scale of the unit solid: a box of side 1, a cylinder and a sphere of diameter 1."""
    if shape.kind in ("box", "mesh"):
        return list(shape.size)
    across = 2.0 * shape.size[0]
    return [across, across, shape.size[1] if shape.kind == "cylinder" else across]


def unit_solid(kind: str) -> tuple[Array, Array, NDArray[np.int64]]:
    """Vertices, normals and faces of a box, cylinder or sphere that is 1 wide and high."""
    from trimesh import creation

    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _RINGS + 1)
    profiles = {
        "cylinder": np.array([(0.0, -0.5), (0.5, -0.5), (0.5, 0.5), (0.0, 0.5)]),
        "sphere": 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=-1),
    }
    made = creation.box() if kind == "box" else creation.revolve(profiles[kind], sections=_SIDES)
    shaded = made.smooth_shaded
    return shaded.vertices, shaded.vertex_normals, shaded.faces
