"""How far a rock can reach in plan, however it comes to rest."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel, portable
from terrain_forge.model import Mesh, RockPrototype
from terrain_forge.rocks.embedding.outline import (
    MAX_BURIED,
    MAX_TILT,
    convex_hull,
    edges,
    embedding_rotation,
    exposed_diameter,
    extent,
    farthest,
    rotation_matrix,
)

FOOTPRINT_DIRECTIONS = 32
"""Directions in which a footprint is known, evenly around."""

_BOUND_YAWS = 12
_BOUND_TILTS = 3
_BOUND_LEANS = 1 + _BOUND_TILTS * _BOUND_YAWS
_BOUND_BURIALS = 4
_BOUND_MARGIN = 1.04


def bounds(mesh: Mesh) -> tuple[float, float]:
    """Reach and rise of a prototype over all the ways in which it may come to rest.

    Sweeps the tilt of the ground (0 to `MAX_TILT`), the rock's yaw on it and its burial (0 to
    `MAX_BURIED`), with a margin of 4 % for what lies between the samples. Reach is the largest
    horizontal distance of any vertex, buried or not, from the mesh's origin, rise the largest
    vertical one above the tangent plane; both over the exposed diameter.
    """
    reach, rise, _ = _sweep(mesh.vertices.copy(), edges(mesh))
    return float(reach) * _BOUND_MARGIN, float(rise) * _BOUND_MARGIN


def footprint(mesh: Mesh) -> Array:
    """Support function of the plan area that holds a rock however it comes to rest.

    Over the same tilts and burials as `bounds` and with the same margin: how far the rock, buried
    parts too, reaches from its origin over its diameter, along `FOOTPRINT_DIRECTIONS` directions
    counter-clockwise from where the yaw turns the prototype's x axis, shape [directions].
    """
    return _support(mesh.vertices.tobytes(), edges(mesh).tobytes())


@lru_cache(maxsize=256)  # the check, the scattering and the embedding ask for the same shapes
def _support(vertices: bytes, edges: bytes) -> Array:
    points, ends = np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(edges, np.int32)
    _, _, support = _sweep(points.copy(), ends.reshape(-1, 2).copy())
    support *= _BOUND_MARGIN
    support.setflags(write=False)
    return np.asarray(support)


def footprints(
    prototypes: Sequence[RockPrototype], chosen: NDArray[np.integer]
) -> dict[int, Array]:
    """Footprints of those prototypes that some rocks have, by their index."""
    return {n: footprint(prototypes[n].meshes[0]) for n in np.unique(chosen).tolist()}


def fits(plan: Array, *, yaw: float, support: Array, reach: float) -> bool:
    """Whether points of a rock lie within its footprint and within its reach.

    Points and reach are over the diameter, from the origin of the footprint, which has the yaw.
    """
    angles = yaw + 2.0 * np.pi * np.arange(FOOTPRINT_DIRECTIONS) / FOOTPRINT_DIRECTIONS
    along = (portable.product(plan, np.stack([np.cos(angles), np.sin(angles)]))).max(axis=0)
    return bool(np.all(along <= support) and np.hypot(plan[:, 0], plan[:, 1]).max() <= reach)


@kernel
def _sweep(vertices, edges):  # type: ignore[no-untyped-def]
    """Largest reach, rise and support over all ways to rest, each over the exposed diameter."""
    up = (0.0, 0.0, 1.0)
    low, high = extent(vertices, up)
    reach = rise = 0.0
    support, smallest = np.zeros(FOOTPRINT_DIRECTIONS), np.empty(_BOUND_LEANS)
    for burial in range(_BOUND_BURIALS + 1):
        level = low + (high - low) * MAX_BURIED * burial / _BOUND_BURIALS
        waterline = _waterline(vertices, edges, level)
        for step in range(_BOUND_LEANS):
            rotation = _leaning(step)
            diameter = exposed_diameter(vertices, waterline, rotation, up, level)
            rise = max(rise, (high - level) / np.cos(_tilt(step)) / diameter)
            smallest[step] = diameter if burial == 0 else min(smallest[step], diameter)
    plan = np.empty((len(vertices), 2))
    for step in range(_BOUND_LEANS):
        turn = _leaning(step)
        for v in range(len(vertices)):
            x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
            plan[v, 0] = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z
            plan[v, 1] = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z
        hull = convex_hull(plan)
        reach = max(reach, np.sqrt(farthest(hull, 0.0, 0.0)[1]) / smallest[step])
        for d in range(FOOTPRINT_DIRECTIONS):
            angle = 2.0 * np.pi * d / FOOTPRINT_DIRECTIONS
            east, north = np.cos(angle), np.sin(angle)
            for n in range(len(hull)):
                along = hull[n, 0] * east + hull[n, 1] * north
                support[d] = max(support[d], along / smallest[step])
    return reach, rise, support


@inner
def _tilt(step):  # type: ignore[no-untyped-def]
    """Tilt of the ground [rad] at one step of the sweep."""
    return MAX_TILT * ((step + _BOUND_YAWS - 1) // _BOUND_YAWS) / _BOUND_TILTS


@inner
def _leaning(step):  # type: ignore[no-untyped-def]
    """Rotation of a rock on the ground at one step of the sweep, shape [3, 3]."""
    tilt, azimuth = _tilt(step), 2.0 * np.pi * step / _BOUND_YAWS
    east, north = np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth)
    return rotation_matrix(embedding_rotation(east, north, np.cos(tilt), 0.0))


@inner
def _waterline(vertices, edges, level):  # type: ignore[no-untyped-def]
    """The edges that cross a height, shape [edges, 2]."""
    kept = np.empty_like(edges)
    count = 0
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        if (vertices[a, 2] - level >= 0.0) != (vertices[b, 2] - level >= 0.0):
            kept[count, 0], kept[count, 1] = a, b
            count += 1
    return kept[:count]
