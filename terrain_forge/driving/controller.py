"""Following a path with a skid-steered rover: pure pursuit (Coulter 1992, CMU-RI-TR-92-01).

The path is a polyline whose legs end at turns on the spot. A skid-steered rover turns slower than
its wheels' rates say, since they must slip sideways; by how much depends on rover and ground, and
is learned on the way (Martínez et al. 2005, doi:10.1177/0278364905058239, call it the instantaneous
centres of rotation of the treads).
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from terrain_forge.base import Array, Record, portable
from terrain_forge.model import Rover, Trajectory

CORNER = math.radians(35.0)
"""A bend of the polyline by more at one point is a corner: it is turned on the spot [rad]."""
_BACKWARD, _FORWARD = 0.5, 1.5
_BEND_SPAN = 0.5
LOOKAHEAD = 1.0
"""Least distance along the path of the point that is steered for [m]."""
_LOOKAHEAD_LENGTHS = 0.7
SKID_GAIN = 2.0
"""Commanded over real turn rate before anything is known of the rover."""
TURN_RATE = 0.4
"""Largest wanted turn rate [rad/s]; tighter arcs are driven slower, and spot turns at this rate."""
RIM_ACCELERATION = 0.25
"""Largest change of a rim's commanded speed [m/s²]; stiff servos answer faster ones by blows."""
_SPOT_BEGIN, _SPOT_END = math.radians(60.0), math.radians(10.0)
_CORNER_REACHED, _CORNER_TURNED = 0.03, math.radians(4.0)
_CREEPING = 0.05
_LOWEST_GAIN, _HIGHEST_GAIN = 1.0, 4.0
_MEMORY = 10.0
_PRIOR_RATE = 0.1

Place = Sequence[float] | Array
"""East and north [m]."""


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
        return self._ends[corner], self._ends[corner + 1]

    @cached_property
    def _ends(self) -> list[float]:
        """Where legs begin and end [m]."""
        return [0.0, *self.corners.tolist(), self.length]

    @cached_property
    def _along(self) -> list[float]:
        """Length along the path of each point [m]."""
        return self.distance.tolist()  # type: ignore[no-any-return]

    @cached_property
    def _segments(self) -> tuple[Array, ...]:
        """Of each segment east and north of its begin [m] and of its direction, and length [m]."""
        steps = np.diff(self.position, axis=0)
        units = steps / np.linalg.norm(steps, axis=1)[:, None]
        columns = *self.position[:-1].T, *units.T, np.diff(self.distance)
        return tuple(np.ascontiguousarray(column) for column in columns)

    @cached_property
    def _points(self) -> list[tuple[float, float]]:
        """East and north of each point [m]."""
        return [(east, north) for east, north in self.position.tolist()]

    @cached_property
    def _headings(self) -> list[float]:
        """Direction of each segment [rad]."""
        steps = np.diff(self.position, axis=0).tolist()
        return [math.atan2(north, east) for east, north in steps]

    def nearest(
        self, point: Place, *, near: float, leg: tuple[float, float] | None = None
    ) -> tuple[float, float, float]:
        """Where the path passes a point: distance along [m], offset to the left [m], heading [rad].

        Looks only around the distance `near`, so that a path may cross or close itself, and only
        at the leg, whose two ends are distances along the path [m].
        """
        begin, end = leg or (0.0, self.length)
        low, high = max(near - _BACKWARD, begin), min(near + _FORWARD, end)
        first = max(bisect_right(self._along, low) - 1, 0)
        last = max(bisect_left(self._along, high), first + 1)
        begins_east, begins_north, units_east, units_north, lengths = (
            part[first:last] for part in self._segments
        )
        east, north = point[0] - begins_east, point[1] - begins_north
        on = np.maximum(0.0, np.minimum(east * units_east + north * units_north, lengths))
        east -= on * units_east
        north -= on * units_north
        best = int((east * east + north * north).argmin())
        aside, up, along = float(east[best]), float(north[best]), first + best
        ahead, across = float(units_east[best]), float(units_north[best])
        side = math.copysign(1.0, ahead * up - across * aside)
        distance = self._along[along] + float(on[best])
        return distance, side * math.hypot(aside, up), math.atan2(across, ahead)

    def point(self, distance: float, *, end: float | None = None) -> tuple[float, float]:
        """East and north at a distance along the path [m]; straight on beyond `end`."""
        end = self.length if end is None else end
        if distance > end:
            heading, (east, north) = self.heading(end - 1e-6), self.point(end, end=end)
            ahead = distance - end
            return east + ahead * math.cos(heading), north + ahead * math.sin(heading)
        at = self._segment(distance)
        (west, south), (east, north) = self._points[at : at + 2]
        part = (distance - self._along[at]) / (self._along[at + 1] - self._along[at])
        part = min(max(part, 0.0), 1.0)
        return west + part * (east - west), south + part * (north - south)

    def heading(self, distance: float) -> float:
        """Direction of the path at a distance along it [rad]."""
        return self._headings[self._segment(distance)]

    def _segment(self, distance: float) -> int:
        """The number of the segment at a distance along the path [m]; the nearest beyond ends."""
        return min(max(bisect_right(self._along, distance) - 1, 0), len(self._along) - 2)

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


class SkidGain:
    """What the rover's turn rate is, against that of its wheels, by least squares on the way.

    The rover's turn rate is that of its wheels over the gain, and noise of the rough ground; looks
    fade within ten seconds, and the first guess weighs as much as a turn rate of the wheels of
    0.1 rad/s does. (The reverse fit, wheels over rover, would take the noise for skill.)
    """

    def __init__(self) -> None:
        self._product = self._square = 0.0

    @property
    def value(self) -> float:
        """Turn rate of the wheels over that of the rover."""
        weight = _PRIOR_RATE**2
        part = (self._product + weight / SKID_GAIN) / (self._square + weight)
        return 1.0 / min(max(part, 1.0 / _HIGHEST_GAIN), 1.0 / _LOWEST_GAIN)

    def note(self, *, wheels: float, rover: float, time: float) -> None:
        """Learn from turn rates [rad/s] that lasted for a time [s]."""
        part = -math.expm1(-time / _MEMORY)
        self._product += part * (wheels * rover - self._product)
        self._square += part * (wheels * wheels - self._square)


class PurePursuit:
    """Steers along a path; remembers how far it has come and whether it turns on the spot."""

    def __init__(self, path: PlanarPath, *, lookahead: float = LOOKAHEAD) -> None:
        self.path = path
        self.lookahead = lookahead
        """Distance along the path of the point that is steered for [m]."""
        self.progress = 0.0
        """Distance along the path [m]."""
        self.offset = 0.0
        """Distance to the left of the path [m]."""
        self.heading_error = 0.0
        """Heading minus the path's, wrapped [rad]."""
        self._turning = False
        self._at_corner = False
        self._corner = 0

    def command(self, position: Place, yaw: float) -> tuple[float, float]:
        """Wanted speed [m/s] and turn rate [rad/s] at a place [m] and a yaw [rad]."""
        path = self.path
        leg = path.leg(self._corner)
        self.progress, self.offset, heading = path.nearest(position, near=self.progress, leg=leg)
        self.heading_error = wrap(yaw - heading)
        if self._corner < len(path.corners) and self.progress > leg[1] - _CORNER_REACHED:
            self._at_corner = True
        if self._at_corner:
            return self._turn_corner(yaw, leg[1])
        east, north = path.point(self.progress + self.lookahead, end=leg[1])
        east, north = east - position[0], north - position[1]
        bearing = wrap(math.atan2(north, east) - yaw)
        self._turning = abs(bearing) > (_SPOT_END if self._turning else _SPOT_BEGIN)
        if self._turning:
            return 0.0, math.copysign(TURN_RATE, bearing)
        curvature = 2.0 * math.sin(bearing) / math.hypot(east, north)
        sharpest = max(abs(curvature), path.bend(self.progress, end=leg[1]), 1e-9)
        speed = min(path.speed, TURN_RATE / sharpest)
        if self._corner < len(path.corners):  # at which the rover must still be able to stop
            stopping = math.sqrt(RIM_ACCELERATION * max(leg[1] - self.progress, 0.0))
            speed = min(speed, max(stopping, _CREEPING))
        return speed, speed * curvature

    def _turn_corner(self, yaw: float, corner: float) -> tuple[float, float]:
        """Turn on the spot to where the path leaves the corner, then begin the next leg."""
        missing = wrap(self.path.heading(corner + 1e-6) - yaw)
        if abs(missing) > _CORNER_TURNED:
            return 0.0, math.copysign(TURN_RATE, missing)
        self._at_corner = False
        self._corner += 1
        self.progress = corner
        return 0.0, 0.0


def lookahead_of(rover: Rover) -> float:
    """How far ahead a rover of this length is steered [m]; a long one that looks near swerves."""
    return max(LOOKAHEAD, _LOOKAHEAD_LENGTHS * rover.length)


def wheel_rates(rover: Rover, speed: float, turn_rate: float, *, gain: float = SKID_GAIN) -> Array:
    """Rates of the rover's wheels for a speed [m/s] and a turn rate [rad/s], shape [wheels].

    Slowed together where the fastest would exceed the rover's speed limit. The gain is the turn
    rate of the wheels over that of the rover, which skids.
    """
    speeds = speed - gain * turn_rate * rover.wheel_centres[:, 1]
    excess = max(max(map(abs, speeds.tolist())) / rover.speed_limit, 1.0)
    return np.asarray(speeds / excess / rover.wheel_radii)


def eased(rover: Rover, wanted: Array, before: Array, *, time: float) -> Array:
    """Wheel rates [rad/s] as near to the wanted ones as the rims' acceleration allows in a time.

    All wheels change by the same part, so that the rover keeps its arc.
    """
    change = wanted - before
    fastest = max(map(abs, (change * rover.wheel_radii).tolist()))
    excess = fastest / (RIM_ACCELERATION * time)
    return np.asarray(before + change / max(excess, 1.0))


def wheels_turn_rate(rover: Rover, rates: Array) -> float:
    """Turn rate that wheels of these rates [rad/s] would make if none slipped [rad/s].

    The least-squares slope of the rims' speeds over the wheels' distance to the left.
    """
    rims: list[float] = (rates * rover.wheel_radii).tolist()
    sides: list[float] = rover.wheel_centres[:, 1].tolist()
    middle = sum(sides) / len(sides)
    sides = [side - middle for side in sides]
    weight = sum(side * side for side in sides)
    return -sum(side * rim for side, rim in zip(sides, rims, strict=True)) / weight
