"""A stereo pair's pictures: two cameras that take them at once."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

from terrain_forge.model import StereoSensor
from terrain_forge.sensors.instrument import Frames, Instrument, Stream
from terrain_forge.sensors.instruments.camera import CameraFrames

_SIDES = "left", "right"


class StereoFrames(Frames):
    """Two cameras; recordings have a folder of each, the left one first."""

    kind: ClassVar[str] = "stereo"
    folder: ClassVar[str] = "cam"
    sensor: StereoSensor

    @cached_property
    def eyes(self) -> tuple[CameraFrames, CameraFrames]:
        """The left and the right camera."""
        sensor, setting = self.sensor, self.setting
        one, two = sensor.simple
        wide = sensor.baseline_m
        others = [(wide, wide), (wide, -wide)] if "disparity" in sensor.channels else [None, None]
        left = CameraFrames(one, setting, other=others[0])
        right = CameraFrames(
            two, setting, sensitivity=1.0 + sensor.gain_mismatch, leader=left, other=others[1]
        )
        return left, right

    @cached_property
    def parts(self) -> tuple[Instrument, ...]:
        """The left and the right camera."""
        return self.eyes

    def check(self) -> None:
        """Refuse what one of them does."""
        for eye in self.eyes:
            eye.check()

    def streams(self) -> tuple[Stream, ...]:
        """Those of both cameras: `left/data`, `right/data` and so on."""
        return tuple(
            replace(stream, name=f"{side}/{stream.name}")
            for side, eye in zip(_SIDES, self.eyes, strict=True)
            for stream in eye.streams()
        )

    def calibration(self) -> dict[str, Any]:
        """Of both cameras, by their names."""
        return {eye.sensor.name: eye.calibration() for eye in self.eyes}

    def measure(self, number: int) -> dict[str, bytes]:
        """The files of both cameras."""
        return {
            f"{side}/{name}": content
            for side, eye in zip(_SIDES, self.eyes, strict=True)
            for name, content in eye.measure(number).items()
        }
