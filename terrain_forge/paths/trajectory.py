"""From a route to a trajectory: when the rover is where, and how it stands on the ground.

It drives at constant speed, with ramps between stops, or by recorded times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from terrain_forge.base import Array, checked, portable, rpy_from_matrix, stage_key, uniforms
from terrain_forge.model import Route, Rover, Trajectory
from terrain_forge.paths.spec import PathSpec

_FOOTPRINT = 5
"""Ground heights taken along each side of the rover's footprint."""


class Heights(Protocol):
    """Ground that tells its height."""

    def height_at(self, east: Array, north: Array) -> Array:
        """Heights [m] at places [m]."""


@checked
def make_trajectory(
    route: Route, *, spec: PathSpec, ground: Heights, rover: Rover, seed: int
) -> Trajectory:
    """The motion along a route, on the bare ground.

    Height and tilt are those of the least-squares plane through the ground under the rover's
    footprint, or recorded ones; shake is added to the angles. The duration is rounded to whole
    samples, so that a closed path ends in the pose in which it began (its yaw whole turns on).
    """
    planned = duration(route)
    steps = max(round(planned * spec.rate_hz), 4)
    clock = planned * spec.rate_hz / steps
    time = np.arange(steps + 1) / spec.rate_hz
    moments = np.linspace(0.0, planned, steps + 1)
    place, heading = pose_at(route, moments)
    height, rpy = stand(ground, rover, place, heading)
    if route.time is not None and route.attitude is not None:
        height, rpy[:, 0], rpy[:, 1] = (
            np.interp(moments, route.time, column) for column in route.attitude.T
        )
    rpy += _shake(spec, steps, seed)
    parts = stretches(route) if route.time is None else ()
    turns = [(part.begin, part.end) for part in parts if part.turning]
    return Trajectory(
        name=route.name,
        time=time,
        position=np.column_stack([place, height + spec.height_m]),
        rpy=rpy,
        closed=route.closed,
        spot_turns=np.reshape(turns, (-1, 2)) / clock,
    )


def stand(ground: Heights, rover: Rover, position: Array, heading: Array) -> tuple[Array, Array]:
    """Height of the ground plane under the rover [m] and its roll, pitch, yaw [rad].

    At places east and north [m], shape [places, 2], and headings [rad], shape [places].
    """
    x = np.linspace(-0.5, 0.5, _FOOTPRINT) * rover.length
    y = np.linspace(-0.5, 0.5, _FOOTPRINT) * rover.width
    forward = np.stack([np.cos(heading), np.sin(heading)], -1)
    left = np.stack([-forward[:, 1], forward[:, 0]], -1)
    offsets = x[None, :, None, None] * forward[:, None, None, :]
    offsets = offsets + y[None, None, :, None] * left[:, None, None, :]
    points = position[:, None, None, :] + offsets
    heights = ground.height_at(points[..., 0], points[..., 1])
    rise = np.mean(heights * x[None, :, None], axis=(1, 2)) / np.mean(x**2)
    bank = np.mean(heights * y[None, None, :], axis=(1, 2)) / np.mean(y**2)
    axis_x = _unit(np.column_stack([forward, rise]))
    axis_y = np.column_stack([left, bank])
    axis_z = _unit(np.cross(axis_x, axis_y))
    rotation = np.stack([axis_x, np.cross(axis_z, axis_x), axis_z], axis=-1)
    rpy = rpy_from_matrix(rotation)
    rpy[:, 2] = heading
    return heights.mean(axis=(1, 2)), rpy


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _shake(spec: PathSpec, steps: int, seed: int) -> Array:
    """Band-limited noise on the angles [rad], shape [samples, 3], that ends as it begins."""
    if spec.shake.rms_deg == 0.0:
        return np.zeros((steps + 1, 3))
    key = stage_key(seed, f"paths/{spec.name}/shake")
    radius, angle = uniforms(key, 6 * (steps // 2 + 1)).reshape(2, steps // 2 + 1, 3)
    turn = 2.0 * np.pi * angle
    spectrum = np.sqrt(-2.0 * portable.log(radius)) * (np.cos(turn) + 1j * np.sin(turn))
    frequency = np.fft.rfftfreq(steps, 1.0 / spec.rate_hz)
    spectrum[(frequency > spec.shake.cutoff_hz) | (frequency == 0.0)] = 0.0
    noise = np.fft.irfft(spectrum, n=steps, axis=0)
    rms = np.sqrt(np.mean(noise**2, axis=0))
    noise *= np.radians(spec.shake.rms_deg) / np.where(rms > 0.0, rms, 1.0)
    return np.vstack([noise, noise[:1]])


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
        pieces = (point, first, driving, False), (first, last, turning, True)
        for a, b, takes, turns in pieces:
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
    return np.asarray(0.5 * acceleration * begun**2 + top * even + braking)
