"""From a blank to triangle meshes at several levels of detail."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from terrain_forge.kernels import kernel
from terrain_forge.mesh import Mesh
from terrain_forge.rocks.shapes import Blank, convex_gauge, projections, radii

Array = NDArray[np.float64]

LEVELS = (642, 162, 42)
"""Vertices of the levels of detail: 1280, 320 and 80 faces."""

_CANDIDATES = 2000
_VIEWS = 400
_CREASE_WEIGHT = 0.3  # a full turn of the normal counts like so many mean axes of distance
_FLATTENING = 0.35  # bends facets by a little so that their triangulation is Delaunay-like


class Sphere:
    """Directions evenly over the sphere, and the triangles between them, to look for vertices."""

    def __init__(self) -> None:
        self.directions = fibonacci_sphere(_CANDIDATES)
        self.faces = convex_faces(self.directions)
        self.views = fibonacci_sphere(_VIEWS)


def fibonacci_sphere(count: int) -> Array:
    """`count` unit vectors spread evenly, shape [count, 3] (golden-angle spiral)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)


def carve(blank: Blank, sphere: Sphere) -> tuple[Mesh, ...]:
    """The rock's meshes, finest first, in the blank's frame; coarser vertices are among the finer.

    Vertices are chosen farthest first in position and normal together, so they gather along edges.
    The coarsest level has those that carry the silhouette. The triangulation is that of the convex
    part of the blank; being star-shaped, it stays closed and free of self-intersection whatever the
    roughness does to the radii.
    """
    points = sphere.directions * radii(blank, sphere.directions)[:, None] * blank.axes
    normals = vertex_normals(points, sphere.faces)
    features = np.hstack([points, _CREASE_WEIGHT * normals]).T.copy()
    chosen = farthest_first(features, np.zeros(1, np.intp), LEVELS[0])
    outer = supporting(points[chosen], sphere.views, LEVELS[-1])
    kept = np.ascontiguousarray(features[:, chosen])
    chosen = chosen[farthest_first(kept, outer, LEVELS[0])]
    points, directions = points[chosen], sphere.directions[chosen]
    gauge = np.sqrt(convex_gauge(blank, directions) ** 2 + _FLATTENING**2)
    convex = directions / gauge[:, None]
    return tuple(Mesh(vertices=points[:n], faces=convex_faces(convex[:n])) for n in LEVELS)


def convex_faces(points: Array) -> NDArray[np.int32]:
    """Outward triangles of the convex hull of points around the origin, all of them corners.

    Raises:
        ArithmeticError: if some point is not a corner of the hull.
    """
    from scipy.spatial import ConvexHull

    faces = np.asarray(ConvexHull(points).simplices, dtype=np.int32)
    if len(faces) != 2 * len(points) - 4:
        raise ArithmeticError(f"{len(points)} points give a hull of {len(faces)} faces")
    return outward(points, faces)


def outward(points: Array, faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Faces of a star-shaped body around the origin, turned counter-clockwise from outside."""
    a, b, c = (points[faces[:, n]] for n in range(3))
    inward = np.einsum("ij,ij->i", np.cross(a, b), c) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)


def vertex_normals(points: Array, faces: NDArray[np.int32]) -> Array:
    """Unit normals at the vertices, faces weighted by area, shape [vertices, 3]."""
    a, b, c = (points[faces[:, n]] for n in range(3))
    areas = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    corners = faces.ravel()
    summed = [np.bincount(corners, areas[:, axis], len(points)) for axis in range(3)]
    normals = np.stack(summed, axis=1)
    return cast(Array, normals / np.linalg.norm(normals, axis=1, keepdims=True))


def supporting(
    points: Array, views: Array, count: int, *, first: Sequence[int] = ()
) -> NDArray[np.intp]:
    """Indices of `count` points whose extent along all `views` comes nearest to that of all points.

    Greedy: `first` and the ends of the three axes, then time and again the outermost point of the
    view that is worst off. Fewer where fewer reach the full extent in every view.

    Args:
        points: Positions, shape [points, 3].
        views: Directions; a longer one counts for more, shape [views, 3].
        count: Number of points wanted.
        first: Indices of points that must be among them.
    """
    heights = projections(views, points)
    best, full = heights.argmax(axis=1), heights.max(axis=1)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    ends = projections(axes, points).argmax(axis=1)
    chosen = list(dict.fromkeys([*first, *ends]))[:count]
    reached = heights[:, chosen].max(axis=1)
    while len(chosen) < count:
        worst = int(np.argmax(full - reached))
        if full[worst] <= reached[worst]:
            break
        chosen.append(best[worst])
        reached = np.maximum(reached, heights[:, best[worst]])
    return np.array(chosen, dtype=np.intp)


@kernel
def farthest_first(features, first, count):  # type: ignore[no-untyped-def]
    """Indices of `count` columns: those of `first`, then each farthest from all before it.

    Gonzalez 1985, doi:10.1016/0304-3975(85)90224-5.
    """
    rows, columns = features.shape
    chosen, nearest, squared = np.empty(count, np.intp), np.empty(columns), np.empty(columns)
    for n in range(len(first)):
        chosen[n] = first[n]
    for column in range(columns):
        nearest[column] = np.inf
    for n in range(count - 1):
        for column in range(columns):
            squared[column] = 0.0
        for row in range(rows):
            centre = features[row, chosen[n]]
            for column in range(columns):
                squared[column] += (features[row, column] - centre) ** 2
        for column in range(columns):
            nearest[column] = min(nearest[column], squared[column])
        if n + 1 >= len(first):
            farthest = 0
            for column in range(columns):
                if nearest[column] > nearest[farthest]:
                    farthest = column
            chosen[n + 1] = farthest
    return chosen
