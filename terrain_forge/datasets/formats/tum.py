"""TUM RGB-D: pictures of a camera with their true depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from terrain_forge.base import ExportError, FileName, Progress, Spec
from terrain_forge.datasets import sizes
from terrain_forge.datasets.pictures import (
    deep_cameras,
    picture_losses,
    truth_stream,
    write_depth,
    write_picture,
)
from terrain_forge.datasets.poses import tum_text
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.sizes import Footprint
from terrain_forge.datasets.streams import RecordedCamera
from terrain_forge.datasets.writer import DatasetWriter, Need, one_of

_ROWS = 3.0 * 60.0 + sizes.POSE
"""Bytes of a picture's rows in the lists."""


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the TUM RGB-D layout."""

    camera: FileName | None = None
    """The camera, by its name or folder; the first one by default that has depth."""
    depth_factor: Literal[5000, 1000] = 5000
    """Values of a depth picture in a metre: 5000 reaches to 13.107 m, 1000 to 65.535 m; what is
    farther is 0, which means no depth."""


class Tum(DatasetWriter):
    """Writes rgb, depth, their lists and the truth."""

    kind: ClassVar[str] = "tum"
    title: ClassVar[str] = "TUM RGB-D"
    Options: ClassVar[type[Spec]] = Options
    needs: ClassVar[tuple[Need, ...]] = ("depth",)
    naming: ClassVar[tuple[str, ...]] = ("camera",)

    def check(self, recording: Recording, options: Any) -> None:
        """Refuse a recording without depth."""
        _camera(recording, options)

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """Pictures, depth, and their lists."""
        for one in sizes.cameras(footprints, "depth", name=options.camera):
            return one.count * (sizes.picture(one) + sizes.depth(one) + _ROWS)
        return 0.0

    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the sequence."""
        camera = _camera(recording, options)
        stream = truth_stream(camera)
        for name in ("rgb", "depth"):
            (folder / name).mkdir()
        far = pixels = 0
        names = []
        for number, stamp in enumerate(camera.stamps.tolist()):
            progress("writing tum", number / len(camera.stamps))
            name = f"{stamp // 10**9}.{stamp % 10**9:09d}"
            names.append(name)
            write_picture(folder / "rgb" / f"{name}.png", camera, number, stream, to_grey=False)
            depth = camera.depth(number)
            pixels += depth.size
            far += write_depth(folder / "depth" / f"{name}.png", depth, options.depth_factor)
        _write_lists(folder, names, f"depth in 1/{options.depth_factor} m")
        truth = recording.truth_of(camera)
        head = "# timestamp tx ty tz qx qy qz qw, of the camera's optical frame in the world\n"
        (folder / "groundtruth.txt").write_text(head + tum_text(truth))
        losses = [*picture_losses((camera,)), "One camera: no stereo, no lidar, no IMU, no labels."]
        if far:
            reach = 65535 / options.depth_factor
            losses.append(f"{far / pixels:.1%} of the pixels are farther than {reach:g} m: 0.")
        if stream == "data" and not camera.straight:
            losses.append(
                f"Pictures and depth have the lens's distortion ({camera.distortion[0]})."
            )
        return tuple(losses)


def _camera(recording: Recording, options: Options) -> RecordedCamera:
    deep = deep_cameras(recording)
    if recording.cameras and not deep:
        raise ExportError("tum needs depth of a camera: record with channels: [depth]")
    return one_of(deep, options.camera or "", "camera with depth", "tum")


def _write_lists(folder: Path, names: list[str], unit: str) -> None:
    for kind, what in (("rgb", "pictures"), ("depth", unit)):
        head = f"# {what}\n# file: '{folder.name}'\n# timestamp filename\n"
        rows = "".join(f"{name} {kind}/{name}.png\n" for name in names)
        (folder / f"{kind}.txt").write_text(head + rows)
    both = "".join(f"{n} rgb/{n}.png {n} depth/{n}.png\n" for n in names)
    (folder / "associations.txt").write_text(both)
