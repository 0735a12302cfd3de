"""Following a path with a skid-steered rover: pure pursuit (Coulter 1992, CMU-RI-TR-92-01)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.motion import Trajectory
from terrain_forge.records import Record
from terrain_forge.rovers.description import Rover

Array = NDArray[np.float64]

LOOKAHEAD = 1.0
"""Distance along the path of the point that is steered for [m]."""
SKID_GAIN = 2.0
"""Commanded over wanted turn rate: skidding wheels turn at about half the kinematic rate."""
TURN_RATE = 0.4
"""Largest wanted turn rate [rad/s]; tighter arcs are driven slower, and spot turns at this rate."""
_SPOT_BEGIN, _SPOT_END = math.radians(60.0), math.radians(10.0)
_BACKWARD, _FORWARD = 0.5, 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarPath(Record):
    """A path in the plane as a polyline of segments that have a length."""

    position: Array
    """Points, east and north [m], shape [points, 2]."""
    distance: Array
    """Length along the path [m], from 0, strictly increasing, shape [points]."""
    speed: float
    """Mean speed [m/s]."""

    def __post_init__(self) -> None:
        self.freeze("position", np.float64, ("points", 2))
        self.freeze("distance", np.float64, (len(self.position),))

    @staticmethod
    def of(trajectory: Trajectory) -> PlanarPath:
        """The trajectory's ground track.

        Raises:
            ValueError: if the trajectory does not move.
        """
        points = trajectory.position[:, :2]
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        moved = np.concatenate([[True], steps > 1e-9])
        if moved.sum() < 2:
            raise ValueError(f"path {trajectory.name!r} does not move")
        distance = np.concatenate([[0.0], np.cumsum(steps)])[moved]
        duration = float(trajectory.time[-1] - trajectory.time[0])
        return PlanarPath(
            position=points[moved], distance=distance, speed=float(distance[-1]) / duration
        )

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.distance[-1])

    def nearest(self, point: Array, *, near: float) -> tuple[float, float, float]:
        """Where the path passes a point: distance along [m], offset to the left [m], heading [rad].

        Looks only around the distance `near`, so that a path may cross or close itself.
        """
        first = max(int(np.searchsorted(self.distance, near - _BACKWARD)) - 1, 0)
        last = int(np.searchsorted(self.distance, near + _FORWARD)) + 1
        points, along = self.position[first : last + 1], self.distance[first : last + 1]
        steps, lengths = np.diff(points, axis=0), np.diff(along)
        units = steps / np.linalg.norm(steps, axis=1)[:, None]
        offsets = point - points[:-1]
        on = np.clip((offsets * units).sum(1), 0.0, lengths)
        misses = offsets - on[:, None] * units
        best = int(np.argmin((misses**2).sum(1)))
        unit, miss = units[best], misses[best]
        side = math.copysign(1.0, unit[0] * miss[1] - unit[1] * miss[0])
        heading = math.atan2(unit[1], unit[0])
        return float(along[best] + on[best]), side * math.hypot(*miss), heading

    def point(self, distance: float) -> Array:
        """The point at a distance along the path [m], shape [2]; straight on beyond the end."""
        if distance > self.length:
            end = self.position[-1]
            unit = (end - self.position[-2]) / np.linalg.norm(end - self.position[-2])
            return np.asarray(end + (distance - self.length) * unit)
        columns = self.position.T
        return np.array([np.interp(distance, self.distance, column) for column in columns])


class PurePursuit:
    """Steers along a path; remembers how far it has come and whether it turns on the spot."""

    def __init__(self, path: PlanarPath) -> None:
        self.path = path
        self.progress = 0.0
        """Distance along the path [m]."""
        self.offset = 0.0
        """Distance to the left of the path [m]."""
        self.heading_error = 0.0
        """Heading minus the path's, wrapped [rad]."""
        self._turning = False

    def command(self, position: Array, yaw: float) -> tuple[float, float]:
        """Wanted speed [m/s] and turn rate [rad/s] at a place, shape [2] [m], and a yaw [rad]."""
        path = self.path
        self.progress, self.offset, heading = path.nearest(position, near=self.progress)
        self.heading_error = wrap(yaw - heading)
        to_target = path.point(self.progress + LOOKAHEAD) - position
        bearing = wrap(math.atan2(to_target[1], to_target[0]) - yaw)
        self._turning = abs(bearing) > (_SPOT_END if self._turning else _SPOT_BEGIN)
        if self._turning:
            return 0.0, math.copysign(TURN_RATE, bearing)
        curvature = 2.0 * math.sin(bearing) / math.hypot(*to_target)
        speed = min(path.speed, TURN_RATE / max(abs(curvature), 1e-9))
        return speed, speed * curvature


def wheel_rates(rover: Rover, speed: float, turn_rate: float) -> Array:
    """Rates of the rover's wheels [rad/s] for a speed and a turn rate, shape [wheels].

    Slowed together where the fastest would exceed the rover's speed limit.
    """
    sides = np.array([wheel.centre[1] for wheel in rover.wheels])
    radii = np.array([wheel.radius for wheel in rover.wheels])
    speeds = speed - SKID_GAIN * turn_rate * sides
    excess = max(float(np.abs(speeds).max()) / rover.speed_limit, 1.0)
    return np.asarray(speeds / excess / radii)


def wrap(angle: float) -> float:
    """The angle in (-π, π] [rad]."""
    return math.pi - (math.pi - angle) % (2 * math.pi)
