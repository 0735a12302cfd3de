"""The layout of LuSNAR, with its five classes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import ExportError, FileName, Positive, Progress, Spec
from terrain_forge.datasets import sizes
from terrain_forge.datasets.clouds import places
from terrain_forge.datasets.pictures import picture_losses, truth_stream, write_depth, write_picture
from terrain_forge.datasets.reader import BASE, TRUTH, Recording, StereoPair
from terrain_forge.datasets.sizes import Footprint
from terrain_forge.datasets.streams import RecordedCamera, RecordedLidar, RecordedSeries
from terrain_forge.datasets.writer import DatasetWriter, Need
from terrain_forge.writers import write_png

REGOLITH, CRATER, ROCK, MOUNTAIN, SKY, NONE = 0, 1, 2, 3, 4, 255
_CLASSES = {
    "ground": REGOLITH, "ripple": REGOLITH, "track": REGOLITH,
    "crater": CRATER, "rock": ROCK, "beyond": MOUNTAIN, "sky": SKY,
}  # fmt: skip
"""Our classes as LuSNAR's; what it has no word for is `NONE`."""
_COLOURS = {REGOLITH: 0xBB469C, CRATER: 0x7800C8, ROCK: 0xE8FA50, MOUNTAIN: 0xAD451F, SKY: 0x22C9F8}


_POINT = 31.0
"""Bytes of a point as text."""


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of LuSNAR's layout."""

    camera: FileName | None = None
    """The left camera of the pair, by its name or folder; the first pair by default that has depth
    and classes."""
    labels: Literal["numbers", "lusnar"] = "numbers"
    """`numbers`: grey pictures of 0 regolith, 1 crater, 2 rock, 3 mountain, 4 sky, 255 none of
    them, and the same of points; `lusnar`: that dataset's colours, and -1 regolith, 174 rock of
    points, without those on the rover."""
    depth_factor: Positive = 1000.0
    """Values of a depth picture in a metre."""


class Lusnar(DatasetWriter):
    """Writes image1, image2, LiDAR, IMU.txt and Rover_pose.txt."""

    kind: ClassVar[str] = "lusnar"
    title: ClassVar[str] = "LuSNAR"
    Options: ClassVar[type[Spec]] = Options
    needs: ClassVar[tuple[Need, ...]] = ("two cameras", "depth", "class")
    naming: ClassVar[tuple[str, ...]] = ("camera",)

    def check(self, recording: Recording, options: Any) -> None:
        """Refuse a recording without a stereo pair that has depth and classes."""
        pair = _pair(recording, options)
        for camera, channel in _lacking(pair):
            raise ExportError(
                f"lusnar needs {channel} of {camera.name}: record with channels: [depth, class]"
            )

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """Pictures, depth and classes of both cameras, sweeps, and two tables as text."""
        found = 0.0
        for one in sizes.cameras(footprints, "depth", "class", name=options.camera):
            each = sizes.picture(one) + sizes.depth(one) + one.sizes["class"]
            found += 2.0 * one.count * each
            break
        for lidar in sizes.lidars(footprints):
            found += lidar.count * _POINT * sizes.points(lidar)
            break
        told = (one for one in sizes.tables(footprints) if one.key in ("imu0", TRUTH))
        return found + sum(one.count * one.sizes["data"] for one in told)

    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the dataset."""
        pair, far = _pair(recording, options), 0
        numbers = _class_numbers(recording)
        for side, camera in enumerate((pair.left, pair.right), 1):
            far += _write_camera(folder / f"image{side}", camera, numbers, options, progress)
        for lidar in recording.lidars[:1]:
            _write_sweeps(folder / "LiDAR", lidar, options)
        _write_table(folder / "Rover_pose.txt", recording.truth)
        for imu in recording.imus[:1]:
            _write_table(folder / "IMU.txt", imu)
        losses = [
            "The rover itself has no class of LuSNAR's: 255 in pictures; ripples and tracks are "
            "regolith.",
            "Points are rock, regolith or mountain: which of them lie in a crater is not told.",
            "Normals, instances, shadows, flow, odometry and all but the first lidar are lost.",
        ]
        losses += picture_losses((pair.left, pair.right))
        if recording.link_of(recording.body_name) != BASE:
            losses.append(f"Rover_pose.txt is of {recording.body_name}, which moves on the rover.")
        if far:
            losses.append(f"{far} pixels are farther than 16 bits of depth reach: 0.")
        return tuple(losses)


def _pair(recording: Recording, options: Options) -> StereoPair:
    for pair in sorted(recording.pairs, key=lambda pair: any(_lacking(pair))):
        if options.camera in (None, pair.left.key, pair.left.name):
            return pair
    which = f"whose left camera is {options.camera!r}" if options.camera else "of cameras"
    raise ExportError(f"lusnar needs a stereo pair {which}, and the recording has none")


def _lacking(pair: StereoPair) -> Iterator[tuple[RecordedCamera, str]]:
    """The cameras of a pair that lack a channel, each with it."""
    for camera in (pair.left, pair.right):
        for channel in ("depth", "class"):
            if channel not in camera.channels:
                yield camera, channel


def _class_numbers(recording: Recording) -> NDArray[np.uint8]:
    """LuSNAR's class of each of ours, by its number."""
    found = np.full(256, NONE, np.uint8)
    for number, name in recording.about["classes"].items():
        if not str(number).isdecimal() or int(number) > 255:
            raise ExportError(f"lusnar: a class of the number {number!r} fits no picture")
        found[int(number)] = _CLASSES.get(str(name), NONE)
    return found


def _write_camera(
    folder: Path,
    camera: RecordedCamera,
    numbers: NDArray[np.uint8],
    options: Options,
    progress: Progress,
) -> int:
    for name in ("RGB", "Depth", "Label"):
        (folder / name).mkdir(parents=True)
    colours = np.zeros((256, 3), np.uint8)
    for number, colour in _COLOURS.items():
        colours[number] = colour >> 16, colour >> 8 & 255, colour & 255
    far = 0
    for number, stamp in enumerate(camera.stamps.tolist()):
        progress("writing lusnar", number / len(camera.stamps))
        name = f"{stamp}.png"
        write_picture(folder / "RGB" / name, camera, number, truth_stream(camera), to_grey=False)
        depth = camera.depth(number)
        far += write_depth(folder / "Depth" / name, depth, options.depth_factor)
        labels = numbers[camera.image(number, "class")]
        write_png(
            folder / "Label" / name, colours[labels] if options.labels == "lusnar" else labels
        )
    return far


def _write_sweeps(folder: Path, lidar: RecordedLidar, options: Options) -> None:
    folder.mkdir()
    for number, stamp in enumerate(lidar.stamps.tolist()):
        points = lidar.sweep(number)
        instance = points["instance"]
        kinds = np.where(instance >= 0, ROCK, REGOLITH)
        for name, kind in (("rover", NONE), ("beyond the site", MOUNTAIN)):
            kinds[instance == lidar.codes.get(name)] = kind
        if options.labels == "lusnar":
            points, kinds = points[kinds != NONE], kinds[kinds != NONE]
            kinds = np.where(kinds == ROCK, 174, -1)
        rows = zip(*places(points).T.tolist(), kinds.tolist(), strict=True)
        text = "".join(f"{x:.6f} {y:.6f} {z:.6f} {kind}\n" for x, y, z, kind in rows)
        (folder / f"{stamp}.txt").write_text(text)


def _write_table(path: Path, table: RecordedSeries) -> None:
    """EuRoC's columns, without a heading, with spaces."""
    with path.open("w", encoding="utf-8") as file:
        for stamps, values in table.blocks():
            for stamp, row in zip(stamps.tolist(), values.tolist(), strict=True):
                file.write(f"{stamp} {' '.join(map(repr, row))}\n")
