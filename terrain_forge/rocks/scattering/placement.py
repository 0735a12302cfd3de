"""Placing rocks: each at its first place or, where that is taken, at another one near by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inlined, inner, kernel, mix, over_chunks, uniform
from terrain_forge.rocks.embedding.footprint import FOOTPRINT_DIRECTIONS
from terrain_forge.rocks.scattering.cells import RETRY
from terrain_forge.rocks.scattering.corridor import Corridors, distances, search_radius
from terrain_forge.rocks.scattering.intensity import Intensity, weight

PENDING, PLACED, UNPLACED, LEFT_OUT = range(4)
"""States of a rock: not yet treated, in its place, without a free place, in a corridor."""

_RETRIES = 4096


class Layout(NamedTuple):
    """The cells of all size classes, in the order in which the classes are placed."""

    bounds: Array
    """West, south, east, north edge of the site [m], shape [4]."""
    region: NDArray[np.int64]
    """First column, first row, columns, rows of each class's cells, shape [classes, 4]."""
    side: Array
    """Size of a class's cells, east and north [m], shape [classes, 2]."""
    radius: Array
    """Largest circle of a class [m], shape [classes]."""
    first_cell: NDArray[np.int64]
    """Where a class's cells begin in `first_rock`, shape [classes]."""
    first_rock: NDArray[np.int64]
    """Where a cell's rocks begin, row by row, class by class, shape [cells + 1]."""
    split: NDArray[np.int64]
    """Bins that a class's cells are cut into each way, to find near rocks, shape [classes]."""
    first_bin: NDArray[np.int64]
    """Where a class's bins begin, row by row, shape [classes + 1]."""
    population: NDArray[np.int64]
    """Index of a class's population; -1 for the user's own rocks, which stay where they are, shape
    [classes]."""
    local: NDArray[np.bool_]
    """Whether a class's rocks look for a place around their first place, shape [classes]."""


class Rocks(NamedTuple):
    """Rocks that are being placed, ordered by class, cell and number."""

    circle: Array
    """East, north (first choice, then final) and radius [m], shape [rocks, 3]."""
    prototype: NDArray[np.int64]
    """Whose footprint the rock has, shape [rocks]."""
    diameter: Array
    """Exposed diameter [m], shape [rocks]."""
    space: Array
    """Diameter that scales the footprint [m]: the exposed one or more, shape [rocks]."""
    yaw: Array
    """Turn of the footprint [rad], shape [rocks]."""
    height: Array
    """Largest height above the ground, however the rock rests [m], shape [rocks]."""
    address: NDArray[np.uint64]
    """Hashed address, shape [rocks]."""
    state: NDArray[np.int8]
    """One of the states above, shape [rocks]."""
    first_in_bin: NDArray[np.int64]
    """A placed rock of each bin, or -1, shape [bins]."""
    next_in_bin: NDArray[np.int64]
    """The next placed rock of the same bin, or -1, shape [rocks]."""


def place(
    layout: Layout, rocks: Rocks, *, footprints: Array, strips: Corridors, intensity: Intensity
) -> None:
    """Find a place for every rock, in the order of the classes; changes `rocks`.

    `footprints` are the prototypes' support functions, shape [prototypes, directions].
    """
    # In each cell those that need the most space come first: later they would find it least easily.
    cell = np.repeat(np.arange(len(layout.first_rock) - 1), np.diff(layout.first_rock))
    order = np.lexsort((-rocks.circle[:, 2], cell))
    for c, (column, row, columns, rows) in enumerate(layout.region.tolist()):
        if layout.population[c] < 0:
            _place_listed(layout, rocks, c)
            continue
        for colour in range(4):
            # Cells of one colour are every other one each way, counted on the whole site: their
            # rocks cannot meet, so that it does not matter in which order they are placed.
            i0, j0 = (column + colour) & 1, (row + (colour >> 1)) & 1
            across, along = (columns - i0 + 1) // 2, (rows - j0 + 1) // 2
            there = layout, rocks, order, footprints, strips, intensity
            over_chunks(_place_cells, across * along, *there, c, i0, j0, across)


@kernel
def _place_listed(layout, rocks, c):  # type: ignore[no-untyped-def]
    """Leave the rocks of a class of one cell where they are."""
    cell = layout.first_cell[c]
    for rock in range(layout.first_rock[cell], layout.first_rock[cell + 1]):
        _put(layout, rocks, c, 0, 0, rock, rocks.circle[rock, 0], rocks.circle[rock, 1])


@kernel
def _place_cells(  # type: ignore[no-untyped-def]
    first, last, layout, rocks, order, footprints, strips, intensity, c, i0, j0, across
):
    """Place the rocks of some cells of one colour, which are numbered row by row."""
    column, row, columns = layout.region[c, 0], layout.region[c, 1], layout.region[c, 2]
    for n in range(first, last):
        i, j = i0 + 2 * (n % across), j0 + 2 * (n // across)
        cell = layout.first_cell[c] + j * columns + i
        for turn in range(layout.first_rock[cell], layout.first_rock[cell + 1]):
            rock = order[turn]
            _place_one(layout, rocks, footprints, strips, intensity, c, column + i, row + j, rock)


@inlined
def _place_one(  # type: ignore[no-untyped-def]
    layout, rocks, footprints, strips, intensity, c, column, row, rock
):
    """Put a rock of class `c` at its first choice or, failing that, elsewhere in its cell."""
    first_x, first_y, radius = rocks.circle[rock]
    limit = search_radius(strips, radius)
    home = distances(strips, first_x, first_y, limit)
    for s in range(len(home)):
        if home[s] < strips.half_width[s] and rocks.height[rock] > strips.clearance[s]:
            rocks.state[rock] = LEFT_OUT
            return
    retry = mix(rocks.address[rock], RETRY)
    x, y = first_x, first_y
    for trial in range(1 + _RETRIES):
        if trial > 0:
            x, y = _elsewhere(layout, c, column, row, rocks.circle[rock], retry, trial)
            if layout.local[c] and not _is_home(layout, c, column, row, x, y):
                continue
        if (
            _on_site(layout.bounds, x, y, radius)
            and _is_free(layout, rocks, footprints, c, x, y, rock)
            and _keeps_off(strips, home, x, y, radius, limit, rocks.height[rock])
        ):
            if layout.local[c]:
                drawn = uniform(mix(retry, 2 * _RETRIES + 2 + trial))
                population = layout.population[c]
                if trial > 0 and not _is_likely(intensity, population, rocks, rock, x, y, drawn):
                    continue
            _put(layout, rocks, c, column, row, rock, x, y)
            return
    rocks.state[rock] = UNPLACED


@inner
def _elsewhere(layout, c, column, row, circle, retry, trial):  # type: ignore[no-untyped-def]
    """Another place for a rock: anywhere in its cell, or within a range that grows by trials."""
    u, v = uniform(mix(retry, 2 * trial)), uniform(mix(retry, 2 * trial + 1))
    width, depth = layout.side[c, 0], layout.side[c, 1]
    if not layout.local[c]:
        return layout.bounds[0] + (column + u) * width, layout.bounds[1] + (row + v) * depth
    nearest, widest = 2.0 * circle[2], np.sqrt(width * width + depth * depth)
    away = nearest * (widest / nearest) ** (trial / _RETRIES) * np.sqrt(u)
    angle = 2.0 * np.pi * v
    return circle[0] + away * np.cos(angle), circle[1] + away * np.sin(angle)


@inner
def _is_home(layout, c, column, row, x, y):  # type: ignore[no-untyped-def]
    """Whether a place lies in a cell."""
    i = np.floor((x - layout.bounds[0]) / layout.side[c, 0])
    j = np.floor((y - layout.bounds[1]) / layout.side[c, 1])
    return i == column and j == row


@inner
def _is_likely(intensity, population, rocks, rock, x, y, drawn):  # type: ignore[no-untyped-def]
    """Whether a rock may move to a place: by chance if rocks are less likely there.

    The chance is the ratio of the weights (Metropolis et al. 1953, doi:10.1063/1.1699114), so that
    moves leave the density as it is; `drawn` is uniform.
    """
    first_x, first_y, _ = rocks.circle[rock]
    before = weight(intensity, population, first_x, first_y, rocks.diameter[rock])
    return drawn * before < weight(intensity, population, x, y, rocks.diameter[rock])


@inlined
def _on_site(bounds, x, y, radius):  # type: ignore[no-untyped-def]
    return (
        x - radius >= bounds[0]
        and y - radius >= bounds[1]
        and x + radius <= bounds[2]
        and y + radius <= bounds[3]
    )


@inlined
def _put(layout, rocks, c, column, row, rock, x, y):  # type: ignore[no-untyped-def]
    """Place a rock, and enter it into its bin, which is one of its own cell's."""
    rocks.circle[rock, 0], rocks.circle[rock, 1] = x, y
    rocks.state[rock] = PLACED
    split = layout.split[c]
    i = int((x - layout.bounds[0]) / layout.side[c, 0] * split) - column * split
    j = int((y - layout.bounds[1]) / layout.side[c, 1] * split) - row * split
    i = (column - layout.region[c, 0]) * split + min(max(i, 0), split - 1)
    j = (row - layout.region[c, 1]) * split + min(max(j, 0), split - 1)
    n = layout.first_bin[c] + j * layout.region[c, 2] * split + i
    rocks.next_in_bin[rock] = rocks.first_in_bin[n]
    rocks.first_in_bin[n] = rock


@inlined
def _is_free(layout, rocks, footprints, c, x, y, rock):  # type: ignore[no-untyped-def]
    """Whether a rock at a place overlaps none that lies already, of class `c` or an earlier one."""
    for other in range(c + 1):
        i0, i1 = _bins(layout, rocks, other, 0, x, rock)
        j0, j1 = _bins(layout, rocks, other, 1, y, rock)
        columns = layout.region[other, 2] * layout.split[other]
        for j in range(j0, j1):
            for n in range(j * columns + i0, j * columns + i1):
                near = rocks.first_in_bin[layout.first_bin[other] + n]
                while near >= 0:
                    dx, dy = rocks.circle[near, 0] - x, rocks.circle[near, 1] - y
                    apart = rocks.circle[near, 2] + rocks.circle[rock, 2]
                    if dx * dx + dy * dy < apart * apart:
                        if not _separate(rocks, footprints, rock, near, dx, dy):
                            return False
                    near = rocks.next_in_bin[near]
    return True


@inlined
def _bins(layout, rocks, c, axis, place, rock):  # type: ignore[no-untyped-def]
    """First bin of class `c`, and one past the last, whose rocks could reach a rock at a place."""
    reach = rocks.circle[rock, 2] + layout.radius[c]
    split = layout.split[c]
    per_metre = split / layout.side[c, axis]
    skipped = layout.region[c, axis] * split
    first = int(np.floor((place - reach - layout.bounds[axis]) * per_metre)) - skipped
    last = int(np.floor((place + reach - layout.bounds[axis]) * per_metre)) - skipped
    return max(first, 0), min(last + 1, layout.region[c, axis + 2] * split)


@inner
def _separate(rocks, footprints, one, other, dx, dy):  # type: ignore[no-untyped-def]
    """Whether a line parts the footprints of two rocks, the other one being (dx, dy) [m] away.

    Tries lines across directions up to 45° off that of the centres: never true for an overlap.
    """
    distance = np.hypot(dx, dy)
    direction = np.arctan2(dy, dx)
    for n in range(9):
        turn = ((n + 1) // 2) * (1 - 2 * (n & 1)) * (2.0 * np.pi / FOOTPRINT_DIRECTIONS)
        towards = direction + turn
        reached = _support(footprints, rocks, one, towards)
        reached += _support(footprints, rocks, other, towards + np.pi)
        if reached < distance * np.cos(turn):
            return True
    return False


@inner
def _support(footprints, rocks, rock, direction):  # type: ignore[no-untyped-def]
    """How far a rock's footprint reaches along a direction [rad] at most [m]."""
    step = 2.0 * np.pi / FOOTPRINT_DIRECTIONS
    place = (direction - rocks.yaw[rock]) / step
    before = np.floor(place)
    part = place - before
    n = int(before) % FOOTPRINT_DIRECTIONS
    table = footprints[rocks.prototype[rock]]
    along = (1.0 - part) * table[n] + part * table[(n + 1) % FOOTPRINT_DIRECTIONS]
    # The corner where two neighbouring half planes meet lies this much beyond the chord.
    return rocks.space[rock] * along / np.cos(0.5 * step)


@inlined
def _keeps_off(strips, home, x, y, radius, limit, height):  # type: ignore[no-untyped-def]
    """Whether a place is on its side of every corridor, with all of its circle if it is high."""
    if len(home) == 0:
        return True
    away = distances(strips, x, y, limit)
    for s in range(len(home)):
        half_width = strips.half_width[s]
        if (away[s] < half_width) != (home[s] < half_width):
            return False
        if height > strips.clearance[s] and away[s] < half_width + radius:
            return False
    return True
