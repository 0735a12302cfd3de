"""When a rover is where along its route: constant speed, ramps between stops, or recorded times."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Route


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A part of a route between two stops: a drive, or a turn on the spot."""

    first: int
    """Its first point of the route."""
    last: int
    """Its last point."""
    begin: float
    """When it begins [s]."""
    duration: float
    """How long it takes [s]."""
    turning: bool
    """Whether it is a turn on the spot."""

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return self.begin + self.duration


def stretches(route: Route) -> tuple[Stretch, ...]:
    """The drives and spot turns of a route without recorded times, one after the other."""
    found: list[Stretch] = []
    point, clock = 0, 0.0
    for first, last in [*route.turns.tolist(), (len(route.position) - 1, -1)]:
        length = float(route.distance[first] - route.distance[point])
        driving = _driving_time(length, route.speed, route.acceleration)
        # A turn of this time that begins and ends smoothly reaches the turn rate half-way.
        turning = 1.5 * abs(float(route.heading[last] - route.heading[first])) / route.turn_rate
        drive, turn = (point, first, driving, False), (first, last, turning, True)
        for a, b, takes, turns in (drive, turn):
            if b > a:
                part = Stretch(first=a, last=b, begin=clock, duration=takes, turning=turns)
                found.append(part)
                clock = part.end
        point = last
    return tuple(found)


def duration(route: Route) -> float:
    """How long a route takes [s]."""
    if route.time is not None:
        return float(route.time[-1])
    return stretches(route)[-1].end


def pose_at(route: Route, time: Array) -> tuple[Array, Array]:
    """East and north [m], shape [times, 2], and heading [rad], shape [times], at times [s]."""
    columns = np.column_stack([route.position, route.heading])
    if route.time is not None:
        values = np.stack([np.interp(time, route.time, column) for column in columns.T], -1)
        return values[:, :2], values[:, 2]
    values = np.empty((len(time), 3))
    parts = stretches(route)
    begins = np.array([part.begin for part in parts])
    which = np.clip(np.searchsorted(begins, time, side="right") - 1, 0, len(parts) - 1)
    for number, part in enumerate(parts):
        asked = which == number
        since = time[asked] - part.begin
        points = slice(part.first, part.last + 1)
        if part.turning:
            share = np.clip(since / part.duration, 0.0, 1.0)
            at = share * share * (3.0 - 2.0 * share)  # smooth at both ends
            heading = route.heading[points]
            along = (heading - heading[0]) / (heading[-1] - heading[0])
        else:
            length = float(route.distance[part.last] - route.distance[part.first])
            at = _driven(since, length, route.speed, route.acceleration)
            along = route.distance[points] - route.distance[part.first]
        for axis in range(3):
            values[asked, axis] = np.interp(at, along, columns[points, axis])
    return values[:, :2], values[:, 2]


def attitude_at(route: Route, time: Array) -> Array | None:
    """Recorded height [m], roll and pitch [rad] at times [s], shape [times, 3]; None without."""
    if route.time is None or route.attitude is None:
        return None
    return np.stack([np.interp(time, route.time, column) for column in route.attitude.T], -1)


def _driving_time(length: float, speed: float, acceleration: float) -> float:
    if acceleration == 0.0:
        return length / speed
    if length < speed**2 / acceleration:
        return 2.0 * math.sqrt(length / acceleration)
    return length / speed + speed / acceleration


def _driven(time: Array, length: float, speed: float, acceleration: float) -> Array:
    """Distance [m] at times [s] of a drive that speeds up, keeps its speed and brakes."""
    if acceleration == 0.0:
        return speed * time
    whole = _driving_time(length, speed, acceleration)
    top = min(speed, math.sqrt(length * acceleration))
    ramp = top / acceleration
    rest = np.clip(whole - time, 0.0, ramp)
    begun = np.clip(time, 0.0, ramp)
    even = np.clip(time - ramp, 0.0, whole - 2.0 * ramp)
    braking = 0.5 * acceleration * (ramp**2 - rest**2)
    result: Array = 0.5 * acceleration * begun**2 + top * even + braking
    return result
