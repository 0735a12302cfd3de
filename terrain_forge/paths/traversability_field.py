"""What ground and rocks mean to a rover: slope, steps, cost, and the distance to obstacles.

The quantities are those of GESTALT (Goldberg, Maimone & Matthies 2002,
doi:10.1109/AERO.2002.1035370): the slope and the residual of the plane under the rover's footprint,
and steps that a wheel meets. Kernels fill rows by sums over each node's own surroundings in a fixed
order, so that threads change no result and a window has the whole's bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Record, checked, inner, kernel, over_chunks
from terrain_forge.model import Heightfield, RockField, RockLibrary, Rover
from terrain_forge.paths.obstacles import (
    UNITS,
    Obstacles,
    find_obstacles,
    half_diagonal,
    highest_step,
)

Grid = NDArray[np.float32]

UNKNOWN = -1.0
"""Value of nodes so near to the border that the rover's footprint or a wheel's reach leaves it."""
IMPASSABLE = 1.0
"""Cost of nodes on which the rover's centre cannot be."""
ROUGHNESS_PER_STEP = 0.25
"""Roughness of full cost, over the highest step; roughness alone never makes a node impassable."""
Sides = tuple[bool, bool, bool, bool]


@dataclass(frozen=True, kw_only=True, eq=False)
class Traversability(Record):
    """Rasters over the nodes of a ground, for one rover; rows run north."""

    origin: tuple[float, float]
    """East and north coordinate of node [0, 0] [m]."""
    spacing: float
    """Distance of neighbouring nodes [m]."""
    slope: Grid
    """Slope of the least-squares plane under the footprint [rad], shape [rows, columns]; `UNKNOWN`
    at the border, as in step and cost."""
    step: Grid
    """Step of ground and rocks [m], shape [rows, columns]."""
    clearance: Grid
    """Distance to the nearest rock or step that the rover does not go over [m], negative within a
    rock, at most twice what it needs to turn on the spot, shape [rows, columns]."""
    cost: Grid
    """0 for smooth level ground to `IMPASSABLE`, shape [rows, columns]."""
    obstacles: Obstacles
    """Rocks that the rover does not go over."""
    highest_step: float
    """Height of steps and rocks that it still goes over [m]."""
    half_width: float
    """Half of the rover's width [m]: the clearance that its centre needs."""
    steepest: float
    """Slope that it may still be driven on [rad]."""

    def __post_init__(self) -> None:
        self.freeze("slope", np.float32, ("rows", "columns"))
        for name in ("step", "clearance", "cost"):
            self.freeze(name, np.float32, self.slope.shape)

    def node(self, point: tuple[float, float]) -> tuple[int, int]:
        """Row and column of the node nearest to a point [m]; may lie outside."""
        column = round((point[0] - self.origin[0]) / self.spacing)
        return round((point[1] - self.origin[1]) / self.spacing), column


@checked
def traversability(
    *,
    ground: Heightfield,
    rocks: RockField,
    library: RockLibrary,
    rover: Rover,
    cut_sides: Sides = (False, False, False, False),
) -> Traversability:
    """Rate each node of the ground for a rover.

    Args:
        ground: The bare ground.
        rocks: All rocks that reach into it.
        library: Their shapes.
        rover: Who drives; it needs wheels.
        cut_sides: Whether the world goes on beyond the ground in the west, south, east and north.
            What stands there is not known, so the cost is unknown where it could matter.
    """
    spacing, limit = ground.spacing, highest_step(rover)
    far, reaches = 2.0 * half_diagonal(rover), _reaches(rover, spacing)
    slope, roughness, step = (np.full(ground.shape, UNKNOWN, np.float32) for _ in range(3))
    args = ground.elevation, spacing, reaches, slope, roughness, step
    over_chunks(_measure_ground, len(slope), *args)
    obstacles = find_obstacles(rocks, library, rover)
    clearance = _clearance(ground, step, obstacles, limit, far)
    solid = rocks.select(rocks.collides)
    radii = 0.5 * solid.diameter / spacing + 0.5
    _stamp_heights(step, _columns_and_rows(solid.position, ground), radii, solid.height)
    widest, border = known_within(rover, spacing), border_width(rover, spacing)
    margins = tuple(widest if cut else border for cut in cut_sides)
    return Traversability(
        origin=ground.origin,
        spacing=spacing,
        slope=slope,
        step=step,
        clearance=clearance,
        cost=_cost((slope, roughness, step, clearance), rover, spacing, margins),
        obstacles=obstacles,
        highest_step=limit,
        half_width=0.5 * rover.width,
        steepest=rover.tilt_limit,
    )


def _reaches(rover: Rover, spacing: float) -> tuple[int, int, int]:
    """Half the footprint, a wheel's reach, and the border where nothing is known [cells]."""
    footprint, lag = max(round(0.5 * rover.length / spacing), 1), wheel_reach(rover, spacing)
    return footprint, lag, max(footprint, 2 * lag, math.ceil(half_diagonal(rover) / spacing))


def border_width(rover: Rover, spacing: float) -> int:
    """How far from the edge of the world the cost is unknown [cells]."""
    return _reaches(rover, spacing)[-1]


def known_within(rover: Rover, spacing: float) -> int:
    """How far from a side beyond which the world goes on the cost is known [cells]."""
    return border_width(rover, spacing) + math.ceil(2.0 * half_diagonal(rover) / spacing)


def wheel_reach(rover: Rover, spacing: float) -> int:
    """Radius of the largest wheel in cells of a grid, rounded up."""
    largest = max(wheel.radius for wheel in rover.wheels)
    return max(math.ceil(largest / spacing - 1e-9), 1)


def _clearance(
    ground: Heightfield, step: Grid, obstacles: Obstacles, limit: float, farthest: float
) -> Grid:
    from scipy.ndimage import distance_transform_edt

    clearance, spacing = np.full(ground.shape, farthest, np.float32), ground.spacing
    if bool(np.any(step > limit)):
        np.minimum(clearance, distance_transform_edt(step <= limit) * spacing, out=clearance)
    centre, support = _columns_and_rows(obstacles.centre, ground), obstacles.support / spacing
    _stamp_obstacles(clearance, centre, support, UNITS, farthest / spacing, spacing)
    return clearance


def _cost(
    measures: tuple[Grid, Grid, Grid, Grid], rover: Rover, spacing: float, margins: tuple[int, ...]
) -> Grid:
    """Cost from slope, roughness, step and clearance; unknown within margins of the sides."""
    limit, half_width = highest_step(rover), 0.5 * rover.width
    limits = (rover.tilt_limit, limit, ROUGHNESS_PER_STEP * limit, half_width, half_diagonal(rover))
    reach = half_width / spacing
    spans = np.sqrt(reach**2 - np.arange(math.floor(reach) + 1.0) ** 2).astype(np.int64)
    cost = np.empty(measures[0].shape, np.float32)
    over_chunks(_rate_nodes, len(cost), *measures, limits, spans, margins, cost)
    return cost


def _columns_and_rows(position: NDArray[np.float64], ground: Heightfield) -> NDArray[np.float64]:
    """Places in cells, to 2⁻²⁰: a window, whose origin is another, has the whole's bits."""
    return np.asarray(np.rint((position[:, :2] - ground.origin) / ground.spacing * 2**20) / 2**20)


@kernel
def _measure_ground(first, last, elevation, spacing, cells, slope, roughness, step):  # type: ignore[no-untyped-def]
    """Slope [rad] and RMS residual [m] of the plane under a square, and steps [m].

    `cells`: half the square, a wheel's reach, and the border where nothing is known [cells].
    """
    half, lag, border = cells
    rows, columns = elevation.shape
    low, high = max(first, border), min(last, rows - border)
    if low >= high or columns <= 2 * border:
        return
    total, moment, square = _row_sums(elevation, low - half, high + half, half, border)
    count = (2 * half + 1) ** 2
    spread = count * half * (half + 1) / 3.0
    for j in range(low, high):
        for i in range(border, columns - border):
            mean = east = north = power = 0.0
            for k in range(2 * half + 1):
                row = j - low + k
                mean += total[row, i]
                north += (k - half) * total[row, i]
                east += moment[row, i]
                power += square[row, i]
            rise = np.sqrt(east * east + north * north) / spread
            rest = power - mean * mean / count - rise * rise * spread
            slope[j, i] = np.arctan(rise / spacing)
            roughness[j, i] = np.sqrt(max(rest, 0.0) / count)
            step[j, i] = _step(elevation, j, i, lag)


@inner
def _row_sums(elevation, first, last, half, border):  # type: ignore[no-untyped-def]
    """Over squares' rows: heights, heights times columns from the middle, squares of heights."""
    columns = elevation.shape[1]
    total = np.zeros((last - first, columns))
    moment, square = np.zeros_like(total), np.zeros_like(total)
    for j in range(last - first):
        for i in range(border, columns - border):
            for k in range(-half, half + 1):
                z = np.float64(elevation[first + j, i + k])
                total[j, i] += z
                moment[j, i] += k * z
                square[j, i] += z * z
    return total, moment, square


@inner
def _step(elevation, j, i, lag):  # type: ignore[no-untyped-def]
    """Largest step across a node within a wheel's reach, east-west and north-south [m]."""
    largest = 0.0
    for k in range(lag + 1):
        for along in range(2):
            dj, di = (lag, 0) if along else (0, lag)
            row, column = (j - k, i) if along else (j, i - k)
            before = np.float64(elevation[row - dj, column - di])
            begin = np.float64(elevation[row, column])
            end = np.float64(elevation[row + dj, column + di])
            after = np.float64(elevation[row + 2 * dj, column + 2 * di])
            # What the ground beside rises too is slope and no step.
            jump = end - begin
            largest = max(largest, min(abs(jump - (begin - before)), abs(jump - (after - end))))
    return largest


@kernel
def steps_at(elevation, row, column, lag):  # type: ignore[no-untyped-def]
    """Largest step [m] at any of some nodes, shape [poses, nodes]; none where it is not known."""
    rows, columns = elevation.shape
    largest = np.zeros(len(row))
    for n in range(len(row)):
        for k in range(row.shape[1]):
            j, i = row[n, k], column[n, k]
            if 2 * lag <= min(j, i, rows - 1 - j, columns - 1 - i):
                largest[n] = max(largest[n], _step(elevation, j, i, lag))
    return largest


@kernel
def _stamp_obstacles(clearance, centre, support, units, farthest, spacing):  # type: ignore[no-untyped-def]
    """Lower `clearance` [m] to the distance of rocks' outlines; all lengths else in cells."""
    rows, columns = clearance.shape
    for n in range(len(centre)):
        reach = support[n].max() + farthest
        x, y = centre[n, 0], centre[n, 1]
        for j in range(max(int(np.ceil(y - reach)), 0), min(int(np.floor(y + reach)) + 1, rows)):
            west = max(int(np.ceil(x - reach)), 0)
            for i in range(west, min(int(np.floor(x + reach)) + 1, columns)):
                gap = -np.inf
                for d in range(units.shape[1]):
                    along = (i - x) * units[0, d] + (j - y) * units[1, d]
                    gap = max(gap, along - support[n, d])
                clearance[j, i] = min(clearance[j, i], gap * spacing)


@kernel
def _stamp_heights(step, centre, radius, height):  # type: ignore[no-untyped-def]
    """Raise steps to the heights of the rocks [m] that stand there; centre and radius in cells."""
    rows, columns = step.shape
    for n in range(len(centre)):
        x, y, r = centre[n, 0], centre[n, 1], radius[n]
        for j in range(max(int(np.ceil(y - r)), 0), min(int(np.floor(y + r)) + 1, rows)):
            for i in range(max(int(np.ceil(x - r)), 0), min(int(np.floor(x + r)) + 1, columns)):
                near = (i - x) ** 2 + (j - y) ** 2 <= r * r
                if near and step[j, i] >= 0.0 and height[n] > step[j, i]:
                    step[j, i] = height[n]


@kernel
def _rate_nodes(first, last, slope, roughness, step, clearance, limits, spans, margins, cost):  # type: ignore[no-untyped-def]
    """Cost of nodes: the worst of slope, steps nearby, roughness and nearness of obstacles.

    `limits`: slope [rad], step [m], roughness [m], and clearances [m] below which the rover cannot
    be, and from which on it can turn; `spans`: columns to each side within its half width, for each
    row from the node's own on [cells]; `margins`: unknown cells in the west, south, east and north.
    """
    steepest, highest, roughest, narrow, wide = limits
    west, south, east, north = margins
    rows, columns = cost.shape
    reach = len(spans) - 1
    low, high = max(first - reach, 0), min(last + reach, rows)
    beside = _row_maxima(step, low, high, spans[0], highest)
    for j in range(first, last):
        for i in range(columns):
            outside = i < west or j < south or i >= columns - east or j >= rows - north
            if outside or slope[j, i] < 0.0:
                cost[j, i] = -1.0
                continue
            steep = slope[j, i] / steepest
            if steep > 1.0 or clearance[j, i] < narrow:
                cost[j, i] = 1.0
                continue
            nearby = np.float32(0.0)
            for k in range(max(j - reach, low), min(j + reach + 1, high)):
                nearby = max(nearby, beside[spans[abs(k - j)], k - low, i])
            close = (wide - clearance[j, i]) / (wide - narrow)
            worst = max(max(nearby / highest, roughness[j, i] / roughest), max(steep, close))
            cost[j, i] = min(max(worst, 0.0), 0.99)


@inner
def _row_maxima(step, low, high, widest, highest):  # type: ignore[no-untyped-def]
    """Largest steps that the rover still goes over, within 0 to `widest` columns to both sides.

    What is higher is an obstacle, which counts by its distance.
    """
    columns = step.shape[1]
    maxima = np.zeros((widest + 1, high - low, columns), np.float32)
    for j in range(high - low):
        for i in range(columns):
            maxima[0, j, i] = step[low + j, i] if step[low + j, i] <= highest else 0.0
        for span in range(1, widest + 1):
            for i in range(columns):
                before, after = max(i - span, 0), min(i + span, columns - 1)
                ends = max(maxima[0, j, before], maxima[0, j, after])
                maxima[span, j, i] = max(maxima[span - 1, j, i], ends)
    return maxima
