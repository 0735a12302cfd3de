"""The kernels of scattering: drawing rocks by address and moving them until none overlaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.kernels import inlined, inner, kernel, over_chunks
from terrain_forge.rocks.corridor import Corridors, distances
from terrain_forge.rocks.outline import FOOTPRINT_DIRECTIONS
from terrain_forge.seeds import mix, poisson, uniform

Array = NDArray[np.float64]

PENDING, PLACED, UNPLACED, LEFT_OUT = range(4)
"""States of a rock: not yet treated, in its place, without a free place, in a corridor."""

SIZE, EAST, NORTH, PROTOTYPE, YAW, BURIED, RETRY = range(7)
"""What is drawn for a rock: the last word of the address."""

_RETRIES = 256


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


class Rocks(NamedTuple):
    """Rocks that are being placed, ordered by class, cell and number."""

    circle: Array
    """East, north (first choice, then final) and radius [m], shape [rocks, 3]."""
    prototype: NDArray[np.int64]
    """Whose footprint the rock has, shape [rocks]."""
    diameter: Array
    """Exposed diameter, which scales the footprint [m], shape [rocks]."""
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


@kernel
def cell_counts(key, columns, rows, mean):  # type: ignore[no-untyped-def]
    """Poisson number of rocks in each cell of a class, shape [rows, columns]."""
    counts = np.empty((rows, columns), dtype=np.int64)
    for j in range(rows):
        for i in range(columns):
            counts[j, i] = poisson(mix(mix(mix(key, i), j), 0), mean)
    return counts


@kernel
def addresses(key, column, row, counts):  # type: ignore[no-untyped-def]
    """Hashed addresses of the rocks of a region of cells that begins at (column, row)."""
    count = 0
    for j in range(counts.shape[0]):
        for i in range(counts.shape[1]):
            count += counts[j, i]
    found = np.empty(count, dtype=np.uint64)
    n = 0
    for j in range(counts.shape[0]):
        for i in range(counts.shape[1]):
            cell = mix(mix(key, column + i), row + j)
            for k in range(counts[j, i]):
                found[n] = mix(cell, k + 1)
                n += 1
    return found


@kernel
def words(address, what):  # type: ignore[no-untyped-def]
    """Extend each address by what is drawn there."""
    found = np.empty(len(address), dtype=np.uint64)
    for n in range(len(address)):
        found[n] = mix(address[n], what)
    return found


@kernel
def draw(address, what):  # type: ignore[no-untyped-def]
    """A uniform number in (0, 1) for each address."""
    drawn = np.empty(len(address))
    for n in range(len(address)):
        drawn[n] = uniform(mix(address[n], what))
    return drawn


def place(layout: Layout, rocks: Rocks, footprints: Array, strips: Corridors) -> None:
    """Find a place for every rock, in the order of the classes; changes `rocks`.

    `footprints` are the prototypes' support functions, shape [prototypes, directions].
    """
    for c, (column, row, columns, rows) in enumerate(layout.region.tolist()):
        for colour in range(4):
            # Cells of one colour are every other one each way, counted on the whole site: their
            # rocks cannot meet, so that it does not matter in which order they are placed.
            i0, j0 = (column + colour) & 1, (row + (colour >> 1)) & 1
            across, along = (columns - i0 + 1) // 2, (rows - j0 + 1) // 2
            over_chunks(
                _place_cells, across * along, layout, rocks, footprints, strips, c, i0, j0, across
            )


@kernel
def _place_cells(  # type: ignore[no-untyped-def]
    first, last, layout, rocks, footprints, strips, c, i0, j0, across
):
    """Place the rocks of some cells of one colour, which are numbered row by row."""
    column, row, columns = layout.region[c, 0], layout.region[c, 1], layout.region[c, 2]
    for n in range(first, last):
        i, j = i0 + 2 * (n % across), j0 + 2 * (n // across)
        cell = layout.first_cell[c] + j * columns + i
        for rock in range(layout.first_rock[cell], layout.first_rock[cell + 1]):
            _place_one(layout, rocks, footprints, strips, c, column + i, row + j, rock)


@inlined
def _place_one(layout, rocks, footprints, strips, c, column, row, rock):  # type: ignore[no-untyped-def]
    """Put a rock of class `c` at its first choice or, failing that, elsewhere in its cell."""
    first_x, first_y, radius = rocks.circle[rock]
    width, depth = layout.side[c, 0], layout.side[c, 1]
    limit = radius
    for s in range(len(strips.half_width)):
        limit = max(limit, strips.half_width[s] + radius)
    home = distances(strips, first_x, first_y, limit)
    for s in range(len(home)):
        if home[s] < strips.half_width[s] and rocks.height[rock] > strips.clearance[s]:
            rocks.state[rock] = LEFT_OUT
            return
    retry = mix(rocks.address[rock], RETRY)
    x, y = first_x, first_y
    for trial in range(1 + _RETRIES):
        if trial > 0:
            x = layout.bounds[0] + (column + uniform(mix(retry, 2 * trial))) * width
            y = layout.bounds[1] + (row + uniform(mix(retry, 2 * trial + 1))) * depth
        if (
            _on_site(layout.bounds, x, y, radius)
            and _is_free(layout, rocks, footprints, c, x, y, rock)
            and _keeps_off(strips, home, x, y, radius, limit, rocks.height[rock])
        ):
            _settle(layout, rocks, c, column, row, rock, x, y)
            return
    rocks.state[rock] = UNPLACED


@inlined
def _on_site(bounds, x, y, radius):  # type: ignore[no-untyped-def]
    return (
        x - radius >= bounds[0]
        and y - radius >= bounds[1]
        and x + radius <= bounds[2]
        and y + radius <= bounds[3]
    )


@inlined
def _settle(layout, rocks, c, column, row, rock, x, y):  # type: ignore[no-untyped-def]
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
                    if _overlap(rocks, footprints, rock, near, x, y):
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


@inlined
def _overlap(rocks, footprints, rock, near, x, y):  # type: ignore[no-untyped-def]
    dx, dy = rocks.circle[near, 0] - x, rocks.circle[near, 1] - y
    apart = rocks.circle[near, 2] + rocks.circle[rock, 2]
    if dx * dx + dy * dy >= apart * apart:
        return False
    return not _separate(rocks, footprints, rock, near, dx, dy)


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
    return rocks.diameter[rock] * along / np.cos(0.5 * step)


@inlined
def _keeps_off(strips, home, x, y, radius, limit, height):  # type: ignore[no-untyped-def]
    """Whether a place is on the same side of every corridor's border as the first choice was.

    A rock above the corridor's clearance must keep off with all of its circle.
    """
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
