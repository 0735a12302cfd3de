"""Figures of an estimated trajectory against the truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    NotNegative,
    Positive,
    Record,
    Spec,
    checked,
    portable,
)
from terrain_forge.evaluation.alignment import (
    SAME_TIME,
    Association,
    By,
    Part,
    aligned,
    associate,
)
from terrain_forge.evaluation.poses import TimedPoses

KITTI_LENGTHS = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
"""Lengths of the KITTI odometry benchmark [m] (doi:10.1109/CVPR.2012.6248074)."""
MAX_STATIONS = 10_000_000
"""Stations of a path at most."""
_TOLERANCE = 0.1
"""Part of a piece's length by which evo lets it be longer or shorter."""
_SPARSE = 3.0
"""Usual times from one true pose to the next that make a gap of the truth."""


@dataclass(frozen=True, kw_only=True)
class ScoreOptions(Spec):
    """What an evaluation is free in; the defaults are those of Giubilato et al. 2020."""

    align: Part = "first_third"
    """Poses that the rigid alignment looks at (Horn 1987): those of the first third, all, only the
    first pose, or none."""
    third_by: By = "length"
    """What the first third is counted by: poses, time, or the truth's path length."""
    scale: bool = False
    """Whether the alignment finds a scale too, as for one camera."""
    association: Association = "nearest"
    """How poses are paired: `nearest` in time, or with the truth `interpolated`."""
    most_apart_s: Positive = 0.01
    """Largest difference of times that are nearest [s]."""
    drift_over_m: Positive = 10.0
    """Path length that drift is told for [m]."""
    stations_m: NotNegative = 0.5
    """Distance along the true path at which drift looks at poses [m]; 0: at all poses, as the paper
    may have. A jittering estimate's path grows with the rate of its poses, not with its error."""
    gap_s: Annotated[float, Interval(ge=0.001, le=1000)] = 1.0
    """The system was lost where its poses are farther apart than this [s]; a piece of the path with
    such a gap is not scored, nor are poses in one of the truth that is interpolated."""
    loop_m: Positive = 2.0
    """How near each other the ends of a loop closure must truly be [m]."""
    loop_apart_m: Positive = 10.0
    """Length of the path that must lie between them [m]."""


@dataclass(frozen=True, kw_only=True)
class Spread(Record):
    """Some errors as one."""

    rms: float
    """Root of the mean square."""
    median: float
    """Half of them are below."""
    mean: float
    """Their mean."""
    most: float
    """The largest."""
    count: int
    """How many."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Score(Record):
    """How well a system localised; arrays belong to the poses that were paired."""

    name: str
    """The estimate's."""
    options: tuple[tuple[str, float | str | bool], ...]
    """How it was evaluated, by the names of `ScoreOptions`."""
    poses: int
    """Poses that were paired with the truth."""
    tracked: float
    """Part of the truth's duration, its own gaps left out, in which the system told poses without a
    gap, 0 to 1."""
    length: float
    """Length of the true path where there are paired poses [m]."""
    scale: float
    """Scale that the alignment applied."""
    alignment: Array = field(metadata={"dtype": np.float64, "shape": (4, 4)})
    """From the estimate's frame to the truth's, its scale inside, shape [4, 4]."""
    ate: Spread
    """Absolute trajectory error, distances after the alignment [m]."""
    drift: Spread | None
    """Relative error of the path's length, |l - l*| / l*, over the option's length [1]; None where
    no such piece was followed without a gap."""
    rpe: Spread | None
    """Relative pose error over the same length: distance [m] between where the estimate's own
    motion leads and the truth."""
    rpe_angle: Spread | None
    """Its angle [rad]."""
    yaw_drift: Spread | None
    """Change of the heading's error over the same length [rad]."""
    kitti: tuple[float, float] | None
    """Translation [1] and rotation [rad/m] of the KITTI benchmark, from 100 m on; else None."""
    time: Array = field(metadata={"dtype": np.float64, "shape": ("poses",)})
    """Times of the pairs [s], shape [poses]."""
    station: Array = field(metadata={"dtype": np.float64, "shape": ("poses",)})
    """Length of the true path up to them [m], shape [poses]."""
    errors: Array = field(metadata={"dtype": np.float64, "shape": ("poses",)})
    """Distance to the truth after the alignment [m], shape [poses]."""
    aligned: Array = field(metadata={"dtype": np.float64, "shape": ("poses", 3)})
    """The estimate's places in the truth's frame [m], shape [poses, 3]."""

    @property
    def note(self) -> str:
        """Why figures are missing; empty where none are."""
        if self.drift is not None:
            return ""
        options = dict(self.options)
        over, gap = float(options["drift_over_m"]), float(options["gap_s"])
        if self.length < over:
            why = f"the path of {self.length:.3g} m is shorter than drift_over_m, {over:g} m"
        else:
            why = f"no {over:g} m of the path are without a gap longer than gap_s, {gap:g} s"
        return f"no TDr: {why}"


def spread(errors: Array) -> Spread | None:
    """The figures of some errors; None where there are none."""
    if not len(errors):
        return None
    return Spread(
        rms=float(np.sqrt((errors**2).mean())),
        median=float(np.median(errors)),
        mean=float(errors.mean()),
        most=float(errors.max()),
        count=len(errors),
    )


@checked
def score_poses(
    truth: TimedPoses, estimate: TimedPoses, options: ScoreOptions | None = None
) -> Score:
    """Compare an estimated trajectory with the truth of the same frame.

    Args:
        truth: The truth.
        estimate: What the system told.
        options: What is free in it.

    Raises:
        DataError: if the two have less than three poses at the same times.
    """
    options = options or ScoreOptions()
    true, told = associate(
        truth,
        estimate,
        association=options.association,
        most=options.most_apart_s,
        gap=options.gap_s,
    )
    laid, motion = aligned(true, told, part=options.align, by=options.third_by, scale=options.scale)
    errors = portable.norm(laid.position - true.position)
    ate = spread(errors)
    assert ate is not None
    usual_step = float(np.median(np.diff(truth.time)))
    lacking = max(options.gap_s, _SPARSE * usual_step)
    gaps = _gaps(true.time, truth.time, lacking)
    gaps += _gaps(laid.time, estimate.time, options.gap_s)
    lengths, pairs = _segments(
        true, laid, gaps, over=options.drift_over_m, apart=options.stations_m
    )
    away, angle = relative_errors(true, laid, pairs)
    kitti = _kitti(true, laid, gaps)
    return Score(
        name=estimate.name,
        options=tuple(vars(options).items()),
        poses=len(true.time),
        tracked=_tracked(truth, estimate, options.gap_s, lacking),
        length=float(true.stations[-1]),
        scale=float(portable.norm(motion[:3, 0])) if options.scale else 1.0,
        alignment=motion,
        ate=ate,
        drift=spread(lengths),
        rpe=spread(away),
        rpe_angle=spread(angle),
        yaw_drift=spread(_yaw_drift(true, laid, pairs)),
        kitti=kitti,
        time=true.time,
        station=true.stations,
        errors=errors,
        aligned=laid.position,
    )


def _tracked(truth: TimedPoses, estimate: TimedPoses, gap: float, lacking: float) -> float:
    """Part of the time in which there is truth that has poses no farther apart than a gap [s].

    There is none between two true poses that are farther apart than `lacking` [s].
    """
    ends = np.flatnonzero(np.diff(truth.time) > lacking + SAME_TIME)
    begins, lasts = truth.time[np.r_[0, ends + 1]], truth.time[np.r_[ends, -1]]
    piece = np.searchsorted(begins, estimate.time, side="right") - 1
    within = (piece >= 0) & (estimate.time <= lasts[piece])
    steps, moves = np.diff(estimate.time[within]), np.diff(piece[within])
    followed = steps[(steps <= gap + SAME_TIME) & (moves == 0)]
    return min(float(followed.sum()) / float((lasts - begins).sum()), 1.0)


def _gaps(time: Array, of: Array, gap: float) -> NDArray[np.intp]:
    """How many gaps between some times that are longer than one [s] lie before each of others."""
    ends = of[1:][np.diff(of) > gap + SAME_TIME]
    return np.searchsorted(ends, time, side="right")


def _segments(
    truth: TimedPoses, estimate: TimedPoses, gaps: NDArray[np.intp], *, over: float, apart: float
) -> tuple[Array, Array]:
    """Relative errors of the length of pieces of the path, and the poses where they begin and end.

    A piece begins at each station, or pose, and ends at the first that is as far on by the true
    path; stations are taken a little closer where the length is no multiple of their distance. One
    with a gap in it was not followed and is left out: the line across would be without error. Of
    all poses, the pieces between which motions are compared are evo's.
    """
    whole = truth.stations
    true_at, told_at, rows = whole, estimate.stations, np.arange(len(whole))
    before = rows
    if apart:
        apart = over / np.ceil(over / apart - 1e-9)
        if whole[-1] / apart > MAX_STATIONS:
            raise DataError(
                f"drift_over_m {over:g} with stations each {apart:g} m on a path of "
                f"{whole[-1]:g} m: at most {MAX_STATIONS:,} stations"
            )
        wanted = np.arange(0.0, whole[-1] + 1e-9, apart)
        moves = np.concatenate([[True], np.diff(whole) > 0.0])  # one time for each station
        time = np.interp(wanted, whole[moves], truth.time[moves])
        true_at = _lengths(truth, time)
        told_at = _lengths(estimate, time)
        rows = np.clip(np.searchsorted(truth.time, time), 0, len(whole) - 1)
        before = np.clip(np.searchsorted(truth.time, time, side="right") - 1, 0, len(whole) - 1)
    ends = np.searchsorted(true_at, true_at + over * (1.0 - 1e-12))
    if apart:  # along the path, not along the lines between stations, which are shorter
        ends = np.arange(len(true_at)) + round(over / apart)
    begins = np.flatnonzero(ends < len(true_at))
    begins = begins[gaps[before[begins]] == gaps[rows[ends[begins]]]]
    ends = ends[begins]
    true = true_at[ends] - true_at[begins]
    told = told_at[ends] - told_at[begins]
    lengths = np.abs(told - true) / true
    if not apart:
        begins, ends = _evo_pairs(whole, over)
        followed = gaps[begins] == gaps[ends]
        begins, ends = begins[followed], ends[followed]
    return lengths, np.stack([rows[begins], rows[ends]], axis=-1)


def _evo_pairs(stations: Array, over: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The poses nearest to so far on as each [m], within a tenth of it: evo's `all_pairs`."""
    begins = np.arange(len(stations) - 1)
    behind = np.searchsorted(stations, stations[:-1] + over)
    near = np.clip([behind - 1, behind], begins + 1, len(stations) - 1)
    off = np.abs(stations[near] - stations[begins] - over)
    nearest = near[off.argmin(axis=0), begins]
    first = np.searchsorted(stations, stations[nearest])  # of those that stand still
    kept = off.min(axis=0) <= _TOLERANCE * over
    return begins[kept], np.maximum(first, begins + 1)[kept]


def _lengths(poses: TimedPoses, time: Array) -> Array:
    place = np.stack([np.interp(time, poses.time, x) for x in poses.position.T], axis=-1)
    return np.concatenate([[0.0], np.cumsum(portable.norm(np.diff(place, axis=0)))])


def relative_errors(truth: TimedPoses, estimate: TimedPoses, pairs: Array) -> tuple[Array, Array]:
    """Distances [m] and angles [rad] between the motions of truth and estimate over some pairs.

    As evo's relative pose error: of inv(P*_i⁻¹ P*_j) (P_i⁻¹ P_j).
    """
    first, last = pairs[:, 0], pairs[:, 1]
    motions = []
    for poses in (truth, estimate):
        turn = poses.rotation
        back = np.swapaxes(turn[first], -1, -2)
        step = (back * (poses.position[last] - poses.position[first])[:, None, :]).sum(axis=-1)
        motions.append((portable.product(back, turn[last]), step))
    (true_turn, true_step), (told_turn, told_step) = motions
    away = portable.norm(told_step - true_step)
    between = portable.product(np.swapaxes(true_turn, -1, -2), told_turn)
    return away, _angles(between)


def _angles(turns: Array) -> Array:
    """Angles of rotation matrices [rad], exact near 0 and π."""
    sine = portable.norm(
        np.stack(
            [
                turns[:, 2, 1] - turns[:, 1, 2],
                turns[:, 0, 2] - turns[:, 2, 0],
                turns[:, 1, 0] - turns[:, 0, 1],
            ],
            axis=-1,
        )
    )
    return np.asarray(portable.arctan2(sine, np.trace(turns, axis1=1, axis2=2) - 1.0))


def _yaw_drift(truth: TimedPoses, estimate: TimedPoses, pairs: Array) -> Array:
    """How far the error of the heading about the world's z axis changes over each pair [rad]."""
    between = portable.product(estimate.rotation, np.swapaxes(truth.rotation, -1, -2))
    error = np.unwrap(portable.arctan2(between[:, 1, 0] - between[:, 0, 1],
                                       between[:, 0, 0] + between[:, 1, 1]))  # fmt: skip
    return np.asarray(np.abs(error[pairs[:, 1]] - error[pairs[:, 0]]))


def _kitti(
    truth: TimedPoses, estimate: TimedPoses, gaps: NDArray[np.intp]
) -> tuple[float, float] | None:
    """Mean relative errors over 100 to 800 m without a gap, from every tenth pose."""
    station = truth.stations
    moves, turns = [], []
    for length in KITTI_LENGTHS:
        begins = np.arange(0, len(station), 10)
        ends = np.searchsorted(station, station[begins] + length, side="right")
        inside = ends < len(station)
        pairs = np.stack([begins[inside], ends[inside]], axis=-1)
        pairs = pairs[gaps[pairs[:, 0]] == gaps[pairs[:, 1]]]
        if not len(pairs):
            continue
        away, angle = relative_errors(truth, estimate, pairs)
        moves.append(away / length)
        turns.append(angle / length)
    if not moves:
        return None
    return float(np.concatenate(moves).mean()), float(np.concatenate(turns).mean())
