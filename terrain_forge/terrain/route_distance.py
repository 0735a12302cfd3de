"""How far the nodes of a grid are from routes."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, inner, kernel, over_chunks, segment_square_distance

_BLOCK, _TILE = 128, 16
"""Nodes of a block and of a tile of it each way, among which far segments are sorted out."""


def route_distance(lines: list[Array], *, east: Array, north: Array, farthest: float) -> Array:
    """Distance [m] of a grid's nodes to the nearest of some polylines, shape [north, east].

    Lines are points, east and north [m], shape [points, 2]. Exact up to `farthest` [m]; what is
    farther may be told as infinite.
    """
    segments = np.concatenate([np.hstack([line[:-1], line[1:]]) for line in lines])
    distance = np.full((len(north), len(east)), np.inf)
    blocks = -(-len(north) // _BLOCK)
    over_chunks(_measure, blocks, segments, east, north, farthest, distance)
    return distance


@inner
def _keep_near(segments, some, count, corners, farthest, kept, away):  # type: ignore[no-untyped-def]
    """Keep those of some segments that can be nearest to a point of a rectangle; their number.

    A point's nearest segment is no farther from the rectangle's middle than the middle's own
    nearest one by the rectangle's diagonal.
    """
    west, south, east, north = corners
    wide, high = east - west, north - south
    diagonal = np.sqrt(wide * wide + high * high) * (1.0 + 1e-9) + 1e-9
    nearest = np.inf
    for n in range(count):
        square = segment_square_distance(
            segments[some[n]], 0.5 * (west + east), 0.5 * (south + north)
        )
        away[n] = np.sqrt(square)
        nearest = min(nearest, away[n])
    found = 0
    if nearest <= farthest + diagonal:
        for n in range(count):
            if away[n] <= nearest + diagonal:
                kept[found] = some[n]
                found += 1
    return found


@inner
def _measure_tile(segments, near, count, east, north, distance):  # type: ignore[no-untyped-def]
    """Distances of a tile's nodes to the nearest of some segments."""
    for j in range(len(north)):
        for i in range(len(east)):
            square = np.inf
            for n in range(count):
                square = min(square, segment_square_distance(segments[near[n]], east[i], north[j]))
            distance[j, i] = np.sqrt(square)


@kernel
def _measure(first, last, segments, east, north, farthest, distance):  # type: ignore[no-untyped-def]
    """Distances of rows of square blocks of nodes; blocks and tiles sort out what is far."""
    every = np.arange(len(segments))
    around, near = np.empty_like(every), np.empty_like(every)
    away = np.empty(len(segments))
    for block in range(first * _BLOCK, last * _BLOCK, _BLOCK):
        end = min(block + _BLOCK, len(north))
        for west in range(0, len(east), _BLOCK):
            right = min(west + _BLOCK, len(east))
            corners = east[west], north[block], east[right - 1], north[end - 1]
            some = _keep_near(segments, every, len(every), corners, farthest, around, away)
            for j in range(block, end if some else block, _TILE):
                for i in range(west, right, _TILE):
                    x, y = east[i : min(i + _TILE, right)], north[j : min(j + _TILE, end)]
                    corners = x[0], y[0], x[-1], y[-1]
                    count = _keep_near(segments, around, some, corners, farthest, near, away)
                    part = distance[j : j + len(y), i : i + len(x)]
                    _measure_tile(segments, near, count, x, y, part)
