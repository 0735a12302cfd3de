"""Meshes of a rover's file: read in metres, one for each colour, and their convex hulls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, portable
from terrain_forge.model import Mesh
from terrain_forge.rovers.assembly import Solid, placed

KEY = ("rover", "file")
_GREY = (0.6, 0.6, 0.6)


class MeshFiles:
    """Reads each mesh file once; remembers which files it read."""

    def __init__(self) -> None:
        self.read: dict[Path, list[tuple[Array, NDArray[np.int32], tuple[float, ...]]]] = {}

    def solids(
        self,
        path: Path,
        *,
        scale: Array,
        placement: Array,
        collides: bool,
        rgb: tuple[float, float, float] | None,
    ) -> list[Solid]:
        """The mesh of a file as solids: a solid for each colour to look at, a hull to touch.

        Args:
            path: The file.
            scale: Factors along the file's axes, shape [3].
            placement: In the body's frame, shape [4, 4].
            collides: Whether to touch, else to look at.
            rgb: Colour in place of the file's own.

        Raises:
            DataError: if it is missing or no mesh.
        """
        parts = [(v * scale, f, colour) for v, f, colour in self._parts(path)]
        if collides:
            vertices, faces = hull_of(np.concatenate([v for v, _, _ in parts]), path.name)
            return [mesh_solid(vertices, faces, placement, collides=True, rgb=_GREY)]
        return [
            mesh_solid(v, f, placement, collides=False, rgb=rgb or (c[0], c[1], c[2]))
            for v, f, c in parts
        ]

    def _parts(self, path: Path) -> list[tuple[Array, NDArray[np.int32], tuple[float, ...]]]:
        if path not in self.read:
            self.read[path] = _load(path)
        return self.read[path]


def mesh_solid(
    vertices: Array,
    faces: NDArray[np.int32],
    placement: Array,
    *,
    collides: bool,
    rgb: tuple[float, float, float],
) -> Solid:
    """Triangles as a solid, whose origin becomes the centre of their box."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre = (low + high) / 2
    return Solid(
        kind="mesh",
        size=tuple((high - low).tolist()),
        placement=portable.product(placement, placed(centre, np.eye(3))),
        collides=collides,
        visible=not collides,
        rgb=rgb,
        mesh=Mesh(vertices=vertices - centre, faces=faces),
    )


def hull_of(vertices: Array, name: str) -> tuple[Array, NDArray[np.int32]]:
    """The convex hull of points, shape [n, 3].

    Raises:
        DataError: if they enclose no volume.
    """
    import trimesh
    from scipy.spatial import QhullError

    try:
        hull = trimesh.convex.convex_hull(vertices)
    except QhullError:
        raise DataError(f"{name}: a mesh that is flat cannot be collided with", key=KEY) from None
    return np.array(hull.vertices, np.float64), np.array(hull.faces, np.int32)


def _load(path: Path) -> list[tuple[Array, NDArray[np.int32], tuple[float, ...]]]:
    import trimesh

    if not path.is_file():
        raise DataError(f"mesh {path.name} is missing: looked for {path}", key=KEY)
    try:
        scene = trimesh.load_scene(path)
    except ImportError as error:
        raise DataError(f"mesh {path.name} needs the package {error.name}", key=KEY) from None
    except Exception as error:  # trimesh's readers raise whatever a broken file provokes
        why = " ".join(str(error).split())
        raise DataError(f"mesh {path.name} cannot be read: {why}", key=KEY) from None
    if path.suffix.lower() == ".dae" and scene.units not in (None, "m", "meter", "meters"):
        scene = scene.convert_units("meters")
    parts: dict[tuple[float, ...], list[Any]] = {}
    for mesh in scene.dump():
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            parts.setdefault(_colour(mesh), []).append(mesh)
    if not parts:
        raise DataError(f"mesh {path.name} holds no triangles", key=KEY)
    joined: list[tuple[tuple[float, ...], Any]] = [
        (colour, trimesh.util.concatenate(meshes)) for colour, meshes in parts.items()
    ]
    return [
        (np.array(mesh.vertices, np.float64), np.array(mesh.faces, np.int32), colour)
        for colour, mesh in joined
    ]


def _colour(mesh: Any) -> tuple[float, ...]:
    """The mesh's main sRGB colour, 0 to 1; grey where it has none."""
    material = getattr(mesh.visual, "material", None)
    colour = getattr(material, "main_color", None)
    if colour is None:
        colour = mesh.visual.main_color if mesh.visual.defined else np.multiply(255, _GREY)
    return tuple((np.asarray(colour, np.float64)[:3] / 255.0).round(3).tolist())
