"""An inertial measurement unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import NotNegative
from terrain_forge.model.sensor import Sdf, Sensor, Topic


@dataclass(frozen=True, kw_only=True, eq=False)
class ImuSensor(Sensor):
    """Gyroscope and accelerometer; by default an ADIS16448 (Burri et al. 2016).

    Its figures are densities, of white noise and of the walk of its bias
    (doi:10.1177/0278364915620033).
    """

    title: ClassVar[str] = "IMU"
    topics: ClassVar[tuple[Topic, ...]] = (Topic("", "IMU", "Imu"),)
    mjcf: ClassVar[tuple[str, ...]] = ("accelerometer", "gyro")
    actor_loss: ClassVar[str] = (
        "Physics does not move actors, so their IMU does not measure the path's accelerations and "
        "rates."
    )

    kind: Literal["imu"] = "imu"
    """An IMU."""
    rate_hz: Annotated[float, Interval(ge=1, le=10_000)] = 200.0
    """Samples per second [Hz]."""
    gyro_noise: NotNegative = 1.6968e-4
    """White noise of a rate [rad/s/√Hz]."""
    gyro_walk: NotNegative = 1.9393e-5
    """Walk of a rate's bias [rad/s²/√Hz]."""
    accelerometer_noise: NotNegative = 2.0e-3
    """White noise of a specific force [m/s²/√Hz]."""
    accelerometer_walk: NotNegative = 3.0e-3
    """Walk of its bias [m/s³/√Hz]."""

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """Noise of each axis; the biases' correlation times are those of RotorS' ADIS16448 [s]."""
        turning = self._noise(self.gyro_noise, self.gyro_walk, 1000)
        moving = self._noise(self.accelerometer_noise, self.accelerometer_walk, 300)
        return "imu", {"imu": {"angular_velocity": turning, "linear_acceleration": moving}}

    def _noise(self, density: float, walk: float, time: float) -> dict[str, Any]:
        """Of the three axes. Gazebo's `stddev` is that of a sample: density · √rate."""
        noise = {"@type": "gaussian", "mean": 0, "stddev": density * math.sqrt(self.rate_hz)}
        if walk:
            noise |= {"dynamic_bias_stddev": walk, "dynamic_bias_correlation_time": time}
        return {axis: {"noise": noise} for axis in "xyz"}
