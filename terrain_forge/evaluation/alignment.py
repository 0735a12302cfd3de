"""Bringing an estimate to the truth: which poses belong together, and the motion between them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, Mask, portable
from terrain_forge.evaluation.poses import TimedPoses

Part = Literal["first_third", "all", "origin", "none"]
"""Poses that an alignment looks at."""
By = Literal["index", "time", "length"]
"""What a third is counted by."""
Association = Literal["nearest", "interpolated"]
"""How truth is found at an estimate's times."""
_LEAST = 3
"""Poses that must belong together, for an alignment to be one."""


SAME_TIME = 1e-6
"""How far times may be apart that are the same [s]: floats and files have no nanoseconds."""


def associate(
    truth: TimedPoses,
    estimate: TimedPoses,
    *,
    association: Association = "nearest",
    most: float = 0.01,
    gap: float = 1.0,
) -> tuple[TimedPoses, TimedPoses]:
    """Poses of truth and estimate at the same times, as many of one as of the other.

    Args:
        truth: The truth.
        estimate: The estimate.
        association: `nearest`: of the trajectory with fewer poses each, the nearest in time of the
            other (as evo does); `interpolated`: the truth between its poses at the estimate's
            times, but not across its gaps.
        most: Largest difference of nearest times [s].
        gap: Largest time between two poses of the truth that it is interpolated between [s].

    Raises:
        DataError: if less than three poses belong together, or one is no poses.
    """
    for what, poses in (("the truth", truth), ("the estimate", estimate)):
        if not isinstance(poses, TimedPoses):
            found = type(poses).__name__
            raise DataError(f"{what} must be poses, as `read_poses` gives them, found a {found}")
    for name, poses in (("the truth", truth), (estimate.name, estimate)):
        if not len(poses.time):
            raise DataError(f"{name} has no poses")
    if association == "interpolated":
        within = _within(estimate.time, truth.time, gap)
        _require_enough(within, truth, estimate, f", and gap_s is {gap:g} s")
        kept = estimate.select(np.flatnonzero(within))
        return truth.at(kept.time), kept
    swapped = len(truth.time) < len(estimate.time)
    short, long = (truth, estimate) if swapped else (estimate, truth)
    rows = nearest(long.time, short.time)
    close = np.abs(long.time[rows] - short.time) <= most
    _require_enough(close, truth, estimate, f", and most_apart_s is {most:g} s")
    found = short.select(np.flatnonzero(close)), long.select(rows[close])
    return found if swapped else found[::-1]


def _within(time: Array, sorted_times: Array, gap: float) -> Mask:
    """Which times lie at sorted ones, or between two that are no farther apart than a gap [s]."""
    before = np.searchsorted(sorted_times, time, side="right") - 1
    after = np.searchsorted(sorted_times, time)
    inside = (before >= 0) & (after < len(sorted_times))
    steps = sorted_times[np.where(inside, after, 0)] - sorted_times[np.where(inside, before, 0)]
    return np.asarray(inside & (steps <= gap + SAME_TIME))


def _require_enough(paired: Mask, truth: TimedPoses, estimate: TimedPoses, near: str = "") -> None:
    """Refuse poses of which too few are paired; `near` tells what else may be why."""
    if (count := np.count_nonzero(paired)) < _LEAST:
        raise DataError(
            f"{estimate.name}: at least {_LEAST} poses at times of the truth are needed, "
            f"found {count}: it lasts from {estimate.time[0]:.3f} to {estimate.time[-1]:.3f} s, "
            f"the truth from {truth.time[0]:.3f} to {truth.time[-1]:.3f} s"
            f"{near}{_clock_hint(truth.time, estimate.time)}"
        )


def _clock_hint(one: Array, other: Array) -> str:
    """What is likely wrong with stamps of which one lasts, or begins, as no other does."""
    short, long = sorted((one, other), key=np.ptp)
    if np.ptp(long) > 1e6 * np.ptp(short) > 0.0:
        return " (stamps are in seconds; are some nanoseconds?)"
    early, late = sorted((one, other), key=lambda time: float(time[0]))
    if late[0] > early[-1] and abs(early[0]) <= np.ptp(early):
        return " (is one counted from its own begin?)"
    return ""


def nearest(sorted_times: Array, times: Array) -> NDArray[np.intp]:
    """Rows of the nearest sorted times."""
    after = np.clip(np.searchsorted(sorted_times, times), 1, len(sorted_times) - 1)
    before = after - 1
    return np.asarray(
        np.where(times - sorted_times[before] <= sorted_times[after] - times, before, after),
        np.intp,
    )


def count_of(truth: TimedPoses, *, part: Part, by: By) -> int:
    """How many of the first poses an alignment looks at, at least 3."""
    if part != "first_third":
        return 1 if part == "origin" else len(truth.time)
    if by == "index":
        count = len(truth.time) // 3
    else:
        passed = truth.time - truth.time[0] if by == "time" else truth.stations
        count = int(np.searchsorted(passed, passed[-1] / 3.0, side="right"))
    return min(max(count, 3), len(truth.time))


def rigid_motion(moving: Array, fixed: Array, *, scale: bool = False) -> tuple[Array, Array, float]:
    """Rotation, shift and scale that bring points to others with the least squares of distance.

    Closed form of Horn 1987 (doi:10.1364/JOSAA.4.000629) as Umeyama writes it (1991,
    doi:10.1109/34.88573).

    Args:
        moving: Points [m], shape [points, 3].
        fixed: Where they shall lie [m], shape [points, 3].
        scale: Whether to find a scale too, else it is 1.
    """
    from scipy.linalg import svd

    middle, target = moving.mean(axis=0), fixed.mean(axis=0)
    own, other = moving - middle, fixed - target
    left, values, right = svd((other[:, :, None] * own[:, None, :]).mean(axis=0))
    signs = np.ones(3)
    if np.linalg.det(left) * np.linalg.det(right) < 0.0:
        signs[2] = -1.0
    rotation = portable.product(left * signs, right)
    factor = 1.0
    if scale:
        spread = float((own**2).sum() / len(moving))
        factor = float((values * signs).sum()) / spread if spread > 0.0 else 1.0
    return rotation, target - factor * portable.product(rotation, middle), factor


def aligned(
    truth: TimedPoses,
    estimate: TimedPoses,
    *,
    part: Part = "first_third",
    by: By = "length",
    scale: bool = False,
) -> tuple[TimedPoses, Array]:
    """The estimate in the truth's frame, and the motion that brought it there, shape [4, 4].

    Both have as many poses, at the same times (`associate`). `origin` lays the first pose on the
    truth's, rotation included. Where a scale is found too, the motion's upper left holds it.
    """
    from scipy.spatial.transform import Rotation

    motion = np.eye(4)
    if part == "none":
        return estimate, motion
    factor = 1.0
    if part == "origin":
        rotation = portable.product(truth.rotation[0], estimate.rotation[0].T)
        shift = truth.position[0] - portable.product(rotation, estimate.position[0])
    else:
        count = count_of(truth, part=part, by=by)
        rotation, shift, factor = rigid_motion(
            estimate.position[:count], truth.position[:count], scale=scale
        )
    place = factor * portable.product(estimate.position, rotation.T) + shift
    turns = Rotation.from_matrix(portable.product(rotation, estimate.rotation))
    quaternion = np.roll(turns.as_quat(), 1, axis=-1)
    motion[:3, :3], motion[:3, 3] = factor * rotation, shift
    return estimate.replace(position=place, quaternion=quaternion), motion
