"""What ground and rocks mean to a rover: slope, steps, cost, and the distance to obstacles.

The quantities are those of GESTALT (Goldberg, Maimone & Matthies 2002,
doi:10.1109/AERO.2002.1035370): the slope and the residual of the plane under the rover's footprint,
and steps that a wheel meets.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Record, over_chunks
from terrain_forge.model import Heightfield, RockField, RockLibrary, Rover
from terrain_forge.paths.obstacles import (
    UNITS,
    Obstacles,
    find_obstacles,
    half_diagonal,
    highest_step,
)
from terrain_forge.paths.traversability_kernels import (
    measure_ground,
    nearest_step,
    rate_nodes,
    stamp_heights,
    stamp_obstacles,
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
    ground_step: Grid
    """Step of the bare ground within a wheel's reach [m], shape [rows, columns]."""
    step: Grid
    """Step of ground and rocks [m], shape [rows, columns]."""
    clearance: Grid
    """Distance to the nearest rock or step that the rover does not go over [m], negative within a
    rock, at most `farthest`, shape [rows, columns]."""
    cost: Grid
    """0 for smooth level ground to `IMPASSABLE`, shape [rows, columns]."""
    obstacles: Obstacles
    """Rocks that the rover does not go over."""
    highest_step: float
    """Height of steps and rocks that it still goes over [m]."""
    half_width: float
    """Half of the rover's width [m]: the clearance that its centre needs."""
    farthest: float
    """Largest clearance that is told [m]: twice what it needs to turn on the spot."""
    steepest: float
    """Slope that it may still be driven on [rad]."""

    def __post_init__(self) -> None:
        self.freeze("slope", np.float32, ("rows", "columns"))
        for name in ("ground_step", "step", "clearance", "cost"):
            self.freeze(name, np.float32, self.slope.shape)

    def node(self, point: tuple[float, float]) -> tuple[int, int]:
        """Row and column of the node nearest to a point [m]; may lie outside."""
        column = round((point[0] - self.origin[0]) / self.spacing)
        return round((point[1] - self.origin[1]) / self.spacing), column


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
    far = 2.0 * half_diagonal(rover)
    footprint, lag = max(round(0.5 * rover.length / spacing), 1), wheel_reach(rover, spacing)
    border = max(footprint, 2 * lag, math.ceil(half_diagonal(rover) / spacing))
    slope, roughness, ground_step = _measure(ground, footprint, lag, border)
    obstacles = find_obstacles(rocks, library, rover)
    clearance = _clearance(ground, ground_step, obstacles, limit, far)
    step = _with_rocks(ground_step, rocks.select(rocks.collides), ground)
    widest = border + math.ceil(far / spacing)
    margins = tuple(widest if cut else border for cut in cut_sides)
    return Traversability(
        origin=ground.origin,
        spacing=spacing,
        slope=slope,
        ground_step=ground_step,
        step=step,
        clearance=clearance,
        cost=_cost((slope, roughness, step, clearance), rover, spacing, margins),
        obstacles=obstacles,
        highest_step=limit,
        half_width=0.5 * rover.width,
        farthest=far,
        steepest=rover.tilt_limit,
    )


def wheel_reach(rover: Rover, spacing: float) -> int:
    """Radius of the largest wheel in cells of a grid, rounded up."""
    largest = max(wheel.radius for wheel in rover.wheels)
    return max(math.ceil(largest / spacing - 1e-9), 1)


def _measure(ground: Heightfield, footprint: int, lag: int, border: int) -> tuple[Grid, Grid, Grid]:
    """Slope [rad], RMS residual of the plane [m] and step [m] of the bare ground."""
    slope, roughness, step = (np.full(ground.shape, UNKNOWN, np.float32) for _ in range(3))
    over_chunks(
        measure_ground,
        len(slope),
        ground.elevation,
        ground.spacing,
        (footprint, lag, border),
        slope,
        roughness,
        step,
    )
    return slope, roughness, step


def _clearance(
    ground: Heightfield, step: Grid, obstacles: Obstacles, limit: float, farthest: float
) -> Grid:
    clearance = np.full(ground.shape, farthest, np.float32)
    if bool(np.any(step > limit)):
        reach = math.ceil(farthest / ground.spacing)
        over_chunks(nearest_step, len(step), step, limit, reach, ground.spacing, clearance)
    stamp_obstacles(
        clearance,
        _columns_and_rows(obstacles.centre, ground),
        obstacles.support / ground.spacing,
        UNITS,
        farthest / ground.spacing,
        ground.spacing,
    )
    return clearance


def _with_rocks(ground_step: Grid, rocks: RockField, ground: Heightfield) -> Grid:
    """The ground's steps, raised to the heights of the rocks that stand within half a cell [m]."""
    step = ground_step.copy()
    centre = _columns_and_rows(rocks.position, ground)
    stamp_heights(step, centre, 0.5 * rocks.diameter / ground.spacing + 0.5, rocks.height)
    return step


def _cost(
    measures: tuple[Grid, Grid, Grid, Grid], rover: Rover, spacing: float, margins: tuple[int, ...]
) -> Grid:
    """Cost from slope, roughness, step and clearance; unknown within margins of the sides."""
    limit, half_width = highest_step(rover), 0.5 * rover.width
    limits = (rover.tilt_limit, limit, ROUGHNESS_PER_STEP * limit, half_width, half_diagonal(rover))
    reach = half_width / spacing
    spans = np.sqrt(reach**2 - np.arange(math.floor(reach) + 1.0) ** 2).astype(np.int64)
    cost = np.empty(measures[0].shape, np.float32)
    over_chunks(rate_nodes, len(cost), *measures, limits, spans, margins, cost)
    return cost


def _columns_and_rows(position: NDArray[np.float64], ground: Heightfield) -> NDArray[np.float64]:
    result: NDArray[np.float64] = (position[:, :2] - ground.origin) / ground.spacing
    return result
