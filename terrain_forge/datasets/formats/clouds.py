"""Point clouds: sweeps as files, or all of them as one map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from terrain_forge.base import ExportError, FileName, Progress, RecipeError, Spec
from terrain_forge.datasets import sizes
from terrain_forge.datasets.clouds import LidarMotion, on_rover, places
from terrain_forge.datasets.point_files import (
    BRIGHTER,
    INTENSITY,
    Encoding,
    PointFile,
    point_size,
    points_of,
)
from terrain_forge.datasets.poses import tum_text
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.sizes import Footprint
from terrain_forge.datasets.streams import RecordedLidar
from terrain_forge.datasets.writer import DatasetWriter, Need, needed, one_of

_HEAD = "# timestamp tx ty tz qx qy qz qw, of the lidar in the world at each sweep's first firing\n"


_HEADING = 300.0
"""Bytes of a cloud before its points."""


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of point clouds."""

    encoding: Encoding = "ply"
    """`ply` and `pcd`, both binary; `laz`, in steps of 0.1 mm; `bin`, as KITTI's: place and
    intensity alone."""
    map: bool = False
    """Write all sweeps as one map in the world's frame, without points on the rover, instead of a
    file for each."""
    deskew: bool = False
    """Move the points of each sweep to where the lidar sees them at its first firing, by the true
    motion; a map is always made so."""
    lidar: FileName | None = None
    """The lidar, by its name or folder; all by default."""

    def __post_init__(self) -> None:
        if self.map and self.deskew:
            raise RecipeError("has no effect: a map is always deskewed", key=("deskew",))


class Clouds(DatasetWriter):
    """Writes LIDAR/STAMP.ply or .pcd, .laz, .bin with LIDAR.tum; or LIDAR.ply, the map."""

    kind: ClassVar[str] = "clouds"
    title: ClassVar[str] = "point clouds"
    Options: ClassVar[type[Spec]] = Options
    needs: ClassVar[tuple[Need, ...]] = ("a lidar",)
    naming: ClassVar[tuple[str, ...]] = ("lidar",)

    def check(self, recording: Recording, options: Any) -> None:
        """Refuse a recording without a lidar, and LAZ without its library."""
        found = one_of(recording.lidars, options.lidar or "", "lidar", self.kind)
        for lidar in (found,) if options.lidar else recording.lidars:
            if options.map or options.deskew:
                LidarMotion(recording, lidar)
        if options.encoding == "laz":
            needed("laspy", "LAZ")
            needed("lazrs", "LAZ")

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """Points of the lidars, and of sweeps their poses."""
        point = point_size(options.encoding, wide=options.map)
        pose = 0.0 if options.map else sizes.POSE + _HEADING
        found = sizes.lidars(footprints, name=options.lidar)
        return sum(one.count * (point * sizes.points(one) + pose) for one in found)

    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the clouds."""
        wanted = recording.lidars
        if options.lidar:
            wanted = (one_of(wanted, options.lidar, "lidar", self.kind),)
        losses = ["Pictures, IMU and odometry are lost."]
        for lidar in wanted:
            write = _write_map if options.map else _write_sweeps
            left_out = write(recording, lidar, folder, options, progress)
            if left_out:
                losses.append(
                    f"Sweeps of {lidar.name} that outlast the truth are left out: {left_out}."
                )
        if options.encoding == "bin":
            losses.append("Rings, times and instances of points are lost.")
        if options.encoding == "laz":
            losses.append(
                f"LAZ's own intensity is {BRIGHTER} times ours, rounded, ours up to "
                f"{(2**16 - 1) / BRIGHTER:g}; the further dimension {INTENSITY} has it as it is."
            )
        return tuple(losses)


def _write_map(
    recording: Recording, lidar: RecordedLidar, folder: Path, options: Options, progress: Progress
) -> int:
    motion = LidarMotion(recording, lidar)
    numbers = [n for n, stamp in enumerate(lidar.stamps.tolist()) if motion.covers(stamp)]
    if not numbers:
        raise ExportError(f"clouds: the truth covers no sweep of {lidar.name}")
    path, crs = folder / f"{lidar.key}.{options.encoding}", recording.crs
    with PointFile(path, options.encoding, wide=True, crs=crs) as file:
        for done, number in enumerate(numbers):
            progress("writing clouds", done / len(numbers))
            begin, sweep = int(lidar.stamps[number]), lidar.sweep(number)
            sweep = sweep[~on_rover(sweep, lidar)]
            file.add(points_of(sweep, motion.in_world(sweep, begin), begin * 1e-9))
    return len(lidar.stamps) - len(numbers)


def _write_sweeps(
    recording: Recording, lidar: RecordedLidar, folder: Path, options: Options, progress: Progress
) -> int:
    place = folder / lidar.key
    place.mkdir()
    numbers = list(range(len(lidar.stamps)))
    if options.deskew:
        motion = LidarMotion(recording, lidar)
        numbers = [n for n in numbers if motion.covers(int(lidar.stamps[n]))]
    truth = recording.truth_of(lidar)
    truth = truth[np.isin(truth.stamps, lidar.stamps[numbers])]
    (folder / f"{lidar.key}.tum").write_text(_HEAD + tum_text(truth))
    for done, number in enumerate(numbers):
        progress("writing clouds", done / len(numbers))
        begin, sweep = int(lidar.stamps[number]), lidar.sweep(number)
        at = places(sweep)
        if options.deskew:
            at = motion.seen_from(sweep, begin, motion.at(lidar.stamps[[number]]).matrices[0])
        with PointFile(place / f"{begin}.{options.encoding}", options.encoding, wide=False) as file:
            file.add(points_of(sweep, at, 0.0))
    return len(lidar.stamps) - len(numbers)
