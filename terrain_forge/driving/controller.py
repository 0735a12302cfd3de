"""Following a path with a skid-steered rover: pure pursuit (Coulter 1992, CMU-RI-TR-92-01).

A skid-steered rover turns slower than its wheels' rates say, since they must slip sideways; by how
much depends on rover and ground, and is learned on the way (Martínez et al. 2005,
doi:10.1177/0278364905058239, call it the instantaneous centres of rotation of the treads).
"""

from __future__ import annotations

import math

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.driving.planar_path import PlanarPath, wrap
from terrain_forge.model import Rover

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

    def command(self, position: Array, yaw: float) -> tuple[float, float]:
        """Wanted speed [m/s] and turn rate [rad/s] at a place, shape [2] [m], and a yaw [rad]."""
        path = self.path
        leg = path.leg(self._corner)
        self.progress, self.offset, heading = path.nearest(position, near=self.progress, leg=leg)
        self.heading_error = wrap(yaw - heading)
        if self._corner < len(path.corners) and self.progress > leg[1] - _CORNER_REACHED:
            self._at_corner = True
        if self._at_corner:
            return self._turn_corner(yaw, leg[1])
        to_target = path.point(self.progress + self.lookahead, end=leg[1]) - position
        bearing = wrap(math.atan2(to_target[1], to_target[0]) - yaw)
        self._turning = abs(bearing) > (_SPOT_END if self._turning else _SPOT_BEGIN)
        if self._turning:
            return 0.0, math.copysign(TURN_RATE, bearing)
        curvature = 2.0 * math.sin(bearing) / math.hypot(*to_target)
        sharpest = max(abs(curvature), path.bend(self.progress, end=leg[1]), 1e-9)
        speed = min(path.speed, TURN_RATE / sharpest, self._stopping_speed(leg[1]))
        return speed, speed * curvature

    def _stopping_speed(self, end: float) -> float:
        """Speed from which the rover can still stop at the next corner; no limit without one."""
        if self._corner == len(self.path.corners):
            return math.inf
        return max(math.sqrt(RIM_ACCELERATION * max(end - self.progress, 0.0)), _CREEPING)

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
    sides = np.array([wheel.centre[1] for wheel in rover.wheels])
    radii = np.array([wheel.radius for wheel in rover.wheels])
    speeds = speed - gain * turn_rate * sides
    excess = max(float(np.abs(speeds).max()) / rover.speed_limit, 1.0)
    return np.asarray(speeds / excess / radii)


def eased(rover: Rover, wanted: Array, before: Array, *, time: float) -> Array:
    """Wheel rates [rad/s] as near to the wanted ones as the rims' acceleration allows in a time.

    All wheels change by the same part, so that the rover keeps its arc.
    """
    radii = np.array([wheel.radius for wheel in rover.wheels])
    change = wanted - before
    excess = float(np.abs(change * radii).max()) / (RIM_ACCELERATION * time)
    return np.asarray(before + change / max(excess, 1.0))


def wheels_turn_rate(rover: Rover, rates: Array) -> float:
    """Turn rate that wheels of these rates [rad/s] would make if none slipped [rad/s].

    The least-squares slope of the rims' speeds over the wheels' distance to the left.
    """
    sides = np.array([wheel.centre[1] for wheel in rover.wheels])
    radii = np.array([wheel.radius for wheel in rover.wheels])
    sides = sides - sides.mean()
    return float(-(portable.product(sides, rates * radii)) / (portable.product(sides, sides)))
