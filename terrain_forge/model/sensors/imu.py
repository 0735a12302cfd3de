"""An inertial measurement unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from terrain_forge.model.sensor import Sdf, Sensor, Topic


@dataclass(frozen=True, kw_only=True, eq=False)
class ImuSensor(Sensor):
    """Gyroscope and accelerometer; by default an ADIS16448 (Burri et al. 2016).

    Its figures are densities, of white noise and of the walk of its bias
    (doi:10.1177/0278364915620033).
    """

    kind: ClassVar[str] = "imu"
    title: ClassVar[str] = "IMU"
    topics: ClassVar[tuple[Topic, ...]] = (Topic("", "IMU", "Imu"),)
    mjcf: ClassVar[tuple[str, ...]] = ("accelerometer", "gyro")
    actor_loss: ClassVar[str] = (
        "Physics does not move actors, so their IMU does not measure the path's accelerations and "
        "rates."
    )

    rate: float = 200.0
    """Samples per second [Hz]."""
    gyro_noise: float = 1.6968e-4
    """[rad/s/√Hz]"""
    gyro_walk: float = 1.9393e-5
    """[rad/s²/√Hz]"""
    accelerometer_noise: float = 2.0e-3
    """[m/s²/√Hz]"""
    accelerometer_walk: float = 3.0e-3
    """[m/s³/√Hz]"""

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """Noise of each axis; the biases' correlation times are those of RotorS' ADIS16448 [s]."""
        turning = self._noise(self.gyro_noise, self.gyro_walk, 1000)
        moving = self._noise(self.accelerometer_noise, self.accelerometer_walk, 300)
        return "imu", {"imu": {"angular_velocity": turning, "linear_acceleration": moving}}

    def _noise(self, density: float, walk: float, time: float) -> dict[str, Any]:
        """Of the three axes. Gazebo's `stddev` is that of a sample: density · √rate."""
        noise = {"@type": "gaussian", "mean": 0, "stddev": density * math.sqrt(self.rate)}
        if walk:
            noise |= {"dynamic_bias_stddev": walk, "dynamic_bias_correlation_time": time}
        return {axis: {"noise": noise} for axis in "xyz"}
