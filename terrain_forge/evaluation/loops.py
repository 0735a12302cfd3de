"""Loop closures: which a system found, which of these are right, and which there were to find."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import MAX_STATE, Array, DataError, Record, portable, read_text, shaped
from terrain_forge.evaluation.poses import TimedPoses, read_rows
from terrain_forge.evaluation.score import ScoreOptions

In = Literal["seconds", "frames"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Loops(Record):
    """Loop closures that a system told."""

    time: Array = field(metadata=shaped("loops", 2))
    """Times of both ends [s], shape [loops, 2]."""
    motion: Array = field(metadata=shaped("loops", 3))
    """Where the second end lies in the frame of the first [m], shape [loops, 3]."""
    told: NDArray[np.bool_] = field(metadata=shaped("loops", dtype=np.bool_))
    """Which tell that motion; of others it is 0, shape [loops]."""


@dataclass(frozen=True, kw_only=True)
class LoopScore:
    """How good a system's loop closures are."""

    found: int
    """How many it told."""
    right: int
    """How many join places that are near each other, and say rightly how they lie."""
    revisits: int
    """Stretches of the path that come near an earlier part of it."""
    closed: int
    """How many of these have a right loop closure."""

    @property
    def told(self) -> str:
        """As tables tell it."""
        return f"{self.right} of {self.found}, {self.closed} of {self.revisits} revisits"


def read_loops(path: Path | str) -> Loops:
    """Read loop closures: two times [s] a line, and perhaps x, y, z [m] of the second in the first.

    More that follows, such as a rotation, is passed over.

    Raises:
        DataError: naming file and line.
    """
    path = Path(path)
    if not read_text(path, str(path), most=MAX_STATE).strip():
        return made_loops(np.zeros((0, 5)))
    values, places = read_rows(path, 2, longer=True, least=0, most=5)
    for row, place in zip(values, places, strict=True):
        if not np.isfinite(row[:2]).all():
            raise DataError(f"{place}: a time is not a finite number")
    return made_loops(values)


def made_loops(rows: Array) -> Loops:
    """Loop closures of rows of two times, and x, y, z or NaN where that is not told."""
    told = np.asarray(np.isfinite(rows[:, 2:5]).all(axis=1))
    motion = np.where(told[:, None], rows[:, 2:5], 0.0)
    return Loops(time=rows[:, :2], motion=motion, told=told)


def score_loops(truth: TimedPoses, loops: Loops, options: ScoreOptions | None = None) -> LoopScore:
    """Compare loop closures with the truth of the same frame.

    One is right whose ends were truly within `loop_m` of each other, with at least `loop_apart_m`
    of path between them, and whose motion, where it was told, is within `loop_m` / 4 of the true
    one. A revisit is a stretch of the path within `loop_m` of an earlier part, as far apart.

    Args:
        truth: The truth.
        loops: What the system told.
        options: What is free in it.
    """
    options = options or ScoreOptions()
    order = np.sort(loops.time, axis=1)
    within = (order[:, 0] >= truth.time[0]) & (order[:, 1] <= truth.time[-1])
    swapped = loops.time[:, 0] > loops.time[:, 1]
    begins, ends = truth.at(order[:, 0]), truth.at(order[:, 1])
    stations = truth.stations
    passed = [np.interp(order[:, n], truth.time, stations) for n in (0, 1)]
    away = portable.norm(ends.position - begins.position)
    good = within & (away <= options.loop_m) & (passed[1] - passed[0] >= options.loop_apart_m)
    good &= _motions_fit(begins, ends, loops, swapped, 0.25 * options.loop_m)
    revisits = _revisits(truth, stations, options)
    closed = sum(bool(((passed[1][good] >= b) & (passed[1][good] <= e)).any()) for b, e in revisits)
    return LoopScore(found=len(order), right=int(good.sum()), revisits=len(revisits), closed=closed)


def _motions_fit(
    begins: TimedPoses,
    ends: TimedPoses,
    loops: Loops,
    swapped: NDArray[np.bool_],
    most: float,
) -> NDArray[np.bool_]:
    """Whether motions that were told are the true ones; those that were not told are no fault."""
    step = np.where(swapped[:, None], -1.0, 1.0) * (ends.position - begins.position)
    turn = np.where(swapped[:, None, None], ends.rotation, begins.rotation)
    true = (np.swapaxes(turn, -1, -2) * step[:, None, :]).sum(axis=-1)
    off = portable.norm(np.where(loops.told[:, None], loops.motion - true, 0.0))
    return np.asarray(off <= most)


def _revisits(
    truth: TimedPoses, stations: Array, options: ScoreOptions
) -> list[tuple[float, float]]:
    """Where stretches begin and end that are near an earlier part of the path, by path length."""
    from scipy.spatial import KDTree

    step = 0.25 * min(options.loop_m, options.loop_apart_m)
    moves = np.concatenate([[True], np.diff(stations) > 0.0])
    wanted = np.arange(0.0, stations[-1] + 1e-9, step)
    time = np.interp(wanted, stations[moves], truth.time[moves])
    place = np.stack([np.interp(time, truth.time, x) for x in truth.position.T], axis=-1)
    near = KDTree(place).query_pairs(options.loop_m, output_type="ndarray")
    low, high = near.min(axis=1), near.max(axis=1)
    late = np.unique(high[wanted[high] - wanted[low] >= options.loop_apart_m])
    if not len(late):
        return []
    pieces = np.split(late, np.flatnonzero(np.diff(late) > 1) + 1)
    slack = step + options.loop_m
    return [(wanted[one[0]] - slack, wanted[one[-1]] + slack) for one in pieces]
