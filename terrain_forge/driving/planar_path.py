"""A path in the plane, as the controller follows it: legs between turns on the spot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array, Record, portable
from terrain_forge.model import Trajectory

CORNER = math.radians(35.0)
"""A bend of the polyline by more at one point is a corner: it is turned on the spot [rad]."""
_BACKWARD, _FORWARD = 0.5, 1.5
_BEND_SPAN = 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarPath(Record):
    """A path in the plane as a polyline of segments that have a length."""

    position: Array
    """Points, east and north [m], shape [points, 2]."""
    distance: Array
    """Length along the path [m], from 0, strictly increasing, shape [points]."""
    speed: float
    """Mean speed where it moves [m/s]."""
    corners: Array
    """Lengths along the path at which the rover turns on the spot [m], increasing, shape
    [corners]."""

    def __post_init__(self) -> None:
        self.freeze("position", np.float64, ("points", 2))
        self.freeze("distance", np.float64, (len(self.position),))
        self.freeze("corners", np.float64, ("corners",))

    @staticmethod
    def of(trajectory: Trajectory) -> PlanarPath:
        """The trajectory's ground track; corners where it turns on the spot, or bends sharply.

        Raises:
            ValueError: if the trajectory does not move.
        """
        points = trajectory.position[:, :2]
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        moved = np.concatenate([[True], steps > 1e-9])
        if moved.sum() < 2:
            raise ValueError(f"path {trajectory.name!r} does not move")
        along = np.concatenate([[0.0], np.cumsum(steps)])
        turning = np.diff(trajectory.spot_turns, axis=1).sum()
        duration = float(trajectory.time[-1] - trajectory.time[0] - turning)
        turned = np.interp(trajectory.spot_turns[:, 0], trajectory.time, along)
        points, along = points[moved], along[moved]
        heading = portable.arctan2(*np.diff(points, axis=0).T[::-1])
        bends = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi) > CORNER
        corners = np.union1d(turned, along[1:-1][bends])
        inner = (corners > 1e-6) & (corners < along[-1] - 1e-6)
        speed = float(along[-1]) / duration
        return PlanarPath(position=points, distance=along, speed=speed, corners=corners[inner])

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(self.distance[-1])

    def leg(self, corner: int) -> tuple[float, float]:
        """Where the leg that ends at a corner of this number begins and ends [m]."""
        ends = np.concatenate([[0.0], self.corners, [self.length]])
        return float(ends[corner]), float(ends[corner + 1])

    def nearest(
        self, point: Array, *, near: float, leg: tuple[float, float] | None = None
    ) -> tuple[float, float, float]:
        """Where the path passes a point: distance along [m], offset to the left [m], heading [rad].

        Looks only around the distance `near`, so that a path may cross or close itself, and only
        at the leg, whose two ends are distances along the path [m].
        """
        begin, end = leg or (0.0, self.length)
        low, high = max(near - _BACKWARD, begin), min(near + _FORWARD, end)
        first = max(int(np.searchsorted(self.distance, low, side="right")) - 1, 0)
        last = max(int(np.searchsorted(self.distance, high)), first + 1)
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

    def point(self, distance: float, *, end: float | None = None) -> Array:
        """The point at a distance along the path [m], shape [2]; straight on beyond `end`."""
        end = self.length if end is None else end
        if distance > end:
            heading = self.heading(end - 1e-6)
            ahead = (distance - end) * np.array([math.cos(heading), math.sin(heading)])
            return np.asarray(self.point(end, end=end) + ahead)
        columns = self.position.T
        return np.array([np.interp(distance, self.distance, column) for column in columns])

    def heading(self, distance: float) -> float:
        """Direction of the path at a distance along it [rad]."""
        last = len(self.distance) - 2
        at = min(max(int(np.searchsorted(self.distance, distance, side="right")) - 1, 0), last)
        east, north = self.position[at + 1] - self.position[at]
        return math.atan2(north, east)

    def bend(self, distance: float, *, end: float) -> float:
        """Mean curvature over the half metre ahead, as far as the end of the leg [1/m]."""
        ahead = min(distance + _BEND_SPAN, end)
        if ahead - distance < 1e-3:
            return 0.0
        turn = wrap(self.heading(ahead - 1e-6) - self.heading(distance))
        return abs(turn) / _BEND_SPAN


def wrap(angle: float) -> float:
    """The angle in (-π, π] [rad]."""
    return math.pi - (math.pi - angle) % (2 * math.pi)
