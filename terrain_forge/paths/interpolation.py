"""How consumers move between the poses that they are given, and how far off the path that is.

Gazebo draws a Catmull-Rom spline through the places (gz-common's `PoseAnimation`) that knows
nothing of the time between them; USD draws straight lines. Both turn at a constant rate from pose
to pose (slerp): Gazebo within 1e-5 rad, as long as some Euler angle changes by less than 0.16 rad
per step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable
from terrain_forge.model import Trajectory

Interpolation = Callable[[Array, Array, Array], Array]
"""Places between samples: of times, places and the asked times, as `spline_places`."""

POSITION_LIMIT = 0.005
"""How far off the path a consumer may be between samples [m]."""
ANGLE_LIMIT = 0.001
"""How far it may be turned from the path's pose there [rad]."""

_MARGIN = 0.8
"""Part of the limits that is aimed at, since only some times between samples are looked at."""
_FRACTIONS = np.array([0.2, 0.35, 0.5, 0.65, 0.8])
"""Where between two samples deviations are looked for."""
_MOST_STEPS = 128


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """The largest distances between a path and what a consumer makes of its samples."""

    position: float
    """Of the places [m]."""
    angle: float
    """Of the orientations, the angle of the turn between them [rad]."""

    def within(self, share: float = 1.0) -> bool:
        """Whether both keep this share of their limits."""
        return self.position <= share * POSITION_LIMIT and self.angle <= share * ANGLE_LIMIT


def deviation(
    trajectory: Trajectory,
    *,
    times: Array,
    position: Array,
    quaternion: Array,
    places_between: Interpolation,
) -> Deviation:
    """How far off a trajectory a consumer is between the samples that it was given.

    Those are times [s], ascending, places [m] and orientations (w, x, y, z); the places between
    them are `spline_places` or `straight_places`.
    """
    asked = times_between(times)
    wanted = trajectory.at(asked)
    places = places_between(times, position, asked)
    turns = turns_between(times, quaternion, asked)
    return Deviation(
        position=float(np.linalg.norm(places - wanted.position, axis=1).max()),
        angle=float(angles_between(turns, wanted.quaternion).max()),
    )


def times_between(times: Array) -> Array:
    """Some times within each step between samples [s]."""
    return np.asarray(times[:-1, None] + np.diff(times)[:, None] * _FRACTIONS).reshape(-1)


def sample_times(trajectory: Trajectory, places_between: Interpolation) -> Array:
    """The trajectory's times, each step halved as often as the limits need [s].

    The trajectory's own samples stay among them. After seven halvings it is left at that.
    """
    steps = 1
    times = np.asarray(trajectory.time)
    while steps < _MOST_STEPS:
        poses = trajectory.at(times)
        found = deviation(
            trajectory,
            times=times,
            position=poses.position,
            quaternion=poses.quaternion,
            places_between=places_between,
        )
        if found.within(_MARGIN):
            break
        steps *= 2
        parts = np.arange(steps) / steps
        between = trajectory.time[:-1, None] + np.diff(trajectory.time)[:, None] * parts
        times = np.append(between.reshape(-1), trajectory.time[-1])
    return times


def straight_places(times: Array, position: Array, asked: Array) -> Array:
    """Places on straight lines between samples, as USD draws them [m], shape [asked, 3].

    Of samples' times [s], ascending, and places [m], shape [samples, 3], at times within them.
    """
    return np.stack([np.interp(asked, times, axis) for axis in position.T], axis=-1)


def spline_places(times: Array, position: Array, asked: Array) -> Array:
    """Places on Gazebo's spline of tension 0 [m], shape [asked, 3]; see `straight_places`.

    Cubic Hermite pieces whose tangents are half the way from the sample before to the one after,
    and half of the first and last step at the ends, unless they are the same place.
    """
    tangents = np.empty_like(position)
    tangents[1:-1] = 0.5 * (position[2:] - position[:-2])
    tangents[0], tangents[-1] = 0.5 * np.diff(position, axis=0)[[0, -1]]
    if np.array_equal(position[0], position[-1]):
        tangents[[0, -1]] = 0.5 * (position[1] - position[-2])
    first, part = _steps(times, asked)
    part = part[:, None]
    rest = 1.0 - part
    begin = rest**2 * ((1.0 + 2.0 * part) * position[first] + part * tangents[first])
    end = part**2 * ((1.0 + 2.0 * rest) * position[first + 1] - rest * tangents[first + 1])
    return np.asarray(begin + end)


def turns_between(times: Array, quaternion: Array, asked: Array) -> Array:
    """Quaternions between samples, turning at constant rate the short way, shape [asked, 4]."""
    first, part = _steps(times, asked)
    begin, end = quaternion[first], quaternion[first + 1]
    end = np.where(np.sum(begin * end, axis=1)[:, None] < 0.0, -end, end)
    angle = 0.5 * angles_between(begin, end)
    still = angle < 1e-9
    sine = np.sin(np.where(still, 1.0, angle))
    one = np.where(still, 1.0 - part, np.sin((1.0 - part) * angle) / sine)
    other = np.where(still, part, np.sin(part * angle) / sine)
    return np.asarray(one[:, None] * begin + other[:, None] * end)


def angles_between(one: Array, other: Array) -> Array:
    """Angles of the turns between quaternions, shape [n, 4] each [rad]."""
    near = np.where(np.sum(one * other, axis=1)[:, None] < 0.0, -other, other)
    apart, along = (np.linalg.norm(v, axis=1) for v in (one - near, one + near))
    return np.asarray(4.0 * portable.arctan2(apart, along))


def _steps(times: Array, asked: Array) -> tuple[NDArray[np.intp], Array]:
    """The step in which each asked time falls, and the part of it that is over."""
    first = np.clip(np.searchsorted(times, asked, side="right") - 1, 0, len(times) - 2)
    return first, (asked - times[first]) / (times[first + 1] - times[first])
