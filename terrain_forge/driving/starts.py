"""Many drives straight on, from starts and in directions that are drawn at random.

Each start is drawn by its own number, and each drive begins from a reset simulation: the result is
the same for any number of processes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import (
    Array,
    Record,
    SimulationError,
    processors,
    run_tasks,
    stage_key,
    uniforms,
)
from terrain_forge.driving.result import DriveResult
from terrain_forge.driving.simulation import drive, load_scene
from terrain_forge.model import Rover, Trajectory, World
from terrain_forge.recipe import DriveSpec, StartsSpec

MOST_PROCESSES = 8
"""Drives that run side by side; each process holds the scene."""
_TRIES = 1000
_SPACE = 0.2
_LOW = 0.5
_OFF_PATH = 2.0
_SAMPLES = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class StartResult(Record):
    """How one of many drives went."""

    start: tuple[float, float]
    """East and north of its start [m]."""
    heading: float
    """Direction of the drive, counter-clockwise from east [rad]."""
    drive: DriveResult | None
    """The drive; None where it could not begin."""
    reason: str
    """How it ended, or why it could not begin."""

    @property
    def arrived(self) -> bool:
        """Whether the rover came to its goal."""
        return self.drive is not None and self.drive.completed


@dataclass(frozen=True, kw_only=True, eq=False)
class StartsResult(Record):
    """How many drives went."""

    length: float
    """How far each was to go [m]."""
    starts: tuple[StartResult, ...]
    """The drives, in the order of their numbers."""

    @property
    def share(self) -> float:
        """Part of the drives that arrived."""
        return sum(start.arrived for start in self.starts) / len(self.starts)

    @property
    def mean_slip(self) -> float:
        """Mean size of the wheels' slip over all drives that began; 0 where none did."""
        slips = [start.drive.mean_slip for start in self.starts if start.drive]
        return float(np.mean(slips)) if slips else 0.0


def drive_from_many_starts(
    world: World,
    scene: Path,
    spec: StartsSpec,
    *,
    processes: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> StartsResult:
    """Drive straight on from random starts through the exported scene.xml.

    By default one process per processor core drives, at most 8; `progress` is told the share of the
    drives that are done, 0 to 1.

    Raises:
        SimulationError: if the scene cannot be loaded, the ground has no room for a drive, or a
            process is killed.
    """
    lines = [line_from_start(world, spec, number) for number in range(spec.count)]
    processes = min(processes or processors(), MOST_PROCESSES, spec.count)
    task = partial(_drive_line, rover=world.rover, path=scene)
    done = dict[str, StartResult]()
    workers = processes if processes > 1 else 0
    for line, result in run_tasks(task, lines, workers=workers):
        if isinstance(result, OSError):
            raise SimulationError(f"a process of the drives was lost: {result}")
        if isinstance(result, Exception):
            raise result
        done[line.name] = result
        if progress:
            progress(len(done) / len(lines))
    _scenes.clear()
    starts = tuple(done[line.name] for line in lines)
    return StartsResult(length=spec.length_m, starts=starts)


def line_from_start(world: World, spec: StartsSpec, number: int) -> Trajectory:
    """The straight line that one of many drives follows, by its number.

    The first of its addressed draws counts whose line lies on the ground, with room for the rover,
    and whose start is free of rocks higher than half a wheel's radius; on lower ones it can stand.

    Raises:
        SimulationError: if none of 1000 draws does.
    """
    rover = world.rover
    reach = 0.5 * math.hypot(rover.length, rover.width) + _SPACE
    west, south, east, north = world.ground.bounds
    high = world.field.height > _LOW * min(wheel.radius for wheel in rover.wheels)
    rocks = world.field.select(high & world.field.collides)
    for attempt in range(_TRIES):
        key = stage_key(world.site.seed, f"validation/drives/{number}/{attempt}")
        across, up, turn = uniforms(key, 3).tolist()
        start = np.array([west + across * (east - west), south + up * (north - south)])
        heading = math.tau * turn
        end = start + spec.length_m * np.array([math.cos(heading), math.sin(heading)])
        if not world.ground.holds(np.array([start, end]), margin=reach):
            continue
        away = np.linalg.norm(rocks.position[:, :2] - start, axis=1)
        if not (away < reach + 0.5 * rocks.diameter).any():
            return _line(world, spec, number, start, end)
    raise SimulationError(
        f"no free start of a drive of {spec.length_m:g} m was found in {_TRIES} draws: choose a "
        "smaller length_m"
    )


def _line(world: World, spec: StartsSpec, number: int, start: Array, end: Array) -> Trajectory:
    """A trajectory on the bare ground along a line; its first pose lies on the slope."""
    points = np.linspace(start, end, _SAMPLES)
    speed = min(spec.speed_m_s, world.rover.speed_limit)
    step = world.ground.spacing
    east, north = start.tolist()
    height = world.ground.height_at
    rise_east = float(height(east + step, north) - height(east - step, north)) / (2 * step)
    rise_north = float(height(east, north + step) - height(east, north - step)) / (2 * step)
    heading = math.atan2(*(end - start)[::-1])
    ahead = rise_east * math.cos(heading) + rise_north * math.sin(heading)
    left = rise_north * math.cos(heading) - rise_east * math.sin(heading)
    rpy = np.tile([math.atan(left), -math.atan(ahead), heading], (_SAMPLES, 1))
    return Trajectory(
        name=f"start {number}",
        time=np.linspace(0.0, spec.length_m / speed, _SAMPLES),
        position=np.column_stack([points, height(*points.T)]),
        rpy=rpy,
        closed=False,
    )


_scenes = dict[Path, Any]()
"""The scene that a process has loaded, for all its drives."""


def _drive_line(line: Trajectory, *, rover: Rover, path: Path) -> StartResult:
    if path not in _scenes:
        _scenes.clear()
        _scenes[path] = load_scene(path)
    east, north = line.position[0, :2].tolist()
    spec = DriveSpec(path="start", cross_track_m=_OFF_PATH)
    result: DriveResult | None = None
    try:
        result = drive(scene=_scenes[path], trajectory=line, rover=rover, spec=spec)
        reason = result.reason
    except SimulationError as error:
        reason = str(error)
    return StartResult(
        start=(east, north), heading=float(line.rpy[0, 2]), drive=result, reason=reason
    )
