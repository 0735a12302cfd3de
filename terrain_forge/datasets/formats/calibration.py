"""The calibration alone, in the words of SLAM systems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from terrain_forge.base import FileName, Progress, Spec
from terrain_forge.datasets.calibration import calibration_files, calibration_losses
from terrain_forge.datasets.pictures import deep_cameras
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.sizes import Footprint
from terrain_forge.datasets.writer import DatasetWriter, one_of


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of calibration files."""

    depth_factor: Literal[5000, 1000] = 5000
    """Values in a metre of the TUM layout that `orbslam3/rgbd.yaml` is of; a recording's own
    calibration takes that of its format `tum`."""
    camera: FileName | None = None
    """The camera of that layout, by its name or folder; the first one by default that has depth."""


class Calibration(DatasetWriter):
    """Writes a folder of each system, as recordings have in `calibration`."""

    kind: ClassVar[str] = "calibration"
    title: ClassVar[str] = "calibration of SLAM systems"
    Options: ClassVar[type[Spec]] = Options
    naming: ClassVar[tuple[str, ...]] = ("camera",)

    def check(self, recording: Recording, options: Any) -> None:
        """Refuse a camera that was not recorded, or without depth."""
        if options.camera:
            one_of(deep_cameras(recording), options.camera, "camera with depth", self.kind)

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """Nothing that a disk need be asked for: a few texts."""
        del footprints, options
        return 0.0

    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the files."""
        del progress
        files = calibration_files(recording, options.depth_factor, options.camera or "")
        for name, text in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text)
        return calibration_losses(recording)
