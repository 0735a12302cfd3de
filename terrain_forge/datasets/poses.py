"""Poses over time: matrices, quaternions, and where a frame is between two samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    matrix_from_quaternion,
    placed,
    portable,
    quaternion_from_matrix,
    xyzw,
)

Stamps = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Poses:
    """Where a frame is at some times."""

    stamps: Stamps
    """Times [ns], ascending, shape [times]."""
    position: Array
    """Of its origin [m], shape [times, 3]."""
    quaternion: Array
    """Its rotation (w, x, y, z), shape [times, 4]."""

    def __len__(self) -> int:
        return len(self.stamps)

    def __getitem__(self, which: slice | NDArray[np.bool_]) -> Poses:
        return Poses(
            stamps=self.stamps[which],
            position=self.position[which],
            quaternion=self.quaternion[which],
        )

    @cached_property
    def matrices(self) -> Array:
        """From the frame to the one that its place is told in, shape [times, 4, 4]."""
        return placed(self.position, matrix_from_quaternion(self.quaternion))

    def carrying(self, frame: Array) -> Poses:
        """The poses of a frame that is fixed to this one, at a pose of shape [4, 4] in it."""
        moved = portable.product(self.matrices, frame)
        turns = quaternion_from_matrix(moved[:, :3, :3])
        return Poses(stamps=self.stamps, position=moved[:, :3, 3], quaternion=turns)

    @cached_property
    def _runs(self) -> NDArray[np.int64]:
        """Which samples follow each other without a gap: numbers of the runs, shape [times]."""
        steps = np.diff(self.stamps)
        late = 2.5 * np.median(steps) if len(steps) else 0.0
        return np.concatenate([np.zeros(min(len(self), 1), np.int64), np.cumsum(steps > late)])

    def covering(self, first: Stamps, last: Stamps) -> NDArray[np.bool_]:
        """Whether it has samples without a gap from some times to others [ns]."""
        if len(self) < 4:
            return np.zeros(len(first), np.bool_)
        inside = (first >= self.stamps[0]) & (last <= self.stamps[-1])
        before = np.searchsorted(self.stamps, first, side="right") - 1
        after = np.searchsorted(self.stamps, last, side="left")
        one, other = (self._runs[np.clip(at, 0, len(self) - 1)] for at in (before, after))
        return np.asarray(inside & (one == other))

    def covers(self, first: int, last: int) -> bool:
        """Whether it has samples without a gap from one time to another [ns]."""
        return bool(self.covering(np.array([first]), np.array([last]))[0])

    @cached_property
    def beside(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Numbers of the samples before and after each; its own where a gap is."""
        own = np.arange(len(self))
        before, after = np.maximum(own - 1, 0), np.minimum(own + 1, len(self) - 1)
        runs = self._runs
        return (
            np.where(runs[before] == runs, before, own),
            np.where(runs[after] == runs, after, own),
        )

    def at(self, stamps: Stamps) -> Poses:
        """The poses at other times, by the cubic through the four samples around each.

        Raises:
            DataError: for times that it does not cover.
        """
        own, wanted = self.stamps, np.asarray(stamps, np.int64)
        if not self.covering(wanted, wanted).all():
            raise DataError(
                f"poses are needed from {wanted.min()} to {wanted.max()} ns, and the truth does "
                f"not tell all of them: it lasts from {own[0]} to {own[-1]} ns"
            )
        first = np.clip(np.searchsorted(own, wanted, side="right") - 2, 0, len(own) - 4)
        around = first[:, None] + np.arange(4)
        times = (own[around] - wanted[:, None]) * 1e-9
        turns = self.quaternion[around]
        same = (turns * turns[:, :1]).sum(axis=-1, keepdims=True) >= 0.0
        values = np.concatenate([self.position[around], np.where(same, turns, -turns)], axis=-1)
        found = np.zeros((len(wanted), 7))
        for one in range(4):
            weight = np.ones(len(wanted))
            for other in range(4):
                if other != one:
                    weight *= times[:, other] / (times[:, other] - times[:, one])
            found += weight[:, None] * values[:, one]
        turn = found[:, 3:] / portable.norm(found[:, 3:])[:, None]
        return Poses(stamps=wanted, position=found[:, :3], quaternion=turn)


def rates(poses: Poses) -> Array:
    """Angular rates in the frame itself [rad/s], of the poses before and after each."""
    turns, (before, after) = poses.quaternion, poses.beside
    (w1, x1, y1, z1), (w2, x2, y2, z2) = turns[before].T, turns[after].T
    turned = np.stack(  # vector part of the quaternion from one to the other
        [
            w1 * x2 - x1 * w2 - y1 * z2 + z1 * y2,
            w1 * y2 + x1 * z2 - y1 * w2 - z1 * x2,
            w1 * z2 - x1 * y2 + y1 * x2 - z1 * w2,
        ],
        axis=-1,
    )
    sign = np.where((turns[before] * turns[after]).sum(axis=-1) < 0.0, -1.0, 1.0)
    return np.asarray(2.0 * sign[:, None] * turned / _steps(poses, before, after))


def velocities(poses: Poses) -> Array:
    """Velocities [m/s] in the frame that the poses are told in, of the two on each side."""
    before, after = poses.beside
    both = (before, after), (before[before], after[after])
    one, two = ((poses.position[b] - poses.position[a]) / _steps(poses, a, b) for a, b in both)
    inside = both[1][1] - both[1][0] == 4
    return np.where(inside[:, None], (4.0 * one - two) / 3.0, one)  # to the fourth order


def _steps(poses: Poses, before: NDArray[np.int64], after: NDArray[np.int64]) -> Array:
    """Times from some of the poses to others [s], shape [poses, 1]."""
    return np.asarray(np.maximum(poses.stamps[after] - poses.stamps[before], 1)[:, None] * 1e-9)


def tum_text(poses: Poses) -> str:
    """Poses as TUM's trajectories have them: seconds, place, quaternion x, y, z, w."""
    rows = np.hstack([poses.position, xyzw(poses.quaternion)]).tolist()
    return "".join(
        f"{stamp // 10**9}.{stamp % 10**9:09d} " + " ".join(map(repr, row)) + "\n"
        for stamp, row in zip(poses.stamps.tolist(), rows, strict=True)
    )
