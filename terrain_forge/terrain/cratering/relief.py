"""Relief of many craters: their profiles added up, the younger erasing what they fall upon.

A crater lies on the ground as it was: its profile is added to the heights around. What was smaller
than itself within its rim it destroys. At each node the relief is

    z = Σᵢ zᵢ · Πⱼ (1 - m(xⱼ) g(Dᵢ / Dⱼ)),   j: all that are younger than i,

where m is 1 within the rim of j and falls to 0 at 1.4 radii, and g is 1 for craters up to half as
large as j, 0 from twice as large on and even between, by the logarithm. So a young crater in an old
large one lies on its floor, a small one under a young large one is gone, and each node depends on
the craters that reach it alone. Howard 2007 (Geomorphology 91, 332) does the same with
heights, by a mean level under each crater, which a window cannot know.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, inner, kernel, over_chunks, portable
from terrain_forge.terrain.cratering.craters import Craters, table_place
from terrain_forge.terrain.cratering.degradation import STEP, worn_shapes

ERASED = (0.9, 1.4)
"""Distances [radii] up to which a crater erases all, and beyond which nothing."""
_COLUMNS = 1.0 / STEP
_TILE = 16
"""Nodes of a tile each way; craters are looked up by tile."""


def crater_relief(craters: Craters, *, east: Array, north: Array) -> Array:
    """Relief [m] of craters, the youngest first, at evenly spaced nodes, shape [north, east]."""
    relief = np.zeros((len(north), len(east)))
    reach = craters.reach
    seen = reach > 0.0
    craters, reach = craters.select(seen), reach[seen]
    if len(craters) == 0:
        return relief
    row, share = table_place(craters.wear)
    first, members = _members(craters.xy, reach, east, north)
    over_chunks(
        _add_craters,
        -(-len(north) // _TILE),
        (first, members),
        (craters.xy, 0.5 * craters.diameter, portable.log2(craters.diameter), reach * reach),
        (
            row,
            np.hstack([craters.weights * (1.0 - share[:, None]), craters.weights * share[:, None]]),
        ),
        worn_shapes()[0],
        east,
        north,
        relief,
    )
    return relief


@kernel
def _members(xy, reach, east, north):  # type: ignore[no-untyped-def]
    """Craters of each tile in their order: where its list begins, and the lists."""
    columns, rows = -(-len(east) // _TILE), -(-len(north) // _TILE)
    first = np.zeros(columns * rows + 1, dtype=np.int64)
    for fill in range(2):
        if fill == 0:
            members = np.empty(0, dtype=np.int32)
        else:
            for t in range(columns * rows):
                first[t + 1] += first[t]
            members = np.empty(first[-1], dtype=np.int32)
            filled = first[:-1].copy()
        for n in range(len(reach)):
            i0, i1 = _tiles(xy[n, 0] - reach[n], xy[n, 0] + reach[n], east, columns)
            j0, j1 = _tiles(xy[n, 1] - reach[n], xy[n, 1] + reach[n], north, rows)
            for j in range(j0, j1):
                for i in range(i0, i1):
                    dx = _outside(xy[n, 0], east, i)
                    dy = _outside(xy[n, 1], north, j)
                    if dx * dx + dy * dy <= reach[n] * reach[n]:
                        tile = j * columns + i
                        if fill == 0:
                            first[tile + 1] += 1
                        else:
                            members[filled[tile]] = n
                            filled[tile] += 1
    return first, members


@inner
def _tiles(low, high, axis, count):  # type: ignore[no-untyped-def]
    """First tile and the one after the last that an interval touches along an axis."""
    step = _TILE * (axis[1] - axis[0])
    first = int(max(np.floor((low - axis[0]) / step), 0.0))
    last = int(min(np.floor((high - axis[0]) / step) + 1.0, float(count)))
    return first, last


@inner
def _outside(place, axis, tile):  # type: ignore[no-untyped-def]
    """Distance of a place from a tile along an axis."""
    low = axis[tile * _TILE]
    high = axis[min(tile * _TILE + _TILE, len(axis)) - 1]
    return max(max(low - place, place - high), 0.0)


@kernel
def _add_craters(  # type: ignore[no-untyped-def]
    first_row, last_row, lists, places, worn, table, east, north, relief
):
    """Relief of some rows of tiles."""
    first, members = lists
    xy, radius, size, reach = places
    columns = -(-len(east) // _TILE)
    for j in range(first_row, last_row):
        for i in range(columns):
            begin, end = first[j * columns + i], first[j * columns + i + 1]
            if begin == end:
                continue
            share_left = np.empty(end - begin)
            size_left = np.empty(end - begin)
            for y in range(j * _TILE, min((j + 1) * _TILE, len(north))):
                for x in range(i * _TILE, min((i + 1) * _TILE, len(east))):
                    height, erasers = 0.0, 0
                    for m in range(begin, end):
                        n = members[m]
                        dx, dy = east[x] - xy[n, 0], north[y] - xy[n, 1]
                        square = dx * dx + dy * dy
                        if square >= reach[n]:
                            continue
                        away = np.sqrt(square) / radius[n]
                        own = _height(table, worn, n, away)
                        for e in range(erasers):  # by how many octaves it is the larger one
                            larger = size[n] - size_left[e]
                            own *= 1.0 - share_left[e] * min(max(0.5 - 0.5 * larger, 0.0), 1.0)
                        height += own
                        erased = _within(away)
                        if erased > 0.0:
                            share_left[erasers], size_left[erasers] = erased, size[n]
                            erasers += 1
                    relief[y, x] = height


@inner
def _height(table, worn, n, away):  # type: ignore[no-untyped-def]
    """Height of a crater's own profile at a distance in radii."""
    row, weights = worn
    place = away * _COLUMNS
    x = int(place)
    u, r = place - x, row[n]
    here = there = 0.0
    for s in range(3):
        here += weights[n, s] * table[r, x, s] + weights[n, s + 3] * table[r + 1, x, s]
        there += weights[n, s] * table[r, x + 1, s] + weights[n, s + 3] * table[r + 1, x + 1, s]
    return here + u * (there - here)


@inner
def _within(away):  # type: ignore[no-untyped-def]
    """Part of what lies there that a crater erases."""
    start, end = ERASED
    share = min(max((end - away) / (end - start), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)
