"""Where the Sun stands, while it is seen."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable
from terrain_forge.model import SunSensor
from terrain_forge.sensors.instrument import NANOSECONDS, Series, Stream
from terrain_forge.sensors.mounts import check_mounts

COLUMNS = ("s_x []", "s_y []", "s_z []", "seen []")
_NOISE, _BIAS = range(2)


class SunSensing(Series):
    """The direction to the Sun in the sensor's frame; zeros where it is not seen.

    A ray from the sensor to the middle of the Sun tells whether something is in the way.
    """

    kind: ClassVar[str] = "sun_sensor"
    folder: ClassVar[str] = "sun"
    sensor: SunSensor

    def check(self) -> None:
        """Refuse a sensor that only sees the rover's inside, or the ground's.

        Raises:
            RecipeError: saying where it is.
        """
        check_mounts(self.setting, (self.sensor,))

    def streams(self) -> tuple[Stream, ...]:
        """One table."""
        return (Stream(name="data", suffix=".csv", figures={"columns": list(COLUMNS)}),)

    def calibration(self) -> dict[str, Any]:
        """Errors and view [rad], the Sun's true place in the world, and the bias that was drawn."""
        sensor = self.sensor
        return {
            "noise": math.radians(sensor.noise_deg),
            "fov": math.radians(sensor.fov_deg),
            "sun_in_world": self.setting.world.lighting.towards_sun.tolist(),
            "true_bias": self._bias.tolist(),
        }

    def samples(self) -> dict[str, NDArray[Any]]:
        """Unit vectors to the Sun, and 1 where it is seen, else 0."""
        times = self.times / NANOSECONDS
        state, sun = self.state(times), self.setting.world.lighting.towards_sun
        true = (state.rotation * sun[None, :, None]).sum(axis=1)
        seen = (true[:, 2] >= math.cos(0.5 * math.radians(self.sensor.fov_deg))) & (sun[2] > 0.0)
        seen[seen] = self._unhidden(state.position[seen], times[seen])
        noise = math.radians(self.sensor.noise_deg) * self.drawn(_NOISE, len(true), 2)
        found = true + _across(true, noise + self._bias)
        found /= portable.norm(found)[:, None]
        shown = np.where(seen[:, None], found, 0.0)
        return dict(zip(COLUMNS, (*shown.T, seen.astype(np.int64)), strict=True))

    def _unhidden(self, places: Array, times: Array) -> NDArray[np.bool_]:
        """Whether nothing hides the Sun from some places at their times.

        The rover's links stand for each second as they do in its midst.
        """
        sun = np.asarray(self.setting.world.lighting.towards_sun)
        free, seconds = np.zeros(len(times), bool), np.floor(times)
        for second in np.unique(seconds).tolist():
            own = np.flatnonzero(seconds == second)
            towards = np.tile(sun, (len(own), 1))
            hits = self.setting.scenery.cast(
                places[own], towards, times[own], near=self.sensor.near_m
            )
            free[own] = np.isinf(hits.distance)
        return free

    @property
    def _bias(self) -> Array:
        """Errors that stay in two ways across [rad], shape [2]."""
        return np.asarray(math.radians(self.sensor.bias_deg) * self.drawn(_BIAS, 2))


def _across(directions: Array, angles: Array) -> Array:
    """Steps across unit vectors by small angles in two ways, shape [n, 3]."""
    x, y, z = directions.T
    # Along a basis without a seam but at -z (Duff et al. 2017, jcgt.org/published/0006/01/01).
    sign = np.where(z < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    one = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    two = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.asarray(angles[:, :1] * one + angles[:, 1:] * two)
