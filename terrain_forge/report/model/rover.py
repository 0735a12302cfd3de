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

    A mesh of more faces than `most_faces` is shown as the box around it.
    """

    def __init__(self, gltf: Gltf, *, most_faces: int) -> None:
        self._gltf = gltf
        self._most_faces = most_faces
        self._solid = cache(lambda kind: self._add(*unit_solid(kind)))
        self._look = cache(self._add_look)
        self._simple = cache(lambda kind, rgb: self._add_mesh(self._solid(kind), rgb))

    def node(self, shape: Shape, origin: Array) -> dict[str, Any]:
        """The node of a shape whose link's frame begins at `origin`, in base_link's frame [m]."""
        turn = xyzw(quaternion_from_rpy(shape.rpy))
        place = {"translation": (origin + shape.position).tolist(), "rotation": turn.tolist()}
        rgb, mesh = tuple(shape.rgb), shape.mesh
        if mesh is not None and len(mesh.faces) <= self._most_faces:
            normals = vertex_normals(mesh.vertices, mesh.faces)
            solid = self._add(mesh.vertices, normals, mesh.faces)
            return {"mesh": self._add_mesh(solid, rgb), **place}
        kind = "box" if shape.kind == "mesh" else shape.kind
        # Unit solids: a box of side 1, a cylinder and a sphere of diameter 1.
        across, length = 2.0 * shape.size[0], shape.size[-1]
        round_size = [across, across, length if kind == "cylinder" else across]
        scale = list(shape.size) if kind == "box" else round_size
        return {"mesh": self._simple(kind, rgb), **place, "scale": scale}

    def _add_mesh(self, solid: dict[str, Any], rgb: tuple[float, ...]) -> int:
        primitive = {**solid, "material": self._look(rgb)}
        return self._gltf.add("meshes", {"primitives": [primitive]})

    def _add_look(self, rgb: tuple[float, ...]) -> int:
        colour = [*linear_from_srgb(np.array(rgb)).tolist(), 1.0]
        look = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.8}
        return self._gltf.add("materials", {"pbrMetallicRoughness": look})

    def _add(self, vertices: Array, normals: Array, faces: NDArray[Any]) -> dict[str, Any]:
        return self._gltf.add_primitive(vertices, normals, self._gltf.add_indices(faces))


def rover_nodes(rover: Rover, gltf: Gltf) -> list[dict[str, Any]]:
    """Nodes of the rover's visible shapes in base_link's frame, as it stands at rest.

    Where its meshes have too many faces in all, the largest ones are shown as boxes.
    """
    shapes = [(link.name, shape) for link in rover.links for shape in link.shapes if shape.visible]
    faces = sorted(len(shape.mesh.faces) for _, shape in shapes if shape.mesh is not None)
    fitting = [n for n, total in zip(faces, accumulate(faces), strict=True) if total <= MOST_FACES]
    solids, origins = Solids(gltf, most_faces=max(fitting, default=0)), rover.origins
    return [solids.node(shape, origins[name]) for name, shape in shapes]


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
