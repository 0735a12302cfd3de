"""KITTI odometry: rectified pairs, scans and poses of the left camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Len, Predicate
from pydantic import BeforeValidator

from terrain_forge.base import Array, FileName, Progress, Spec, inverse_pose, portable
from terrain_forge.datasets import sizes
from terrain_forge.datasets.clouds import LidarMotion
from terrain_forge.datasets.pictures import (
    picture_losses,
    rectified_pair,
    straight_stream,
    write_picture,
)
from terrain_forge.datasets.poses import Poses
from terrain_forge.datasets.reader import Recording, StereoPair
from terrain_forge.datasets.sizes import Footprint
from terrain_forge.datasets.streams import RecordedLidar
from terrain_forge.datasets.writer import DatasetWriter, Need, one_of

_ROW, _POINT = 245.0, 16.0
"""Bytes of a pose and its time, of a point of a scan."""


def _digits(told: Any) -> Any:
    """A number as two digits; YAML reads those without quotes as one."""
    return f"{told:02d}" if type(told) is int else told


Number = Annotated[str, BeforeValidator(_digits), Len(2, 2), Predicate(str.isdecimal)]


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of KITTI's odometry layout."""

    sequence: Number = "00"
    """Number of the sequence, two digits; readers expect poses up to 10."""
    camera: FileName | None = None
    """The left camera of the pair, by its name or folder; the first pair by default."""
    lidar: FileName | None = None
    """The lidar, by its name or folder; the first one by default, if there is any."""
    scans: bool = True
    """Write scans of the lidar."""


class Kitti(DatasetWriter):
    """Writes sequences/NN and poses/NN.txt."""

    kind: ClassVar[str] = "kitti"
    title: ClassVar[str] = "KITTI odometry"
    Options: ClassVar[type[Spec]] = Options
    needs: ClassVar[tuple[Need, ...]] = ("two cameras", "pictures without distortion")
    naming: ClassVar[tuple[str, ...]] = ("camera", "lidar")

    def check(self, recording: Recording, options: Any) -> None:
        """Refuse a recording without a rectified stereo pair, or without a lidar of that name."""
        rectified_pair(recording, options.camera or "", self.kind)
        if lidar := _lidar(recording, options):
            LidarMotion(recording, lidar)

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """Pictures, colours in grey beside them, poses, and a scan for each picture."""
        for left in sizes.cameras(footprints, name=options.camera):
            each = 2.0 * sizes.picture(left, to_grey=True) + _ROW
            each += 2.0 * sizes.picture(left) if left.colours > 1 else 0.0
            for lidar in sizes.lidars(footprints, name=options.lidar):
                each += _POINT * sizes.points(lidar) if options.scans else 0.0
                break
            return left.count * each
        return 0.0

    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the sequence."""
        pair = rectified_pair(recording, options.camera or "", self.kind)
        place = folder / "sequences" / options.sequence
        place.mkdir(parents=True)
        stamps = pair.left.stamps
        seconds = (stamps - stamps[0]).tolist() if len(stamps) else []
        times = "".join(f"{t // 10**9}.{t % 10**9:09d}\n" for t in seconds)
        (place / "times.txt").write_text(times)
        truth = recording.truth_of(pair.left)
        _write_poses(folder / "poses" / f"{options.sequence}.txt", truth)
        lidar = _lidar(recording, options)
        (place / "calib.txt").write_text(_calibration(pair, lidar))
        coloured = _write_pictures(place, pair, progress)
        losses = [
            "KITTI has no IMU, no odometry, no stamps but seconds from the first picture.",
            "Depth, labels and other truth of pixels are lost.",
        ]
        losses += picture_losses((pair.left, pair.right))
        if coloured:
            losses.append("image_0 and image_1 are the grey of image_2 and image_3.")
        if lidar is not None:
            poses = truth.carrying(_camera_from_lidar(pair, lidar))
            losses += _write_scans(place / "velodyne", LidarMotion(recording, lidar), lidar, poses)
            if recording.link_of(lidar.key) != recording.link_of(pair.left.key):
                losses.append(
                    f"{lidar.name} moves against {pair.left.name}: scans are as it would see them "
                    "if it stood to the camera as at rest, which is what Tr says."
                )
        return tuple(losses)


def _lidar(recording: Recording, options: Options) -> RecordedLidar | None:
    """The lidar whose scans are written, if any."""
    measured = any(lidar.span for lidar in recording.lidars)
    if not options.scans or not (options.lidar or measured):
        return None
    return one_of(recording.lidars, options.lidar or "", "lidar", "kitti")


def _write_poses(path: Path, truth: Poses) -> None:
    """The left camera's poses in the frame of its first."""
    path.parent.mkdir(parents=True)
    poses = portable.product(inverse_pose(truth.matrices[0]), truth.matrices)
    rows = poses[:, :3].reshape(len(poses), 12).tolist()
    path.write_text("".join(" ".join(f"{v:.12e}" for v in row) + "\n" for row in rows))


def _calibration(pair: StereoPair, lidar: RecordedLidar | None) -> str:
    """P0 to P3, and Tr from the lidar's frame to the left camera's."""
    left = np.hstack([pair.left.matrix, np.zeros((3, 1))])
    right = left.copy()
    right[0, 3] = -left[0, 0] * pair.baseline
    rows = {"P0": left, "P1": right, "P2": left, "P3": right}
    if lidar is not None:
        rows["Tr"] = _camera_from_lidar(pair, lidar)[:3]
    return "".join(
        f"{name}: " + " ".join(f"{v:.12e}" for v in values.ravel().tolist()) + "\n"
        for name, values in rows.items()
    )


def _camera_from_lidar(pair: StereoPair, lidar: RecordedLidar) -> Array:
    return portable.product(inverse_pose(pair.left.body_pose), lidar.body_pose)


def _write_pictures(place: Path, pair: StereoPair, progress: Progress) -> bool:
    """Grey pictures as image_0 and image_1; if there are colours, these as image_2 and image_3."""
    coloured, count = False, len(pair.left.stamps)
    for number in range(count):
        progress("writing kitti", number / count)
        for side, camera in enumerate((pair.left, pair.right)):
            stream, name = straight_stream(camera), f"{number:06d}.png"
            for folder, to_grey in ((f"image_{side}", True), (f"image_{side + 2}", False)):
                (place / folder).mkdir(exist_ok=True)
                path = place / folder / name
                coloured = write_picture(path, camera, number, stream, to_grey=to_grey)
                if not coloured:
                    break
    return coloured


def _write_scans(
    folder: Path, motion: LidarMotion, lidar: RecordedLidar, poses: Poses
) -> list[str]:
    """For each picture the nearest sweep, its points where the lidar sees them at that time.

    `poses` are those of the lidar at the pictures' times, by the left camera's and Tr.
    """
    folder.mkdir()
    begins = lidar.stamps
    whole = [n for n, t in enumerate(begins.tolist()) if motion.covers(t)]
    missing = 0
    for number, stamp in enumerate(poses.stamps.tolist()):
        path = folder / f"{number:06d}.bin"
        if not whole:
            missing += 1
            path.write_bytes(b"")
            continue
        nearest = whole[int(np.argmin(np.abs(begins[whole] + motion.length // 2 - stamp)))]
        points = lidar.sweep(nearest)
        seen = motion.seen_from(points, int(begins[nearest]), poses.matrices[number])
        rows = np.hstack([seen, points["intensity"][:, None].astype(np.float64) / 100.0])
        path.write_bytes(rows.astype("<f4").tobytes())
    losses = [
        "Each scan is the sweep nearest to its picture, moved by the true motion to the picture's "
        "time as KITTI's are: rings, times of points and the sweeps' own rate are lost.",
    ]
    if missing:
        losses.append(f"{missing} scans are empty: the truth does not reach as far as a sweep.")
    return losses
