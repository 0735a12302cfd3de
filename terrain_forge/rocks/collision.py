"""Collision shapes: one convex hull of few vertices, or several parts where one is too coarse."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.mesh import Mesh
from terrain_forge.rocks.carving import convex_faces, fibonacci_sphere, supporting
from terrain_forge.rocks.shapes import projections
from terrain_forge.rocks.solid import mass_properties

Array = NDArray[np.float64]

_VIEWS = 800
_LEVEL = 1e-9  # of a mean axis: corners of the facet on which the rock rests
_TOP_WEIGHT = 2.0  # errors near the top count more: they are the rock's height


_CONCAVITY = 0.05  # CoACD's threshold: what a part may differ from its own hull


def collision_parts(mesh: Mesh, *, vertices: int, excess: float) -> tuple[Mesh, ...]:
    """Convex parts of at most `vertices` corners each that stand in for a mesh.

    One hull, if its volume exceeds the mesh's by at most the fraction `excess`; else an approximate
    convex decomposition (CoACD: Wei et al. 2022, doi:10.1145/3528223.3530103), which takes seconds.

    Args:
        mesh: A closed mesh around the origin.
        vertices: Largest number of corners of a part, at least 6.
        excess: Largest excess of volume that one hull may have, as a fraction.
    """
    hull = collision_hull(mesh, vertices=vertices)
    if mass_properties(hull).volume <= (1.0 + excess) * mass_properties(mesh).volume:
        return (hull,)
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=_CONCAVITY,
        max_ch_vertex=vertices,
        decimate=True,
        seed=0,
    )
    return tuple(convex_hull(np.asarray(points, np.float64)) for points, _ in parts)


def collision_hull(mesh: Mesh, *, vertices: int) -> Mesh:
    """A convex hull of at most `vertices` corners that nearly contains the mesh.

    The corners are those of the mesh that its extent in all directions needs most, upward ones
    first. Each is then moved out by half of what the mesh still juts out of the worst face around
    it, so that the error is spread to both sides; but none goes below the facet on which the mesh
    rests, so that the hull rests on it too.

    Args:
        mesh: A closed mesh around the origin.
        vertices: Largest number of corners, at least 6.
    """
    from scipy.spatial import ConvexHull

    corners = mesh.vertices[ConvexHull(mesh.vertices).vertices]
    views = fibonacci_sphere(_VIEWS)
    views *= np.where(views[:, 2:] > 0.5, _TOP_WEIGHT, 1.0)
    lowest = corners[:, 2].min()
    feet = np.flatnonzero(corners[:, 2] < lowest + _LEVEL)
    inner = corners[supporting(corners, views, vertices, first=feet[:3].tolist())]
    hull = ConvexHull(inner)
    normals = hull.equations[:, :3]
    beyond = projections(corners, normals) + hull.equations[:, 3]
    worst_face = beyond.argmax(axis=1)
    excess = np.zeros(len(normals))
    np.maximum.at(excess, worst_face, beyond.max(axis=1))
    order = np.argsort(excess, kind="stable")  # the worst face around a corner writes last
    shift = np.zeros_like(inner)
    shift[hull.simplices[order]] = 0.5 * (excess[:, None] * normals)[order, None, :]
    moved = inner + shift
    moved[:, 2] = np.maximum(moved[:, 2], lowest)
    return convex_hull(moved)


def convex_hull(points: Array) -> Mesh:
    """The convex hull of points as a closed mesh of its corners alone."""
    from scipy.spatial import ConvexHull

    corners = points[ConvexHull(points).vertices]
    middle = corners.mean(axis=0)
    return Mesh(vertices=corners, faces=convex_faces(corners - middle))
