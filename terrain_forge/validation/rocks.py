"""Whether rocks lie apart from each other."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from terrain_forge.world import RockField, RockLibrary, rotations

Array = NDArray[np.float64]


def overlapping_pairs(field: RockField, library: RockLibrary) -> list[tuple[int, int]]:
    """Ids of rocks whose outlines overlap, seen from above; what is buried counts too.

    Circles around the centres of mass settle nearly all pairs; the convex outlines the rest.
    """
    radius = _plan_radius(field, library)
    order = np.argsort(field.position[:, 0] - radius, kind="stable")
    near = _touching_circles(field.position[order, :2], radius[order])
    pairs = [tuple(sorted((int(order[i]), int(order[j])))) for i, j in near]
    return [
        (int(field.id[i]), int(field.id[j]))
        for i, j in sorted(pairs)
        if _outlines_overlap(_plan(field, library, i), _plan(field, library, j))
    ]


def _points(library: RockLibrary, prototype: int) -> Array:
    return np.vstack([hull.vertices for hull in library.prototypes[prototype].hulls])


def _plan_radius(field: RockField, library: RockLibrary) -> Array:
    """Largest horizontal distance of each rock's hulls from its centre of mass [m]."""
    radius = np.zeros(len(field))
    matrices = rotations(field)[:, :2] * field.scale[:, None, None]
    for prototype in range(len(library.prototypes)):
        rows = np.flatnonzero(field.prototype == prototype)
        plan = matrices[rows] @ _points(library, prototype).T
        radius[rows] = np.sqrt((plan**2).sum(axis=1).max(axis=1)) if len(rows) else 0.0
    return radius


@njit(cache=True)
def _touching_circles(centres, radius):  # type: ignore[no-untyped-def]
    """Pairs of circles that overlap; circles ascend by their western edge."""
    pairs = [(np.int64(0), np.int64(0)) for _ in range(0)]
    for i in range(len(radius)):
        j = i + 1
        while j < len(radius) and centres[j, 0] - radius[j] < centres[i, 0] + radius[i]:
            apart = np.hypot(centres[j, 0] - centres[i, 0], centres[j, 1] - centres[i, 1])
            if apart < radius[i] + radius[j]:
                pairs.append((np.int64(i), np.int64(j)))
            j += 1
    return pairs


def _plan(field: RockField, library: RockLibrary, row: int) -> Array:
    """Corners of a rock's convex outline from above, counter-clockwise, shape [corners, 2] [m]."""
    from scipy.spatial import ConvexHull

    matrix = rotations(field.select(np.array([row])))[0, :2] * field.scale[row]
    plan = _points(library, int(field.prototype[row])) @ matrix.T + field.position[row, :2]
    return np.asarray(plan[ConvexHull(plan).vertices])


def _outlines_overlap(one: Array, other: Array) -> bool:
    """Separating axis theorem: convex outlines are apart if an edge of one parts them."""
    for outline in (one, other):
        edges = np.roll(outline, -1, axis=0) - outline
        normals = np.column_stack([edges[:, 1], -edges[:, 0]])
        gap = (normals @ other.T).min(axis=1) - (normals @ one.T).max(axis=1)
        back = (normals @ one.T).min(axis=1) - (normals @ other.T).max(axis=1)
        if max(gap.max(), back.max()) > 0:
            return False
    return True
