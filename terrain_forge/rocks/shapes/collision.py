"""Collision shapes: one convex hull of few vertices, or several parts where one is too coarse."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from terrain_forge.base import Array, RecipeError, fibonacci_sphere
from terrain_forge.model import Mesh
from terrain_forge.rocks.shapes.carving import convex_faces, supporting
from terrain_forge.rocks.shapes.shapes import projections
from terrain_forge.rocks.shapes.solid import hausdorff_distance, mass_properties

_VIEWS = 800
_LEVEL = 1e-9  # of a mean axis: corners of the facet on which the rock rests
_END_WEIGHT = 2.0  # errors near top and base count more: the rock's height, and how it rests

_GROWTH = 1.003  # of parts about their middles
# Level of detail that is cut up, and how far a part may differ from its own hull (CoACD's
# threshold): from the cheapest to the closest.
ATTEMPTS = ((1, 0.2), (1, 0.1), (1, 0.05), (0, 0.05))


class CollisionShape(NamedTuple):
    """Convex parts and how well they stand for a rock."""

    parts: tuple[Mesh, ...]
    """Convex closed meshes, which may overlap."""
    excess: float
    """Volume of their union over the rock's, minus 1."""
    distance: float
    """Hausdorff distance between the union's surface and the rock's [m], to 1 mm."""


def collision_parts(
    meshes: tuple[Mesh, ...], *, vertices: int, excess: float, distance: float, name: str
) -> CollisionShape:
    """Convex parts of at most `vertices` corners each that stand in for a rock.

    One hull where that is close enough; else an approximate convex decomposition (CoACD: Wei et al.
    2022, doi:10.1145/3528223.3530103), the coarsest that is close enough, which takes seconds.

    Args:
        meshes: The rock's levels of detail around the origin, finest first, mean axis 1 m.
        vertices: Largest number of corners of a part, at least 6.
        excess: Largest excess of volume, as a fraction.
        distance: Largest Hausdorff distance [m].
        name: What the rock is called where no decomposition is so close, which is refused.
    """
    tried: list[CollisionShape] = []
    tasks = [(_own_level(meshes, level), concavity) for level, concavity in ATTEMPTS]
    for attempt in (None, *dict.fromkeys(tasks)):
        if attempt is None:
            parts: tuple[Mesh, ...] = (collision_hull(meshes[0], vertices=vertices),)
        else:
            level, concavity = attempt
            parts = _decompose(meshes[level], vertices=vertices, concavity=concavity)
        tried.append(certify(parts, meshes[0]))
        if tried[-1].excess <= excess and tried[-1].distance <= distance:
            return tried[-1]
    best = min(tried, key=lambda one: max(one.excess / excess, one.distance / distance))
    raise RecipeError(
        f"{name}: its convex parts come to {best.excess:.3f} of excess volume (wanted "
        f"{excess:g}) and {best.distance:.3f} mean axes of distance (wanted {distance:g}): "
        "raise hull_excess or hull_distance",
        key=("rocks", "library"),
    )


def _own_level(meshes: tuple[Mesh, ...], level: int) -> int:
    """The first level that is the same mesh: one of few faces need not be cut up twice alike."""
    mesh = meshes[min(level, len(meshes) - 1)]
    return next(
        number
        for number, one in enumerate(meshes)
        if np.array_equal(one.faces, mesh.faces) and np.array_equal(one.vertices, mesh.vertices)
    )


def certify(parts: tuple[Mesh, ...], shape: Mesh) -> CollisionShape:
    """The errors of convex parts as a stand-in for a closed mesh, measured on their union."""
    union = unite(parts)
    volume = mass_properties(shape).volume
    return CollisionShape(
        parts=parts,
        excess=mass_properties(union).volume / volume - 1.0,
        distance=hausdorff_distance(union, shape),
    )


def manifold(mesh: Mesh) -> Any:
    """A closed mesh as manifold3d has it."""
    from manifold3d import Manifold, Mesh64

    return Manifold(Mesh64(mesh.vertices.copy(), mesh.faces.astype(np.uint64)))


def unite(meshes: tuple[Mesh, ...]) -> Mesh:
    """The union of closed meshes."""
    if len(meshes) == 1:
        return meshes[0]
    from manifold3d import Manifold, OpType

    united = Manifold.batch_boolean([*map(manifold, meshes)], OpType.Add).to_mesh64()
    return Mesh(vertices=united.vert_properties[:, :3], faces=united.tri_verts)


def _decompose(mesh: Mesh, *, vertices: int, concavity: float) -> tuple[Mesh, ...]:
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=concavity,
        max_ch_vertex=vertices,
        decimate=True,
        preprocess_mode="off",  # it is closed already; remeshing it takes ten times as long
        seed=0,
    )
    hulls = [convex_hull(np.asarray(points, np.float64)) for points, _ in parts]
    if len(hulls) == 1:
        return tuple(hulls)
    # Parts meet along cuts; grown a little they overlap, so that no crack is left between them.
    middles = [hull.vertices.mean(axis=0) for hull in hulls]
    return tuple(
        hull.replace(vertices=middle + _GROWTH * (hull.vertices - middle))
        for hull, middle in zip(hulls, middles, strict=True)
    )


def collision_hull(mesh: Mesh, *, vertices: int) -> Mesh:
    """A convex hull of at most `vertices` corners that nearly contains the mesh.

    The corners are those of the mesh that its extent in all directions needs most, upward and
    downward ones first. Each is then moved out by half of what the mesh still juts out of the worst
    face around it, so that the error is spread to both sides; but none goes below the facet on
    which the mesh rests, so that the hull rests on it too. The mesh is around the origin.
    """
    from scipy.spatial import ConvexHull

    corners = mesh.vertices[ConvexHull(mesh.vertices).vertices]
    views = fibonacci_sphere(_VIEWS)
    views *= np.where(np.abs(views[:, 2:]) > 0.5, _END_WEIGHT, 1.0)
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
