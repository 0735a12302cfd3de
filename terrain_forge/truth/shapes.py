"""How good a world's rock shapes are: whether closed, and how far their stand-ins are off."""

from __future__ import annotations

from typing import Any

import numpy as np

from terrain_forge.model import Mesh, RockLibrary, RockPrototype


def shape_figures(library: RockLibrary) -> dict[str, Any]:
    """Figures of each shape, and the worst of all.

    - `hull_excess`: summed volume of the collision parts over the volume of the shape, minus 1;
    - `hull_distance`: Hausdorff distance between the surface of the parts' union and the shape's,
      over its mean axis;
    - `outline_errors`: for each level of detail, how far its outline is off the finest one's from
      any side, over the mean axis;
    - `watertight`: whether all its meshes and collision parts are closed and face outward.
    """
    shapes = [_figures(prototype) for prototype in library.prototypes]
    return {
        "count": len(shapes),
        "watertight": sum(shape["watertight"] for shape in shapes),
        "largest_hull_excess": max((shape["hull_excess"] for shape in shapes), default=0.0),
        "largest_hull_distance": max((shape["hull_distance"] for shape in shapes), default=0.0),
        "largest_outline_error": max(
            (error for shape in shapes for error in shape["outline_errors"]), default=0.0
        ),
        "shapes": shapes,
    }


def _figures(prototype: RockPrototype) -> dict[str, Any]:
    return {
        "family": prototype.family,
        "axes": np.ptp(prototype.meshes[0].vertices, axis=0).tolist(),
        "faces": [len(mesh.faces) for mesh in prototype.meshes],
        "collision_parts": len(prototype.hulls),
        "collision_vertices": sum(len(hull.vertices) for hull in prototype.hulls),
        "hull_excess": prototype.hull_excess,
        "hull_distance": prototype.hull_distance,
        "outline_errors": list(prototype.outline_errors),
        "watertight": all(map(is_closed, (*prototype.meshes, *prototype.hulls))),
    }


def is_closed(mesh: Mesh) -> bool:
    """Whether a mesh is closed and faces outward.

    Closed: each edge is walked once each way, by two faces, so that none is open or turned over.
    Outward: the volume that the faces enclose is positive.
    """
    faces = mesh.faces.astype(np.int64)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    count = len(mesh.vertices)
    there, back = np.sort(begin * count + end), np.sort(end * count + begin)
    a, b, c = (mesh.vertices[faces[:, corner]] for corner in range(3))
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c)))
    once = bool(np.all(there[1:] > there[:-1]))
    return volume > 0.0 and once and bool(np.array_equal(there, back))
