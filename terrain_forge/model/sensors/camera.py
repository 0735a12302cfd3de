"""A camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import Fraction
from terrain_forge.model.sensor import Form, Sdf, Sensor, Topic, View, white_noise

_BENT = {"": (), "radtan": ("sdf", "usd"), "equidistant": ("usd",)}
"""The formats that know a distortion."""
_NEAR = 0.02
"""What it sees at least in Gazebo [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraSensor(Sensor):
    """A pinhole camera; by default one of a ZED at its 720p setting, its figures nominal."""

    title: ClassVar[str] = "camera"
    topics: ClassVar[tuple[Topic, ...]] = (
        Topic("image", "Image", "Image"),
        Topic("camera_info", "CameraInfo", "CameraInfo"),
    )
    # A level of their own, so that two cameras do not share camera_info.
    sdf_topic: ClassVar[str] = "/image"

    kind: Literal["camera"] = "camera"
    """A camera."""
    rate_hz: Annotated[float, Interval(ge=0.01, le=1000)] = 15.0
    """Images per second [Hz]."""
    width_px: Annotated[int, Interval(ge=8, le=10_000)] = 1280
    """Pixels of a row."""
    height_px: Annotated[int, Interval(ge=8, le=10_000)] = 720
    """Pixels of a column."""
    horizontal_fov_deg: Annotated[float, Interval(ge=1, le=170)] = 85.0
    """Angle between the left and the right edge [degrees]."""
    noise: Fraction = 0.007
    """Standard deviation of a pixel's intensity in simulators' own cameras, which is 0 to 1."""

    @property
    def view(self) -> View:
        """Its picture."""
        return View(self.width_px, self.height_px, math.radians(self.horizontal_fov_deg))

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """A camera, with noise where it has any."""
        lens = {
            "horizontal_fov": self.view.horizontal_fov,
            "image": {"width": self.width_px, "height": self.height_px, "format": "R8G8B8"},
            "clip": {"near": _NEAR, "far": far},
        }
        return "camera", {"camera": lens | white_noise(self.noise) | self.view.sdf_lens()}

    def said(self, form: Form) -> set[str]:
        """The picture, and how it is bent: by radii and tangents in SDF, either way in USD."""
        told = {"width_px", "height_px", "horizontal_fov_deg"}
        told |= {"rate_hz", "noise"} if form == "sdf" else set()
        return told | ({"distortion"} if form in _BENT[self.view.lens] else set())
