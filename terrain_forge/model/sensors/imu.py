"""An inertial measurement unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import NotNegative
from terrain_forge.model.sensor import Form, Sdf, Sensor, Topic

_G0 = 9.80665
"""What data sheets count accelerations in [m/s²]."""
_DEGREE = math.pi / 180
_ADIS16448 = {
    "gyro_noise": 1.6968e-4,
    "gyro_walk": 1.9393e-5,
    "accelerometer_noise": 2.0e-3,
    "accelerometer_walk": 3.0e-3,
}
_DRIFT = math.sqrt(2 / 3600)
"""Walk of a bias over what it varies by in an hour [1/√s]: the white noise that drives a process
of the first order (Gauss-Markov) with that time."""
_PRESETS: dict[str, dict[str, Any]] = {
    # Burri et al. 2016, doi:10.1177/0278364915620033: the figures that EuRoC's files tell.
    "adis16448": _ADIS16448,
    # A MEMS unit, Xsens MTi-1: noise, in-run stability of a bias, ranges and bandwidth of its data
    # sheet (as in doi:10.2478/tar-2023-0022); the bias at the start is our choice, ten times that.
    "mti-1": {
        "gyro_noise": 0.007 * _DEGREE,
        "gyro_walk": 10 * _DEGREE / 3600 * _DRIFT,
        "gyro_bias": 100 * _DEGREE / 3600,
        "gyro_range": 2000 * _DEGREE,
        "accelerometer_noise": 120e-6 * _G0,
        "accelerometer_walk": 0.03e-3 * _G0 * _DRIFT,
        "accelerometer_bias": 0.3e-3 * _G0,
        "accelerometer_range": 16 * _G0,
        "bandwidth_hz": 255.0,
    },
    # A tactical unit, Sensonor STIM300 with accelerometers of 10 g: its data sheet, as in
    # `stim300_model` of IS4S' NavToolkit, and as a table of ION's NAVIGATION has it
    # (navi.ion.org/highwire/markup/10540): walks, repeatability, the hour in which biases vary.
    "stim300": {
        "gyro_noise": 0.15 * _DEGREE / 60,
        "gyro_walk": 0.5 * _DEGREE / 3600 * _DRIFT,
        "gyro_bias": 4 * _DEGREE / 3600,
        "gyro_scale": 500e-6,
        "gyro_g_sensitivity": 1 * _DEGREE / 3600 / _G0,
        "gyro_range": 400 * _DEGREE,
        "accelerometer_noise": 0.07 / 60,
        "accelerometer_walk": 0.05e-3 * _G0 * _DRIFT,
        "accelerometer_bias": 0.75e-3 * _G0,
        "accelerometer_scale": 300e-6,
        "accelerometer_range": 10 * _G0,
        "misalignment": 1e-3,
    },
    "ideal": dict.fromkeys(_ADIS16448, 0.0),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class ImuSensor(Sensor):
    """Gyroscope and accelerometer; by default an ADIS16448 (Burri et al. 2016).

    Its figures are densities, of white noise and of the walk of its bias
    (doi:10.1177/0278364915620033); what is drawn once for each axis, such as a bias at the start or
    a scale's error, is given by its standard deviation. Presets: `adis16448`; `mti-1`, of small
    MEMS; `stim300`, tactical; `ideal`, without any error.
    """

    title: ClassVar[str] = "IMU"
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = _PRESETS
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
    gyro_noise: NotNegative = _ADIS16448["gyro_noise"]
    """White noise of a rate [rad/s/√Hz]."""
    gyro_walk: NotNegative = _ADIS16448["gyro_walk"]
    """Walk of a rate's bias [rad/s²/√Hz]."""
    gyro_bias: NotNegative = 0.0
    """Bias of a rate at the start, its standard deviation [rad/s]."""
    gyro_scale: Annotated[float, Interval(ge=0, le=0.3)] = 0.0
    """Error of a rate's scale, its standard deviation, a share."""
    gyro_g_sensitivity: NotNegative = 0.0
    """Rate that a specific force seems to be, its standard deviation, each axis of each
    [rad/s per m/s²]."""
    gyro_range: NotNegative = 0.0
    """Largest rate that it can tell [rad/s]; 0 for any."""
    gyro_step: NotNegative = 0.0
    """Step in which it tells rates [rad/s]; 0 for none."""
    accelerometer_noise: NotNegative = _ADIS16448["accelerometer_noise"]
    """White noise of a specific force [m/s²/√Hz]."""
    accelerometer_walk: NotNegative = _ADIS16448["accelerometer_walk"]
    """Walk of its bias [m/s³/√Hz]."""
    accelerometer_bias: NotNegative = 0.0
    """Bias of a specific force at the start, its standard deviation [m/s²]."""
    accelerometer_scale: Annotated[float, Interval(ge=0, le=0.3)] = 0.0
    """Error of a specific force's scale, its standard deviation, a share."""
    accelerometer_range: NotNegative = 0.0
    """Largest specific force that it can tell [m/s²]; 0 for any."""
    accelerometer_step: NotNegative = 0.0
    """Step in which it tells specific forces [m/s²]; 0 for none."""
    misalignment: Annotated[float, Interval(ge=0, le=0.3)] = 0.0
    """Angle of an axis against its place, its standard deviation in either direction [rad]."""
    bandwidth_hz: NotNegative = 0.0
    """Where it has lost half the power of what it measures, by a Butterworth filter of the second
    order, with its delay [Hz]; 0 for none, and none from half the rate on."""

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """Noise of each axis; the biases' correlation times are those of RotorS' ADIS16448 [s]."""
        turning = self._noise(self.gyro_noise, self.gyro_walk, self.gyro_bias, self.gyro_step, 1000)
        moving = self._noise(
            self.accelerometer_noise, self.accelerometer_walk, self.accelerometer_bias,
            self.accelerometer_step, 300,
        )  # fmt: skip
        return "imu", {"imu": {"angular_velocity": turning, "linear_acceleration": moving}}

    def said(self, form: Form) -> set[str]:
        """Noise, biases and steps of each axis."""
        parts = ("noise", "walk", "bias", "step")
        told = {f"{device}_{part}" for device in ("gyro", "accelerometer") for part in parts}
        return told | {"rate_hz"} if form == "sdf" else set()

    def _noise(
        self, density: float, walk: float, bias: float, step: float, time: float
    ) -> dict[str, Any]:
        """Of the three axes. Gazebo's `stddev` is that of a sample: density · √rate."""
        kind = "gaussian_quantized" if step else "gaussian"
        noise = {"@type": kind, "mean": 0, "stddev": density * math.sqrt(self.rate_hz)}
        if bias:
            noise |= {"bias_mean": 0, "bias_stddev": bias}
        if walk:
            noise |= {"dynamic_bias_stddev": walk, "dynamic_bias_correlation_time": time}
        if step:
            noise |= {"precision": step}
        return {axis: {"noise": noise} for axis in "xyz"}
