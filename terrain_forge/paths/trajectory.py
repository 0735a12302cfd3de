"""From a route to a trajectory: the motion of the rover's base_link on the ground."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable, rpy_from_matrix, stage_key, uniforms
from terrain_forge.model import Heightfield, Route, Rover, Trajectory
from terrain_forge.paths.profile import attitude_at, duration, pose_at, stretches
from terrain_forge.paths.spec import PathSpec

_FOOTPRINT = 5
"""Ground heights taken along each side of the rover's footprint."""


def make_trajectory(
    route: Route, *, spec: PathSpec, ground: Heightfield, rover: Rover, seed: int
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
    attitude = attitude_at(route, moments)
    if attitude is not None:
        height, rpy[:, :2] = attitude[:, 0], attitude[:, 1:]
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


def stand(
    ground: Heightfield, rover: Rover, position: Array, heading: Array
) -> tuple[Array, Array]:
    """Height of the ground plane under the rover [m] and its roll, pitch, yaw [rad].

    Args:
        ground: what it stands on.
        rover: who stands there.
        position: east and north [m], shape [places, 2].
        heading: counter-clockwise from east [rad], shape [places].
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
    result: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return result


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
