"""Heights of the triangles beyond a world under points."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, Mask
from terrain_forge.model import Horizon
from terrain_forge.terrain.horizon.rings import Lattice, Ring, partners, rings_around


def heights_beyond(ground: Lattice, horizon: Horizon, east: ArrayLike, north: ArrayLike) -> Array:
    """Heights of the triangulated ground under points beyond a world's edge [m].

    Args:
        ground: The world's ground.
        horizon: What lies beyond it.
        east: Of the points [m].
        north: Of the points [m].

    Raises:
        ValueError: if a point lies within the world or beyond the reach.
    """
    rings = rings_around(ground, horizon.reach)
    return heights_on(rings, horizon.mesh.vertices, ground, east, north)


def heights_on(
    rings: list[Ring], vertices: Array, ground: Lattice, east: ArrayLike, north: ArrayLike
) -> Array:
    """As `heights_beyond`, of rings whose nodes' places and heights are known.

    Raises:
        ValueError: if a point lies within the world or beyond the reach.
    """
    x, y = np.broadcast_arrays(*(np.asarray(c, np.float64) for c in (east, north)))
    west, south, far_east, far_north = ground.bounds
    beyond = np.stack([south - y, x - far_east, y - far_north, west - x])
    away, side = beyond.max(axis=0), beyond.argmax(axis=0)
    aways = np.array([ring.away for ring in rings])
    if not np.all((away >= 0.0) & (away <= aways[-1])):
        raise ValueError(f"point not 0 to {aways[-1]:.0f} m beyond the world's edge")
    width, depth = far_east - west, far_north - south
    along = np.choose(
        side, [x - west + away, y - south + away, far_east + away - x, far_north + away - y]
    ) / (np.choose(side % 2, [width, depth]) + 2.0 * away)
    heights, missing = np.empty(x.shape), np.ones(x.shape, np.bool_)
    own = np.clip(np.searchsorted(aways, away, side="right") - 1, 0, len(aways) - 2)
    starts = np.cumsum([0, *(len(ring.points) for ring in rings)])
    for beside in (1, -1, 0):  # nodes lie up to half the way to the next ring from their own
        strip = np.clip(own + beside, 0, len(aways) - 2)
        for number in np.unique(strip[missing]).tolist():
            pair = [(rings[n], int(starts[n])) for n in (number, number + 1)]
            for edge in range(4):
                chosen = missing & (strip == number) & (side == edge)
                if chosen.any():
                    places = np.column_stack([x[chosen], y[chosen]])
                    found, inside = _on_strip(vertices, pair, edge, along[chosen], places)
                    heights[chosen] = found
                    missing[chosen] = ~inside
    return heights


def _on_strip(
    vertices: Array, pair: list[tuple[Ring, int]], side: int, along: Array, places: Array
) -> tuple[Array, Mask]:
    """Heights between a ring and the next, along one side, and which places lie there."""
    fine, coarse = (ring.parts[side] for ring, _ in pair)
    i, j = (
        np.clip(np.searchsorted(t, along, side="right") - 1, 0, len(t) - 2) for t in (fine, coarse)
    )
    outward, inward = partners(len(fine) - 1, len(coarse) - 1)

    def node(which: int, index: NDArray[np.int64]) -> NDArray[np.int64]:
        ring, start = pair[which]
        first = sum(len(part) - 1 for part in ring.parts[:side])
        return np.asarray(start + (first + index) % len(ring.points))

    near = _plane(vertices, (node(0, i), node(1, outward[i]), node(0, i + 1)), places)
    far = _plane(vertices, (node(1, j), node(1, j + 1), node(0, inward[j])), places)
    return np.where(near[1], near[0], far[0]), near[1] | far[1]


def _plane(
    vertices: Array, corners: tuple[NDArray[np.int64], ...], places: Array
) -> tuple[Array, Mask]:
    """Heights of triangles' planes at places, and whether those lie in them."""
    a, b, c = (vertices[corner] for corner in corners)
    u, v, p = b - a, c - a, places - a[:, :2]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    s = (p[:, 0] * v[:, 1] - p[:, 1] * v[:, 0]) / area
    t = (u[:, 0] * p[:, 1] - u[:, 1] * p[:, 0]) / area
    inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)
    return a[:, 2] + s * u[:, 2] + t * v[:, 2], inside
