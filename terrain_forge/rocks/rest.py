"""How scattered rocks lie on the ground: leaning with it, partly buried, without daylight beneath.

The ground's tangent plane at a rock goes through the ground under its centre of mass; its slope is
that of a least-squares plane through the ground on a ring of 0.8 diameters. The rock stands upright
on that plane, sunk into it by its share of burial, and further by as much as the real ground falls
short of the plane along the rock's waterline. Only then is it scaled, so that the part above the
plane has the wanted exposed diameter exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.kernels import inner, kernel, over_chunks
from terrain_forge.rocks.outline import (
    MAX_BURIED,
    MAX_TILT,
    edges,
    exposed_diameter,
    resting_rotation,
    rotation_matrix,
)
from terrain_forge.rocks.scatter import Scattered
from terrain_forge.world import Heightfield, RockField, RockLibrary

Array = NDArray[np.float64]

_RING_RADIUS = 0.4
_RING_POINTS = 12
_UP = (0.0, 0.0, 1.0)
_UPRIGHT = np.eye(3)
_BURIALS = np.linspace(0.0, MAX_BURIED, 7)


def rest(
    *, scattered: Scattered, library: RockLibrary, ground: Heightfield, density: ArrayLike
) -> RockField:
    """Lay rocks on the ground.

    Args:
        scattered: The rocks in plan.
        library: Their shapes.
        ground: Bare ground under all of them, with a margin of `scatter.margin` around the window.
        density: Density of each population's rocks [kg/m³], shape [populations].

    Returns:
        The rocks in the order of `scattered`.

    Raises:
        ValueError: if the centre of a rock lies off the ground.
    """
    x, y = scattered.xy[:, 0], scattered.xy[:, 1]
    if not np.all(ground.covers(x, y)):
        raise ValueError(f"rocks lie off the ground (west, south, east, north: {ground.bounds})")
    # In cells, and rounded, the origin of every window of a site has the same fraction of a cell.
    origin = np.round(np.array(ground.origin) / ground.spacing, 6)
    corner = np.floor(origin)
    shapes, count = _shapes(library), len(scattered.diameter)
    z, scale, height, buried = (np.empty(count) for _ in range(4))
    quaternion = np.empty((count, 4))
    over_chunks(
        _rest,
        count,
        (scattered.xy, scattered.yaw, scattered.buried, scattered.diameter, scattered.prototype),
        scattered.diameter / _upright_diameter(shapes, scattered),
        shapes,
        _Ground(ground.elevation, ground.spacing, origin - corner, corner.astype(np.int64)),
        (z, quaternion, scale, height, buried),
    )
    unit_volume = np.array([prototype.volume for prototype in library.prototypes])
    volume = unit_volume[scattered.prototype] * scale**3
    return RockField(
        populations=scattered.populations,
        id=scattered.id,
        population=scattered.population,
        prototype=scattered.prototype,
        position=np.column_stack([scattered.xy, z]),
        quaternion=quaternion,
        scale=scale,
        diameter=scattered.diameter,
        height=height,
        buried_fraction=buried,
        volume=volume,
        mass=np.asarray(density, np.float64)[scattered.population] * volume,
        loose=scattered.loose,
        solid=scattered.solid,
    )


class _Ground(NamedTuple):
    """The ground's grid, placed on the lattice of its site, so that every window has equal bits."""

    elevation: NDArray[np.float32]
    spacing: float
    fraction: Array
    """Where the lattice's nodes lie, east and north, in parts of a cell, shape [2]."""
    corner: NDArray[np.int64]
    """Whole cells from the site's origin to the south-western node, shape [2]."""


class _Shapes(NamedTuple):
    """The prototypes' meshes, one after the other."""

    vertices: Array
    first_vertex: NDArray[np.int64]
    edges: NDArray[np.int32]
    """Sorted within a prototype by `edge_low`."""
    first_edge: NDArray[np.int64]
    edge_low: Array
    """Height of each edge's lower end."""
    edge_rise: Array
    """Largest rise of an edge of each prototype."""
    low: Array
    """Lowest vertex of each prototype."""
    high: Array
    """Highest vertex of each prototype."""
    width: Array
    """Exposed diameter of each prototype upright, buried by 0 to `MAX_BURIED` in even steps."""


def _shapes(library: RockLibrary) -> _Shapes:
    vertices, pairs, lows, rises, widths = [], [], [], [], []
    for prototype in library.prototypes:
        points, lines = prototype.meshes[0].vertices.copy(), edges(prototype.meshes[0])
        ends = points[lines, 2]
        order = np.argsort(ends.min(axis=1), kind="stable")
        vertices.append(points)
        pairs.append(lines[order])
        lows.append(ends.min(axis=1)[order])
        rises.append(np.ptp(ends, axis=1).max())
        levels = points[:, 2].min() + np.ptp(points[:, 2]) * _BURIALS
        widths.append([exposed_diameter(points, pairs[-1], _UPRIGHT, _UP, h) for h in levels])
    return _Shapes(
        vertices=np.concatenate(vertices),
        first_vertex=np.cumsum([0, *map(len, vertices)]),
        edges=np.concatenate(pairs),
        first_edge=np.cumsum([0, *map(len, pairs)]),
        edge_low=np.concatenate(lows),
        edge_rise=np.array(rises),
        low=np.array([v[:, 2].min() for v in vertices]),
        high=np.array([v[:, 2].max() for v in vertices]),
        width=np.array(widths),
    )


def _upright_diameter(shapes: _Shapes, scattered: Scattered) -> Array:
    """Exposed diameter that rocks of unit scale would have upright, shape [rocks]."""
    diameter = np.empty(len(scattered.buried))
    for prototype, width in enumerate(shapes.width):
        rows = scattered.prototype == prototype
        diameter[rows] = np.interp(scattered.buried[rows], _BURIALS, width)
    return diameter


@kernel
def _rest(first, last, rocks, upright_size, shapes, ground, result):  # type: ignore[no-untyped-def]
    xy, yaw, wanted, diameter, prototype = rocks
    z, quaternion, scale, height, buried = result
    for n in range(first, last):
        p, x, y = prototype[n], xy[n, 0], xy[n, 1]
        vertices = shapes.vertices[shapes.first_vertex[p] : shapes.first_vertex[p + 1]]
        low, span = shapes.low[p], shapes.high[p] - shapes.low[p]
        plane = _tangent_plane(ground, x, y, max(_RING_RADIUS * diameter[n], ground.spacing))
        upright = 1.0 / np.sqrt(1.0 + plane[1] * plane[1] + plane[2] * plane[2])
        turn = resting_rotation(-plane[1] * upright, -plane[2] * upright, upright, yaw[n])
        rotation = rotation_matrix(turn)
        level = low + wanted[n] * span
        # The size that the rock would have upright is close enough to tell how far to sink it.
        size = upright_size[n]
        waterline = _crossing(shapes, p, level)
        gap = _gap(ground, vertices, waterline, rotation, size, level, x, y, plane)
        if gap > 0.0:
            level = min(level + gap * upright / size, max(low + MAX_BURIED * span, level))
            waterline = _crossing(shapes, p, level)
        size = diameter[n] / exposed_diameter(vertices, waterline, rotation, _UP, level)
        for k in range(4):
            quaternion[n, k] = turn[k]
        scale[n] = size
        z[n] = plane[0] - level * size / upright
        height[n] = (low + span - level) * size / upright
        buried[n] = (level - low) / span


@inner
def _crossing(shapes, p, level):  # type: ignore[no-untyped-def]
    """Edges of a prototype among which are all that cross a level."""
    first, last = shapes.first_edge[p], shapes.first_edge[p + 1]
    deepest = level - (1.0 + 1e-9) * shapes.edge_rise[p]
    begin = _first_from(shapes.edge_low, first, last, deepest)
    return shapes.edges[begin : _first_from(shapes.edge_low, begin, last, level)]


@inner
def _first_from(ascending, first, last, value):  # type: ignore[no-untyped-def]
    """Index of the first number in a range of an ascending array that is not below a value."""
    while first < last:
        middle = (first + last) // 2
        if ascending[middle] < value:
            first = middle + 1
        else:
            last = middle
    return first


@inner
def _tangent_plane(ground, x, y, radius):  # type: ignore[no-untyped-def]
    """Height [m] of the ground at a point, and its rise per metre east and north.

    The rise is that of the least-squares plane through a ring of ground, and at most `MAX_TILT`.
    """
    xs, ys, zs = np.empty(_RING_POINTS), np.empty(_RING_POINTS), np.empty(_RING_POINTS)
    mean_x = mean_y = 0.0
    for k in range(_RING_POINTS):
        angle = 2.0 * np.pi * k / _RING_POINTS
        xs[k], ys[k] = _onto(ground, x + radius * np.cos(angle), y + radius * np.sin(angle))
        zs[k] = _height(ground, xs[k], ys[k])
        mean_x, mean_y = mean_x + xs[k], mean_y + ys[k]
    mean_x, mean_y = mean_x / _RING_POINTS, mean_y / _RING_POINTS
    xx = xy = yy = xz = yz = 0.0
    for k in range(_RING_POINTS):
        east, north = xs[k] - mean_x, ys[k] - mean_y
        xx, xy, yy = xx + east * east, xy + east * north, yy + north * north
        xz, yz = xz + east * zs[k], yz + north * zs[k]
    determinant = xx * yy - xy * xy
    slope_x = (yy * xz - xy * yz) / determinant
    slope_y = (xx * yz - xy * xz) / determinant
    steepness = np.sqrt(slope_x * slope_x + slope_y * slope_y)
    share = min(1.0, np.tan(MAX_TILT) / steepness) if steepness > 0.0 else 1.0
    return _height(ground, x, y), slope_x * share, slope_y * share


@inner
def _gap(ground, vertices, edges, rotation, size, level, x, y, plane):  # type: ignore[no-untyped-def]
    """How far the ground lies below its tangent plane along the rock's waterline, at most [m]."""
    gap = 0.0
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        one, other = vertices[a, 2] - level, vertices[b, 2] - level
        if (one >= 0.0) == (other >= 0.0):
            continue
        part = one / (one - other)
        u = vertices[a, 0] + part * (vertices[b, 0] - vertices[a, 0])
        v = vertices[a, 1] + part * (vertices[b, 1] - vertices[a, 1])
        dx = size * (rotation[0, 0] * u + rotation[0, 1] * v + rotation[0, 2] * level)
        dy = size * (rotation[1, 0] * u + rotation[1, 1] * v + rotation[1, 2] * level)
        east, north = _onto(ground, x + dx, y + dy)
        wanted = plane[0] + plane[1] * (east - x) + plane[2] * (north - y)
        gap = max(gap, wanted - _height(ground, east, north))
    return gap


@inner
def _onto(ground, x, y):  # type: ignore[no-untyped-def]
    """The nearest point of the grid's rectangle."""
    rows, columns = ground.elevation.shape
    west, south = ground.corner[0] + ground.fraction[0], ground.corner[1] + ground.fraction[1]
    east, north = west + (columns - 1), south + (rows - 1)
    x, y = max(x, west * ground.spacing), max(y, south * ground.spacing)
    return min(x, east * ground.spacing), min(y, north * ground.spacing)


@inner
def _height(ground, x, y):  # type: ignore[no-untyped-def]
    """Height [m] of the triangulated ground, cells cut from south-west to north-east."""
    elevation = ground.elevation
    rows, columns = elevation.shape
    u, v = x / ground.spacing - ground.fraction[0], y / ground.spacing - ground.fraction[1]
    i = min(max(int(np.floor(u)) - ground.corner[0], 0), columns - 2)
    j = min(max(int(np.floor(v)) - ground.corner[1], 0), rows - 2)
    u, v = u - (i + ground.corner[0]), v - (j + ground.corner[1])
    sw, ne = np.float64(elevation[j, i]), np.float64(elevation[j + 1, i + 1])
    if u >= v:
        se = np.float64(elevation[j, i + 1])
        return sw + u * (se - sw) + v * (ne - se)
    nw = np.float64(elevation[j + 1, i])
    return sw + v * (nw - sw) + u * (ne - nw)
