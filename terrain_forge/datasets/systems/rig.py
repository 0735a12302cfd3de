"""What all calibration files are made of: cameras, their pair, the IMU, gravity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from terrain_forge.base import Array
from terrain_forge.datasets.pictures import deep_cameras, pair_of
from terrain_forge.datasets.reader import Recording, StereoPair
from terrain_forge.datasets.streams import RecordedCamera, RecordedSensor

EARTH = 9.81
"""Gravity that several systems have built in [m/s^2]."""


_MEASURED = "gyroscope", "accelerometer"


@dataclass(frozen=True, eq=False)
class Noise:
    """An IMU's noise: densities, of the values and of their biases' walks."""

    gyroscope: float
    gyroscope_walk: float
    accelerometer: float
    accelerometer_walk: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Rig:
    """A recording as the systems know it: one pair or camera, one IMU, one lidar."""

    recording: Recording
    """The recording."""
    depth_factor: float = 5000.0
    """Values in a metre of depth pictures in the TUM layout."""
    depth_camera: str = ""
    """The camera of the TUM layout, by its name or folder; that which it has by default."""

    @cached_property
    def pair(self) -> StereoPair | None:
        """The stereo pair that formats and systems take."""
        return pair_of(self.recording)

    @cached_property
    def cameras(self) -> tuple[RecordedCamera, ...]:
        """The pair's cameras, or else the first one."""
        if self.pair:
            return self.pair.left, self.pair.right
        return self.recording.cameras[:1]

    @cached_property
    def deep(self) -> RecordedCamera | None:
        """The camera of the TUM layout."""
        deep = (one for one in deep_cameras(self.recording) if one.span)
        asked = self.depth_camera
        return next((one for one in deep if asked in ("", one.key, one.name)), None)

    @cached_property
    def imu(self) -> RecordedSensor | None:
        """The first IMU, whose frame is the body's."""
        return next(iter(self.recording.imus), None)

    @cached_property
    def noise(self) -> Noise:
        """That of the IMU."""
        assert self.imu is not None
        names = [f"{one}_{two}" for one in _MEASURED for two in ("noise_density", "random_walk")]
        return Noise(*(float(self.imu.numbers(name, (1,))[0]) for name in names))

    @property
    def gravity(self) -> str:
        """A sentence on the dataset's gravity."""
        return f"Gravity of this dataset: {self.recording.gravity:g} m/s^2."

    def built_in(self, system: str) -> tuple[str, ...]:
        """What is to be said of a system that knows of 9.81 m/s² alone."""
        if abs(self.recording.gravity - EARTH) < 0.02:
            return (self.gravity,)
        return (
            self.gravity,
            f"{system} has {EARTH} m/s^2 built in: with an IMU it cannot be right on this dataset.",
            f"Record with `dataset: {{gravity_m_s2: {EARTH}}}`, or change its source.",
        )


def four(camera: RecordedCamera) -> Array | None:
    """Four coefficients of a lens's distortion, zeros for none; None if it has a fifth."""
    model, given = camera.distortion
    if model == "none":
        return np.zeros(4)
    return given[:4] if not given[4:].any() else None


def model_of(camera: RecordedCamera) -> str:
    """The model that the four coefficients are of: `radtan` or `equidistant`."""
    model = camera.distortion[0]
    return "radtan" if model == "none" else model
