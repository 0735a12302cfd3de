"""A lidar whose beams turn about its z axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from terrain_forge.model.sensor import Sdf, Sensor, Topic, white_noise


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarSensor(Sensor):
    """A lidar of evenly spread beams; its default figures are nominal."""

    kind: ClassVar[str] = "lidar"
    title: ClassVar[str] = "lidar"
    topics: ClassVar[tuple[Topic, ...]] = (Topic("points", "PointCloudPacked", "PointCloud2"),)

    rate: float = 10.0
    """Turns per second [Hz]."""
    channels: int = 16
    """Beams above each other."""
    vertical_fov: float = math.radians(30.0)
    """Angle between the lowest and the highest beam [rad]."""
    horizontal_samples: int = 1800
    """Columns of a full turn."""
    range_min: float = 0.5
    """Nearest point [m]."""
    range_max: float = 100.0
    """Farthest point [m]."""
    noise: float = 0.01
    """Standard deviation of a range [m]."""

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """A scan of a full turn: its last column is one step short of the first."""
        half, last = self.vertical_fov / 2, math.pi - 2 * math.pi / self.horizontal_samples
        scan = {
            "horizontal": _angles(self.horizontal_samples, -math.pi, last),
            "vertical": _angles(self.channels, -half, half),
        }
        span = {"min": self.range_min, "max": self.range_max}
        kind, tag = ("ray", "ray") if classic else ("gpu_lidar", "lidar")
        return kind, {tag: {"scan": scan, "range": span} | white_noise(self.noise)}


def _angles(samples: int, low: float, high: float) -> dict[str, float]:
    return {"samples": samples, "resolution": 1, "min_angle": low, "max_angle": high}
