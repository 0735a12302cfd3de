"""The hand-off types of motion: a trajectory, and poses along it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array, DataError, Record, checked, quaternion_from_rpy, shaped

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

_POINTS = 0.1
"""Distance of points along paths [m]."""
_SLACK = 1e-6
"""How far beyond its ends a trajectory still answers, for times that were rounded [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Poses(Record):
    """Poses of a moving frame at some times."""

    position: Array
    """Origin in the world frame [m], shape [times, 3]."""
    rpy: Array
    """Roll, pitch, yaw [rad], continuous in time, shape [times, 3]."""
    velocity: Array
    """Velocity of the origin in the world frame [m/s], shape [times, 3]."""
    acceleration: Array
    """Acceleration of the origin in the world frame [m/s²], shape [times, 3]."""

    @property
    def quaternion(self) -> Array:
        """Rotation (w, x, y, z) to the world frame, shape [times, 4]."""
        return quaternion_from_rpy(self.rpy)


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory(Record):
    """Motion of the rover's `base_link` (x forward): a C² spline through samples."""

    name: str
    """Name of the path."""
    time: Array = field(metadata=shaped("samples"))
    """Sample times, from 0 [s], shape [samples]."""
    position: Array = field(metadata=shaped("samples", 3))
    """Origin of base_link in the world frame [m], shape [samples, 3]."""
    rpy: Array = field(metadata=shaped("samples", 3))
    """Roll, pitch, yaw [rad], continuous (yaw is not wrapped), shape [samples, 3]."""
    closed: bool
    """Whether the path ends where it began."""
    spot_turns: Array = field(default_factory=lambda: np.zeros((0, 2)), metadata=shaped("turns", 2))
    """Times at which the rover begins and ends to turn on the spot [s], in order, shape
    [turns, 2]; its place stays the same between them."""

    @property
    def quaternion(self) -> Array:
        """Rotation (w, x, y, z) of each sample, shape [samples, 4]."""
        return quaternion_from_rpy(self.rpy)

    @property
    def length(self) -> float:
        """Length of the path through the samples [m]."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())

    @cached_property
    def _spline(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.time, np.hstack([self.position, self.rpy]))

    @checked
    def at(self, time: ArrayLike) -> Poses:
        """Poses, velocities and accelerations at times [s] within the trajectory.

        Raises:
            DataError: for a time before its first sample or after its last one, and for times in
                more than one row.
        """
        times = np.atleast_1d(np.asarray(time, dtype=np.float64))
        if times.ndim > 1:
            raise DataError(
                f"Trajectory.at: time of shape {times.shape}, a number or a row of them"
            )
        first, last = self.time[0], self.time[-1]
        beyond = times[~((times >= first - _SLACK) & (times <= last + _SLACK))]
        if beyond.size:
            raise DataError(
                f"time {beyond[0]:.6f} s: the trajectory {self.name!r} lasts from {first:.6f} to "
                f"{last:.6f} s"
            )
        values = self._spline(times)
        return Poses(
            position=values[:, :3],
            rpy=values[:, 3:],
            velocity=self._spline(times, 1)[:, :3],
            acceleration=self._spline(times, 2)[:, :3],
        )


def path_points(paths: Iterable[Trajectory]) -> Array:
    """Points along paths, 0.1 m apart, east and north [m], shape [points, 2]."""
    return points_along(trajectory.position[:, :2] for trajectory in paths)


def points_along(lines: Iterable[Array]) -> Array:
    """Points along lines in the plane [m], 0.1 m apart, shape [points, 2]."""
    points = [np.empty((0, 2))]
    for line in lines:
        steps = np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1))
        far = np.concatenate([[0.0], np.cumsum(steps)])
        at = np.arange(0.0, far[-1] + _POINTS, _POINTS)
        points.append(np.stack([np.interp(at, far, line[:, n]) for n in (0, 1)], axis=-1))
    return np.concatenate(points)
