"""How high the ground stands all around points of it: exact rays over a grid's triangles.

A ray goes over squares of a pyramid of greatest heights, large ones where nothing in them can rise
above what it has met, and looks at the triangles of the others. Heights are those above the
horizontal plane of the map's centre, so that rays are straight and the body's curvature is in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel, over_chunks
from terrain_forge.model import Heightfield

LOWEST = -20.0
"""Slope that no horizon is below."""
_NUDGE = 1e-7
"""Part of a cell by which a ray is over a border."""
_BESIDE = 1e-2
"""Part of a cell right beside a point that hides nothing: on a node, but for a hair, the face that
the point is on would else stand for the horizon behind the node."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relief:
    """A grid with the greatest heights of its squares."""

    ground: Heightfield
    """Heights above the plane through the map's centre [m]."""
    tops: NDArray[np.float32]
    """Greatest heights of squares of 1, 2, 4, … cells, level after level, row after row."""
    levels: NDArray[np.int64]
    """Where a level begins in `tops`, its rows and its columns, shape [levels, 3]."""

    @classmethod
    def of(cls, ground: Heightfield) -> Relief:
        """The relief of a grid."""
        z = ground.elevation
        top = np.maximum(np.maximum(z[:-1, :-1], z[:-1, 1:]), np.maximum(z[1:, :-1], z[1:, 1:]))
        lowest = np.minimum(np.minimum(z[:-1, :-1], z[:-1, 1:]), np.minimum(z[1:, :-1], z[1:, 1:]))
        top = np.where(lowest < -1e8, np.float32(-1e9), top)  # a cell with a hole hides nothing
        tops, levels, begin = [], [], 0
        while True:
            tops.append(top.ravel())
            levels.append((begin, *top.shape))
            begin += top.size
            if max(top.shape) == 1:
                break
            rows, columns = (side + side % 2 for side in top.shape)
            even = np.full((rows, columns), np.float32(-1e9))
            even[: top.shape[0], : top.shape[1]] = top
            top = even.reshape(rows // 2, 2, columns // 2, 2).max(axis=(1, 3))
        return cls(
            ground=ground,
            tops=np.concatenate(tops),
            levels=np.array(levels, np.int64),
        )


def horizon_slopes(reliefs: tuple[Relief, ...], points: Array, azimuth: float) -> Array:
    """Slope of the horizon [m/m] in a direction, over grids of which each lies within the next.

    Args:
        reliefs: The grids, the finest first.
        points: East, north, height above the centre's plane [m], shape [points, 3].
        azimuth: Clockwise from north [rad].
    """
    towards = np.array([np.sin(azimuth), np.cos(azimuth)])
    best, begin = np.full(len(points), LOWEST), np.zeros(len(points))
    for relief in reliefs:
        ground = relief.ground
        over_chunks(
            _sweep, len(points), points, towards, ground.elevation, relief.tops, relief.levels,
            np.array(ground.origin), ground.spacing, begin, best,
        )  # fmt: skip
        begin = _leaves(ground, points, towards)
    return best


def _leaves(ground: Heightfield, points: Array, towards: Array) -> Array:
    """How far rays go until they leave a grid [m]."""
    west, south, east, north = ground.bounds
    ways = []
    for axis, (low, high) in enumerate(((west, east), (south, north))):
        if abs(towards[axis]) > 1e-12:
            edge = high if towards[axis] > 0.0 else low
            ways.append((edge - points[:, axis]) / towards[axis])
    return np.asarray(np.maximum(np.minimum.reduce(ways), 0.0))


@inner
def _way_out(start, step, cells):  # type: ignore[no-untyped-def]
    """Length of a ray until it leaves a grid along one axis; 0 for one that starts outside."""
    if step > 1e-12:
        return (cells - start) / step
    if step < -1e-12:
        return -start / step
    return 1e18 if 0.0 <= start <= cells else 0.0


@kernel
def _sweep(begin, end, points, towards, z, tops, levels, corner, spacing, starts, best):  # type: ignore[no-untyped-def]
    rows, columns = z.shape[0] - 1, z.shape[1] - 1
    dx, dy = towards[0], towards[1]
    for n in range(begin, end):
        x0, y0 = (points[n, 0] - corner[0]) / spacing, (points[n, 1] - corner[1]) / spacing
        height, slope = points[n, 2], best[n] * spacing
        t, level = starts[n] / spacing, 0
        out = min(_way_out(x0, dx, columns), _way_out(y0, dy, rows)) - _NUDGE
        before_i, before_j = -1, -1
        while t < out:
            i = min(max(int(x0 + (t + _NUDGE) * dx), 0), columns - 1)
            j = min(max(int(y0 + (t + _NUDGE) * dy), 0), rows - 1)
            if before_i >= 0:  # up to a larger square only where one begins
                while level + 1 < len(levels) and (
                    i >> (level + 1) != before_i >> (level + 1)
                    or j >> (level + 1) != before_j >> (level + 1)
                ):
                    level += 1
            before_i, before_j = i, j
            side = 1 << level
            i, j = i >> level, j >> level
            across, along = 1e18, 1e18
            if dx > 1e-12:
                across = ((i + 1) * side - x0) / dx
            elif dx < -1e-12:
                across = (i * side - x0) / dx
            if dy > 1e-12:
                along = ((j + 1) * side - y0) / dy
            elif dy < -1e-12:
                along = (j * side - y0) / dy
            leave = max(min(across, along), t + _NUDGE)
            rise = tops[levels[level, 0] + j * levels[level, 2] + i] - height
            if rise <= slope * (t if rise > 0.0 else leave):
                t = leave
                continue
            if level > 0:
                level -= 1
                continue
            a, b = z[j, i], z[j, i + 1]
            c, d = z[j + 1, i], z[j + 1, i + 1]
            # Where the ray comes in, where it goes out, and where it crosses the cell's diagonal.
            for k in range(3):
                s = t if k == 0 else leave
                if k == 2:
                    if abs(dx - dy) < 1e-12:
                        continue
                    s = ((y0 - j) - (x0 - i)) / (dx - dy)
                    if not t < s < leave:
                        continue
                if s < _BESIDE:
                    continue
                u = min(max(x0 + s * dx - i, 0.0), 1.0)
                v = min(max(y0 + s * dy - j, 0.0), 1.0)
                if u >= v:
                    over = a + u * (b - a) + v * (d - b)
                else:
                    over = a + v * (c - a) + u * (d - c)
                slope = max(slope, (over - height) / s)
            t = leave
        best[n] = slope / spacing
