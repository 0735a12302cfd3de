"""From a blank to triangle meshes at several levels of detail."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, fibonacci_sphere
from terrain_forge.model import Mesh
from terrain_forge.rocks.shapes.shapes import Blank, projections, radii
from terrain_forge.rocks.shapes.simplification import simplify
from terrain_forge.rocks.shapes.solid import cuts_itself

LEVELS = 3
"""Levels of detail of a rock."""
TIMES_FEWER = 4
"""How many times fewer vertices a level has than the one before."""
MOST_VERTICES = 962
"""Vertices of the finest level, at most."""

CLOSE_VERTICES = 2562
"""Vertices of a rock's close mesh, at most."""

_CANDIDATES = 5000
_CLOSE_CANDIDATES = 12_000
_SLENDER = 4.0  # length over width


class Sphere:
    """Directions evenly over the sphere, and the triangles between them, to look for vertices."""

    def __init__(self, *, close: bool = False) -> None:
        self.directions = fibonacci_sphere(_CLOSE_CANDIDATES if close else _CANDIDATES)
        self.faces = convex_faces(self.directions)


def carve(blank: Blank, sphere: Sphere) -> tuple[Mesh, ...]:
    """The rock's meshes, finest first, in the blank's frame.

    The blank is sampled densely; its vertices then merge until so many are left as the level may
    have, which gathers them where the surface bends and leaves them on its edges. All levels are
    star-shaped about the blank's centre, so that none cuts itself.
    """
    meshes = [simplify(_sampled(blank, sphere), blank.vertices, star_shaped=True)]
    for _ in range(LEVELS - 1):
        fewer = len(meshes[-1].vertices) // TIMES_FEWER
        meshes.append(simplify(meshes[-1], fewer, star_shaped=True))
    return tuple(meshes)


def carve_close(blank: Blank, sphere: Sphere) -> Mesh:
    """The same rock for pictures from a metre, in the blank's frame."""
    return simplify(_sampled(blank, sphere), CLOSE_VERTICES, star_shaped=True)


def _sampled(blank: Blank, sphere: Sphere) -> Mesh:
    points = sphere.directions * radii(blank, sphere.directions)[:, None] * blank.axes
    return Mesh(vertices=points, faces=sphere.faces)


def levels_of_detail(mesh: Mesh) -> tuple[Mesh, ...]:
    """The close mesh and the levels of detail, finest first, of any closed mesh.

    They have at most `CLOSE_VERTICES`, `MOST_VERTICES` and ever fewer. One that would cut itself
    gets half as many vertices again, until it is the mesh itself or as fine as the one before. A
    needle is simplified as a shorter one, since
    few vertices along it leave none but slender triangles.
    """
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    spreads, axes = np.linalg.eigh(np.einsum("ij,ik->jk", centred, centred))
    shorter = _SLENDER * float(np.sqrt(spreads[1] / spreads[2]))
    if shorter >= 1.0:
        return _levels(mesh)
    along = np.outer(axes[:, 2], axes[:, 2])  # projects onto the long axis
    squeeze, stretch = (np.eye(3) + (times - 1.0) * along for times in (shorter, 1.0 / shorter))
    short = mesh.replace(vertices=projections(mesh.vertices, squeeze))
    return tuple(
        level.replace(vertices=projections(level.vertices, stretch)) for level in _levels(short)
    )


def _levels(mesh: Mesh) -> tuple[Mesh, ...]:
    meshes = [mesh]
    for level in range(LEVELS):
        meshes.append(_fewer(meshes[-1], MOST_VERTICES // TIMES_FEWER**level))
    return _fewer(mesh, CLOSE_VERTICES), *meshes[1:]


def _fewer(finer: Mesh, count: int) -> Mesh:
    """A mesh of so many vertices or more that does not cut itself."""
    found = simplify(finer, count)
    while found is not finer and cuts_itself(found):
        count = (3 * count) // 2
        found = simplify(finer, count)
    return found


def convex_faces(points: Array) -> NDArray[np.int32]:
    """Outward triangles of the convex hull of points around the origin, all of them corners."""
    from scipy.spatial import ConvexHull

    faces = np.asarray(ConvexHull(points).simplices, dtype=np.int32)
    if len(faces) != 2 * len(points) - 4:
        raise ArithmeticError(f"{len(points)} points give a hull of {len(faces)} faces")
    a, b, c = (points[faces[:, n]] for n in range(3))
    inward = np.einsum("ij,ij->i", np.cross(a, b), c) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)


def supporting(
    points: Array, views: Array, count: int, *, first: Sequence[int]
) -> NDArray[np.intp]:
    """Indices of `count` points whose extent along all `views` comes nearest to that of all points.

    Greedy: `first` and the ends of the three axes, then time and again the outermost point of the
    view that is worst off. Fewer where fewer reach the full extent in every view.
    A longer view counts for more.
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
