"""What a path meets on its way: tilt, steps under the wheels, and rocks beside and beneath it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Key, RecipeError, Record, portable
from terrain_forge.model import Heightfield, RockField, RockLibrary, Rover, Trajectory, World, merge
from terrain_forge.paths.obstacles import Obstacles, find_obstacles
from terrain_forge.paths.trajectory import stand
from terrain_forge.paths.traversability_field import steps_at, wheel_reach

FARTHEST = 2.0
"""Largest gap that is told [m]."""
MOST_POSES = 20_000
"""Poses of one path that are looked at, evenly over its samples."""
_ALL = slice(None)


@dataclass(frozen=True, kw_only=True, eq=False)
class Surroundings(Record):
    """What is around the rover at some samples of a path; shake is left out."""

    sample: NDArray[np.int64]
    """Samples of the trajectory that are looked at, shape [poses]."""
    tilt: Array
    """Tilt of the ground under the footprint [rad], shape [poses]."""
    step: Array
    """Largest step of the ground under any wheel [m], shape [poses]."""
    gap: Array
    """Gap between the rover's rectangle and the nearest rock that it does not go over [m], negative
    within, at most `FARTHEST`, shape [poses]."""
    met: tuple[tuple[int, float, float, float, int], ...]
    """Rocks that it does not go over and yet passes through: id, east and north [m], height [m],
    and the pose at which it first touches them; in the order of the drive."""

    def __post_init__(self) -> None:
        self.freeze("sample", np.int64, ("poses",))
        for name in ("tilt", "step", "gap"):
            self.freeze(name, np.float64, (len(self.sample),))


def survey_path(
    trajectory: Trajectory,
    *,
    ground: Heightfield,
    obstacles: Obstacles,
    rover: Rover,
    part: slice = _ALL,
) -> Surroundings:
    """Look along a path, beside what the rover cannot go over.

    The part of its samples that is asked for lies within the bare ground.
    """
    count = min(len(trajectory.time), MOST_POSES)
    sample = np.linspace(0, len(trajectory.time) - 1, count).astype(np.int64)
    first, end, _ = part.indices(len(trajectory.time))
    sample = sample[(sample >= first) & (sample < end)]
    count = len(sample)
    position, heading = trajectory.position[sample, :2], trajectory.rpy[sample, 2]
    _, rpy = stand(ground, rover, position, heading)
    gap = np.full(count, FARTHEST)
    met = []
    for number, poses, gaps in obstacles.beside(position, heading, rover, FARTHEST):
        gap[poses] = np.minimum(gap[poses], gaps)
        if gaps.min() < 0.0:
            x, y = obstacles.centre[number].tolist()
            first = int(poses[np.argmax(gaps < 0.0)])
            met.append((int(obstacles.id[number]), x, y, float(obstacles.height[number]), first))
    return Surroundings(
        sample=sample,
        tilt=portable.arccos(np.clip(np.cos(rpy[:, 0]) * np.cos(rpy[:, 1]), -1.0, 1.0)),
        step=_steps(position, heading, ground, rover),
        gap=gap,
        met=tuple(sorted(met, key=lambda rock: rock[-1])),
    )


def survey_paths(world: World) -> dict[str, Surroundings]:
    """Surroundings of all paths of a world, by name; none for a rover without wheels."""
    if not world.rover.wheels or not world.trajectories:
        return {}
    rocks = merge(world.field, world.neighbours)
    obstacles = find_obstacles(rocks, world.library, world.rover)
    return {
        path.name: survey_path(path, ground=world.ground, obstacles=obstacles, rover=world.rover)
        for path in world.trajectories
    }


def require_free_start(
    trajectory: Trajectory, *, rocks: RockField, library: RockLibrary, rover: Rover, key: Key
) -> None:
    """Refuse a path whose first pose stands in a rock that the rover does not go over.

    Raises:
        RecipeError: names the rock and its place.
    """
    position, heading = trajectory.position[:1, :2], trajectory.rpy[:1, 2]
    touched = find_obstacles(rocks, library, rover).first_touched(position, heading, rover)
    if touched:
        x, y = position[0]
        raise RecipeError(
            f"path {trajectory.name!r} starts at ({x:.2f}, {y:.2f}) m within {touched}; "
            "rocks.exclusion_zones keeps a circle free",
            key=(*key, "route"),
        )


def _steps(position: Array, heading: Array, ground: Heightfield, rover: Rover) -> Array:
    """Largest ground step within reach of any wheel [m], shape [poses]."""
    cos, sin = np.cos(heading), np.sin(heading)
    x, y = rover.wheel_centres[:, 0], rover.wheel_centres[:, 1]
    east = position[:, :1] + np.outer(cos, x) - np.outer(sin, y)
    north = position[:, 1:] + np.outer(sin, x) + np.outer(cos, y)
    column = np.rint((east - ground.origin[0]) / ground.spacing).astype(np.int64)
    row = np.rint((north - ground.origin[1]) / ground.spacing).astype(np.int64)
    reach = wheel_reach(rover, ground.spacing)
    return np.asarray(steps_at(ground.elevation, row, column, reach))
