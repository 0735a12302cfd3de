"""Gyroscope and accelerometer, with the errors of real ones."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel, mix, normal
from terrain_forge.model import ImuSensor
from terrain_forge.sensors.instrument import NANOSECONDS, Series, Setting, Stream

_AT_ONCE = 20_000
"""Samples that are made at a time."""
COLUMNS = (
    *("w_RS_S_x [rad s^-1]", "w_RS_S_y [rad s^-1]", "w_RS_S_z [rad s^-1]"),
    *("a_RS_S_x [m s^-2]", "a_RS_S_y [m s^-2]", "a_RS_S_z [m s^-2]"),
)
"""Rates and specific forces in the sensor's frame, by EuRoC's names."""
# What a number of chance is for.
_WHITE, _WALK, _START, _SCALE, _ALIGNMENT, _GRAVITY = range(6)


class Imu(Series):
    """Measures rates, and specific forces: accelerations against free fall, +g upwards at rest.

    A reading is a straight function of the true values, and bias, walk and white noise, which then
    is rounded and cut. Of a density N a sample's noise is N √rate, of a walk K its step from sample
    to sample is K / √rate (IEEE Std 952-1997, annex C).
    """

    kind: ClassVar[str] = "imu"
    folder: ClassVar[str] = "imu"
    sensor: ImuSensor

    def __init__(self, sensor: ImuSensor, setting: Setting) -> None:
        super().__init__(sensor, setting)
        self._key = setting.key(sensor)

    def streams(self) -> tuple[Stream, ...]:
        """One table."""
        return (Stream(name="data", suffix=".csv", figures={"columns": list(COLUMNS)}),)

    def calibration(self) -> dict[str, Any]:
        """The densities by EuRoC's names, gravity, and the errors that were drawn once."""
        sensor = self.sensor
        return {
            "gyroscope_noise_density": sensor.gyro_noise,
            "gyroscope_random_walk": sensor.gyro_walk,
            "accelerometer_noise_density": sensor.accelerometer_noise,
            "accelerometer_random_walk": sensor.accelerometer_walk,
            "gravity_m_s2": self.setting.gravity,
            "gyroscope_range": sensor.gyro_range,
            "accelerometer_range": sensor.accelerometer_range,
            "bandwidth_hz": sensor.bandwidth_hz,
            "true_bias_at_start": self._start.tolist(),
            "true_response": self._response.ravel().tolist(),
        }

    def samples(self) -> dict[str, Array]:
        """Rates [rad/s] and specific forces [m/s²] by EuRoC's names, in the sensor's frame."""
        return dict(zip(COLUMNS, self._measured[0].T, strict=True))

    def biases(self, times: NDArray[np.int64]) -> Array:
        """True biases, of rates and specific forces, at times [ns], shape [n, 6].

        After the last sample its own go on.
        """
        rows = np.minimum(np.searchsorted(self.times, times), len(self.times) - 1)
        return np.asarray(self._measured[1][rows])

    @cached_property
    def _measured(self) -> tuple[Array, Array]:
        """Readings and biases, shape [measurements, 6]."""
        sensor, count = self.sensor, len(self.times)
        readings, biases = np.empty((count, 6)), np.empty((count, 6))
        rate = math.sqrt(sensor.rate_hz)
        numbers = np.empty((5, 6))
        numbers[0] = self._start
        numbers[1] = _of_both(rate * sensor.gyro_noise, rate * sensor.accelerometer_noise)
        numbers[2] = _of_both(sensor.gyro_walk / rate, sensor.accelerometer_walk / rate)
        numbers[3] = _of_both(sensor.gyro_step, sensor.accelerometer_step)
        numbers[4] = _of_both(sensor.gyro_range, sensor.accelerometer_range)
        chances = [np.uint64(mix(self._key, what)) for what in (_WHITE, _WALK)]
        keys = np.array([[mix(one, n) for n in range(6)] for one in chances], np.uint64)
        carried = np.zeros((3, 6))
        filtering = _butterworth(sensor.bandwidth_hz, sensor.rate_hz)
        for first in range(0, count, _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            state = self.state(self.times[part] / NANOSECONDS)
            _measure(
                first, keys, state.rotation, state.acceleration, state.rate, self.setting.gravity,
                self._response, filtering, numbers, carried, readings[part], biases[part],
            )  # fmt: skip
        return readings, biases

    @cached_property
    def _start(self) -> Array:
        """Biases at the start, shape [6]."""
        sensor = self.sensor
        return _of_both(sensor.gyro_bias, sensor.accelerometer_bias) * self.drawn(_START, 6)

    @cached_property
    def _response(self) -> Array:
        """What true rates and specific forces give without bias and noise, shape [6, 6]."""
        sensor, found = self.sensor, np.zeros((6, 6))
        scales = _of_both(sensor.gyro_scale, sensor.accelerometer_scale) * self.drawn(_SCALE, 6)
        turns = sensor.misalignment * self.drawn(_ALIGNMENT, 2, 3, 3)
        for device in range(2):
            own = slice(3 * device, 3 * device + 3)
            found[own, own] = turns[device]
        np.fill_diagonal(found, 1.0 + scales)
        found[:3, 3:] = sensor.gyro_g_sensitivity * self.drawn(_GRAVITY, 3, 3)
        return found


def _of_both(gyro: float, accelerometer: float) -> Array:
    return np.repeat([gyro, accelerometer], 3)


def _butterworth(bandwidth: float, rate: float) -> Array:
    """Numbers b₀, b₁, b₂, a₁, a₂ of a filter of the second order (bilinear transform).

    One that lets all pass where there is none, or nothing between the samples to smooth.
    """
    if not 0.0 < bandwidth < 0.5 * rate:
        return np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    k = math.tan(math.pi * bandwidth / rate)
    whole = 1.0 + math.sqrt(2.0) * k + k * k
    gain = k * k / whole
    poles = 2.0 * (k * k - 1.0) / whole, (1.0 - math.sqrt(2.0) * k + k * k) / whole
    return np.array([gain, 2.0 * gain, gain, *poles])


@kernel
def _measure(  # type: ignore[no-untyped-def]
    first, keys, rotation, acceleration, rate, gravity, response, filtering, numbers, carried,
    readings, biases,
):  # fmt: skip
    """Make samples one after another; `carried` holds the filters' two memories and the walks."""
    b_0, b_1, b_2, a_1, a_2 = filtering
    true = np.empty(6)
    for n in range(len(rate)):
        x, y, z = acceleration[n, 0], acceleration[n, 1], acceleration[n, 2] + gravity
        for axis in range(3):
            true[axis] = rate[n, axis]
            turn = rotation[n, :, axis]
            true[3 + axis] = turn[0] * x + turn[1] * y + turn[2] * z
        for c in range(6):
            value = true[c]
            if first + n == 0:  # as if it had been so for ever
                carried[1, c] = (b_2 - a_2) * value
                carried[0, c] = (b_1 - a_1) * value + carried[1, c]
            smooth = b_0 * value + carried[0, c]
            carried[0, c] = b_1 * value - a_1 * smooth + carried[1, c]
            carried[1, c] = b_2 * value - a_2 * smooth
            true[c] = smooth
        for c in range(6):
            if numbers[2, c] > 0.0 and first + n > 0:
                carried[2, c] += numbers[2, c] * normal(mix(keys[1, c], first + n))
            biases[n, c] = numbers[0, c] + carried[2, c]
            value = biases[n, c]
            for k in range(6):
                value += response[c, k] * true[k]
            if numbers[1, c] > 0.0:
                value += numbers[1, c] * normal(mix(keys[0, c], first + n))
            step, most = numbers[3, c], numbers[4, c]
            if step > 0.0:
                value = step * np.rint(value / step)
            if most > 0.0:
                value = min(max(value, -most), most)
            readings[n, c] = value
