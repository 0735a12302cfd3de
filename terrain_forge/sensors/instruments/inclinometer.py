"""Roll and pitch by what is felt as down."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.model import InclinometerSensor
from terrain_forge.sensors.instrument import NANOSECONDS, Series, Stream

COLUMNS = ("roll [rad]", "pitch [rad]")
_NOISE, _BIAS = range(2)


class Inclinometer(Series):
    """Takes the specific force for upwards: at rest it is, else accelerations tilt it."""

    kind: ClassVar[str] = "inclinometer"
    folder: ClassVar[str] = "inclinometer"
    sensor: InclinometerSensor

    def streams(self) -> tuple[Stream, ...]:
        """One table."""
        return (Stream(name="data", suffix=".csv", figures={"columns": list(COLUMNS)}),)

    def calibration(self) -> dict[str, Any]:
        """Errors and limits [rad], gravity, and the bias that was drawn."""
        sensor = self.sensor
        return {
            "noise": math.radians(sensor.noise_deg),
            "range": math.radians(sensor.range_deg),
            "step": math.radians(sensor.step_deg),
            "gravity_m_s2": self.setting.gravity,
            "true_bias": self._bias.tolist(),
        }

    def samples(self) -> dict[str, Array]:
        """Roll and pitch [rad] of the sensor's frame, R = Rz(yaw) Ry(pitch) Rx(roll)."""
        sensor, state = self.sensor, self.state(self.times / NANOSECONDS)
        push = state.acceleration + np.array([0.0, 0.0, self.setting.gravity])
        force = (state.rotation * push[:, :, None]).sum(axis=1)
        across = np.sqrt(force[:, 1] ** 2 + force[:, 2] ** 2)
        angles = np.stack(
            [
                portable.arctan2(force[:, 1], force[:, 2]),
                portable.arctan2(-force[:, 0], across),
            ],
            axis=1,
        )
        angles += self._bias
        angles += math.radians(sensor.noise_deg) * self.drawn(_NOISE, *angles.shape)
        if step := math.radians(sensor.step_deg):
            angles = step * np.rint(angles / step)
        most = math.radians(sensor.range_deg)
        return dict(zip(COLUMNS, np.clip(angles, -most, most).T, strict=True))

    @property
    def _bias(self) -> Array:
        return np.asarray(math.radians(self.sensor.bias_deg) * self.drawn(_BIAS, 2))
