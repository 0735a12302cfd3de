"""Figures of a recording: of its pictures, of what both eyes see, of its sweeps and its IMU."""

from __future__ import annotations

from dataclasses import dataclass, fields
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, ExportError, matrix_from_quaternion
from terrain_forge.datasets import (
    LidarMotion,
    RecordedCamera,
    RecordedLidar,
    RecordedSeries,
    Recording,
    StereoPair,
    on_rover,
)
from terrain_forge.report.recorded.film import intensities, some_of
from terrain_forge.sensors import ImageStatistics, image_statistics

Stamps = NDArray[np.int64]
_PICTURES, _PAIRS, _SWEEPS = 8, 4, 60
"""How many of each the figures are of, at most."""
_LEAST_ROWS = 64
_DISPARITIES = 128
_WRONG_PX, _FULL = 1.0, 99.5
_LEAST_SAMPLES, _MOST_SAMPLES, _UNEVEN_NS = 64, 2**20, 2.0


def picture_statistics(recording: Recording, camera: RecordedCamera) -> ImageStatistics:
    """Means over some pictures, of the rows between the sky and the rover."""
    names = {name: int(number) for number, name in recording.about["classes"].items()}
    found = []
    for number in some_of(len(camera.stamps), _PICTURES):
        pixels = intensities(recording, camera, number)
        labels = camera.image(number, "class") if "class" in camera.channels else None
        rows = _ground_rows(labels, names, len(pixels))
        found.append(image_statistics(pixels[rows]))
    return ImageStatistics(
        **{
            f.name: float(np.mean([getattr(one, f.name) for one in found]))
            for f in fields(found[0])
        }
    )


def _ground_rows(labels: NDArray[Any] | None, names: dict[str, int], height: int) -> slice:
    """The rows below the last of sky and far ground and above the rover; or the lower half."""
    half = slice(height // 2, height)
    if labels is None:
        return half
    far = np.isin(labels, [names.get("sky", -1), names.get("beyond", -1)]).any(axis=1)
    rover = (labels == names.get("rover", -1)).any(axis=1)
    first = int(np.flatnonzero(far)[-1]) + 1 if far.any() else 0
    below = np.flatnonzero(rover[first:])
    last = first + int(below[0]) if below.size else height
    return slice(first, last) if last - first >= _LEAST_ROWS else half


@dataclass(frozen=True)
class Coverage:
    """How much of the ground a pair of eyes sees."""

    share: float
    """Of the left picture's ground that has a disparity."""
    wrong: float | None
    """Of those, how many are a pixel or more off the true one; None where it was not asked."""
    by: str
    """What found the disparities."""


def stereo_coverage(recording: Recording, pair: StereoPair) -> Coverage | None:
    """By OpenCV's semi-global matching where it is installed, else by the truth of what is hidden.

    None where the recording holds neither rectified pictures nor disparities.
    """
    channels = pair.left.channels
    numbers = some_of(len(pair.left.stamps), _PAIRS)
    if pair.rectified and find_spec("cv2"):
        return _matched(recording, pair, numbers)
    if not {"disparity", "occlusion"} <= channels.keys():
        return None
    shares = []
    for number in numbers:
        there = pair.left.image(number, "disparity") > 0
        seen = there & (pair.left.image(number, "occlusion") == 0)
        shares.append(seen.sum() / max(int(there.sum()), 1))
    return Coverage(float(np.mean(shares)), None, "the truth: what neither edge nor rock hides")


def _matched(recording: Recording, pair: StereoPair, numbers: list[int]) -> Coverage:
    import cv2

    most = min(_DISPARITIES, max(16, pair.left.size[0] // 8 // 16 * 16))
    matcher = cv2.StereoSGBM.create(
        minDisparity=0, numDisparities=most, blockSize=5, P1=8 * 25, P2=32 * 25,
        disp12MaxDiff=1, uniquenessRatio=10, speckleWindowSize=100, speckleRange=2,
        preFilterCap=63,
    )  # fmt: skip
    focal, shares, wrong = pair.left.intrinsics[0] * pair.baseline, [], []
    for number in numbers:
        seen_by = [
            np.atleast_3d(intensities(recording, one, number)).mean(axis=2)
            for one in (pair.left, pair.right)
        ]
        full = max(float(np.percentile(seen_by[0], _FULL)), 1e-6)  # the same for both eyes
        eyes = ((255 * np.minimum(one / full, 1.0)).astype(np.uint8) for one in seen_by)
        found = matcher.compute(*eyes) / 16.0
        ground = np.ones(found.shape, bool)
        ground[:, :most] = False  # the right eye does not see all of it
        if "depth" in pair.left.channels:
            depth = pair.left.depth(number)
            ground &= (depth > 0.0) & (focal < depth * most)
            seen = ground & (found > 0.0)
            off = np.abs(found - focal / np.where(depth > 0.0, depth, 1.0)) >= _WRONG_PX
            wrong.append((off & seen).sum() / max(int(seen.sum()), 1))
        shares.append((ground & (found > 0.0)).sum() / max(int(ground.sum()), 1))
    by = f"OpenCV's semi-global matching, {most} disparities"
    return Coverage(float(np.mean(shares)), float(np.mean(wrong)) if wrong else None, by)


@dataclass(frozen=True, eq=False)
class RingCounts:
    """Points of a lidar's sweeps by ring, each the mean of some sweeps."""

    ground: Array
    """On ground and rocks."""
    rover: Array
    """On the rover itself."""


def ring_counts(lidar: RecordedLidar) -> RingCounts:
    """Returns of each ring."""
    numbers = some_of(len(lidar.stamps), _SWEEPS)
    found = []
    for number in numbers:
        points = lidar.sweep(number)
        own = on_rover(points, lidar)
        found.append([np.bincount(points["ring"][which]) for which in (~own, own)])
    told = int(lidar.about.get("rings", 0))
    rings = max(told, *(len(counts) for pair in found for counts in pair))
    total = np.zeros((2, rings))
    for pair in found:
        for row, counts in zip(total, pair, strict=True):
            row[: len(counts)] += counts / len(numbers)
    return RingCounts(ground=total[0], rover=total[1])


@dataclass(frozen=True, eq=False)
class WorldSweep:
    """A sweep where its points are in the world."""

    points: Array
    """Each by the true pose at its own time [m], shape [points, 3]."""
    ring: NDArray[np.int64]
    """Which beam each is of, shape [points]."""
    lidar: Array
    """Where the lidar was at the first firing [m], shape [3]."""
    rings: int
    """How many beams there are."""


def first_sweep(recording: Recording) -> WorldSweep | None:
    """The first lidar's first sweep with points, without those on the rover.

    None without one, and where the lidar moves against the body, whose truth then does not tell.
    """
    for lidar in recording.lidars[:1]:
        try:
            motion = LidarMotion(recording, lidar)
        except ExportError:
            return None
        for number, stamp in enumerate(lidar.stamps.tolist()):
            points = lidar.sweep(number)
            points = points[~on_rover(points, lidar)]
            if len(points) and motion.covers(stamp):
                return WorldSweep(
                    points=motion.in_world(points, stamp),
                    ring=points["ring"].astype(np.int64),
                    lidar=motion.at(np.array([stamp])).position[0],
                    rings=int(points["ring"].max()) + 1,
                )
    return None


@dataclass(frozen=True, eq=False)
class ImuErrors:
    """What an IMU told and by how much that is off the truth."""

    times: Array
    """After its first sample [s], shape [samples]."""
    told: Array
    """Rates [rad/s] and specific forces [m/s²], shape [samples, 6]."""
    errors: Array | None
    """Off the motion's own, of the longest part without a gap but its first and last two samples,
    shape [n, 6]; None where the truth has other stamps."""
    rate: float
    """Samples per second [Hz]."""


def imu_errors(recording: Recording, imu: RecordedSeries) -> ImuErrors | None:
    """Compare with the truth's derivatives, by differences of the fourth order.

    None for a table that is not EuRoC's, of three rates and three specific forces.
    """
    stamps, told = _first_rows(imu)
    if [name[:6] for name in imu.columns[:6]] != ["w_RS_S"] * 3 + ["a_RS_S"] * 3:
        return None
    times, errors = 1e-9 * (stamps - stamps[0]), None
    truth, values = _first_rows(recording.truth, until=int(stamps[-1]))
    place = np.minimum(np.searchsorted(truth, stamps), len(truth) - 1)
    if recording.body_name == imu.key and np.array_equal(truth[place], stamps):
        run = _longest_run(stamps, imu.rate)
        errors = _off_truth(told[run, :6], values[place[run]], imu.rate, recording.gravity)
    return ImuErrors(times, told[:, :6], errors, imu.rate)


def _first_rows(series: RecordedSeries, until: int = 2**62) -> tuple[Stamps, Array]:
    """Stamps and columns up to a time, of at most so many samples, however long a table is."""
    kept, count = list[tuple[Stamps, Array]](), 0
    for stamps, values in series.blocks():
        kept.append((stamps, values))
        count += len(stamps)
        if count >= _MOST_SAMPLES or stamps[-1] >= until:
            break
    if not kept:
        raise DataError(f"{series.key}/data.csv has no rows")
    columns, rows = zip(*kept, strict=True)
    return np.concatenate(columns), np.concatenate(rows)


def _off_truth(told: Array, truth: Array, rate: float, gravity: float) -> Array | None:
    """Of even samples all but the first and the last two; None of too few for a deviation."""
    if len(told) < _LEAST_SAMPLES:
        return None
    turns, speeds = _continuous(truth[:, 3:7]), truth[:, 7:10]
    rates = 2.0 * _vector_of(_conjugate(turns[2:-2]), _slope(turns, 1.0 / rate))
    pull = _slope(speeds, 1.0 / rate) + np.array([0.0, 0.0, gravity])
    forces = np.einsum("nji,nj->ni", matrix_from_quaternion(turns[2:-2]), pull)
    return np.asarray(told[2:-2] - np.hstack([rates, forces]))


def _longest_run(stamps: Stamps, rate: float) -> slice:
    """The longest part without a gap, as parts of a recording leave them."""
    gaps = np.flatnonzero(np.abs(np.diff(stamps) - 1e9 / rate) > _UNEVEN_NS) + 1
    ends = np.concatenate([[0], gaps, [len(stamps)]])
    first = int(np.argmax(np.diff(ends)))
    return slice(int(ends[first]), int(ends[first + 1]))


def _slope(values: Array, step: float) -> Array:
    near, far = values[3:-1] - values[1:-3], values[4:] - values[:-4]
    return np.asarray((8.0 * near - far) / (12.0 * step))


def _continuous(turns: Array) -> Array:
    """Quaternions whose signs do not jump."""
    flips = np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(turns * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


def _conjugate(turns: Array) -> Array:
    return np.asarray(turns * np.array([1.0, -1.0, -1.0, -1.0]))


def _vector_of(one: Array, other: Array) -> Array:
    """The vector part of the product of quaternions (w, x, y, z), shape [n, 3]."""
    w, v, s, u = one[:, :1], one[:, 1:], other[:, :1], other[:, 1:]
    return np.asarray(w * u + s * v + np.cross(v, u))
