"""A lidar whose beams turn about its z axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import NotNegative
from terrain_forge.model.sensor import Form, Sdf, Sensor, Topic, white_noise


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarSensor(Sensor):
    """A lidar of evenly spread beams; its default figures are nominal."""

    title: ClassVar[str] = "lidar"
    topics: ClassVar[tuple[Topic, ...]] = (Topic("points", "PointCloudPacked", "PointCloud2"),)

    kind: Literal["lidar"] = "lidar"
    """A lidar."""
    rate_hz: Annotated[float, Interval(ge=0.1, le=100)] = 10.0
    """Turns per second [Hz]."""
    channels: Annotated[int, Interval(ge=1, le=1024)] = 16
    """Beams above each other."""
    vertical_fov_deg: Annotated[float, Interval(ge=0, le=180)] = 30.0
    """Angle between the lowest and the highest beam [degrees]."""
    horizontal_samples: Annotated[int, Interval(ge=4, le=100_000)] = 1800
    """Columns of a full turn."""
    range_min_m: NotNegative = 0.5
    """Nearest point [m]."""
    range_max_m: Annotated[float, Interval(ge=0.1, le=10_000)] = 100.0
    """Farthest point [m]."""
    noise_m: NotNegative = 0.01
    """Standard deviation of a range [m]."""

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """A scan of a full turn: its last column is one step short of the first."""
        half = math.radians(self.vertical_fov_deg) / 2
        last = math.pi - 2 * math.pi / self.horizontal_samples
        scan = {
            "horizontal": _angles(self.horizontal_samples, -math.pi, last),
            "vertical": _angles(self.channels, -half, half),
        }
        span = {"min": self.range_min_m, "max": self.range_max_m}
        kind, tag = ("ray", "ray") if classic else ("gpu_lidar", "lidar")
        return kind, {tag: {"scan": scan, "range": span} | white_noise(self.noise_m)}

    def said(self, form: Form) -> set[str]:
        """A scan of even steps."""
        scan = {"channels", "vertical_fov_deg", "horizontal_samples"}
        told = scan | {"rate_hz", "range_min_m", "range_max_m", "noise_m"}
        return told if form == "sdf" else set()


def _angles(samples: int, low: float, high: float) -> dict[str, float]:
    return {"samples": samples, "resolution": 1, "min_angle": low, "max_angle": high}
