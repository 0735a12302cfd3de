"""Encoders on wheels, and the pose that they add up to."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, RecipeError, kernel, mix, normal, uniforms
from terrain_forge.model import OdometrySensor
from terrain_forge.sensors.instrument import NANOSECONDS, Series, Stream

_FINEST = 100.0
"""Rate at least by which slipping wheels are followed along a path [Hz]."""
_ALIKE = 1.0
"""For how long a wheel's slip is about the same [s]."""
_POWER = 2.0 * math.asinh(1.0) ** 2 * _ALIKE
"""Variance of a slip's sum over time for that of the slip itself [s]: the square of the sum of
`_vary`'s weights for one number."""
_PHASE, _SLIP = range(2)
_POSE = ("x [m]", "y [m]", "yaw [rad]", "v [m s^-1]", "w [rad s^-1]")
_COVARIANCE = (
    *("cov_x_x [m^2]", "cov_x_y [m^2]", "cov_x_yaw [m rad]"),
    *("cov_y_y [m^2]", "cov_y_yaw [m rad]", "cov_yaw_yaw [rad^2]"),
    *("cov_v_v [m^2 s^-2]", "cov_w_w [rad^2 s^-2]"),
)


class Odometry(Series):
    """Counts ticks of the wheels and adds up where the rover would be in the plane.

    The wheels of each side together have a speed, whose mean is the rover's and whose difference
    over the track (times the assumed skid) its turn rate: skid steering, of any number of wheels on
    rockers or not. It follows an arc from sample to sample. Pose and twist are of base_link, where
    it was at the first sample.
    """

    kind: ClassVar[str] = "odometry"
    folder: ClassVar[str] = "odometry"
    sensor: OdometrySensor

    def check(self) -> None:
        """Refuse rovers that have no wheels on either side, and another place than base_link's.

        Raises:
            RecipeError: naming the sensor.
        """
        moved = self.sensor.position.any() or self.sensor.rpy.any()
        if self.sensor.link != self.sensor.ROOT or moved:
            raise RecipeError(
                f"{self.sensor.name!r}: odometry tells where base_link is: leave out link, "
                "position_m and rpy_deg",
                key=("sensors",),
            )
        sides = {side > 0.0 for side in self.setting.world.rover.wheel_centres.reshape(-1, 3)[:, 1]}
        if len(sides) < 2:
            raise RecipeError(
                f"{self.sensor.name!r}: odometry needs a rover with wheels on both sides",
                key=("sensors",),
            )

    def streams(self) -> tuple[Stream, ...]:
        """One table."""
        return (Stream(name="data", suffix=".csv", figures={"columns": list(self.samples())}),)

    def calibration(self) -> dict[str, Any]:
        """What the odometer takes the rover to be, and what the encoders count."""
        rover, sensor = self.setting.world.rover, self.sensor
        return {
            "wheels": [wheel.link for wheel in rover.wheels],
            "wheel_radii": rover.wheel_radii.tolist(),
            "track": self._track,
            "ticks_per_turn": sensor.ticks_per_turn,
            "assumed_slip": sensor.assumed_slip,
            "assumed_skid_gain": sensor.assumed_skid_gain,
        }

    def samples(self) -> dict[str, NDArray[Any]]:
        """Ticks and rate of each wheel, pose from 0, speed and turn rate, and covariances."""
        wheels, sensor = self.setting.world.rover.wheels, self.sensor
        tick = 2.0 * math.pi / sensor.ticks_per_turn
        key = np.uint64(mix(self.setting.key(sensor), _PHASE))
        ticks = np.floor(self._angles / tick + uniforms(key, len(wheels))).astype(np.int64)
        ticks -= ticks[0]
        step = np.diff(self.times) / NANOSECONDS
        turned = np.diff(ticks, axis=0) * tick
        rates = np.concatenate([np.zeros((1, len(wheels))), turned / step[:, None]])
        added = self._added(turned, step)
        columns: dict[str, NDArray[Any]] = {}
        for n, wheel in enumerate(wheels):
            columns[f"ticks_{wheel.link} []"] = ticks[:, n]
        for n, wheel in enumerate(wheels):
            columns[f"rate_{wheel.link} [rad s^-1]"] = rates[:, n]
        return columns | dict(zip((*_POSE, *_COVARIANCE), added.T, strict=True))

    @property
    def _left(self) -> NDArray[np.bool_]:
        return np.asarray(self.setting.world.rover.wheel_centres[:, 1] > 0.0)

    @property
    def _track(self) -> float:
        """Distance of the left wheels' middle from that of the right ones [m]."""
        aside = self.setting.world.rover.wheel_centres[:, 1]
        return float(aside[self._left].mean() - aside[~self._left].mean())

    @cached_property
    def _angles(self) -> Array:
        """True angles of the wheels [rad], forwards positive, shape [measurements, wheels]."""
        motion, times = self.setting.motion, self.times / NANOSECONDS
        if motion.wheels is not None:
            looks = motion.base.begin + motion.base.step * np.arange(len(motion.wheels))
            columns = [np.interp(times, looks, column) for column in motion.wheels.T]
            return np.stack(columns, axis=1)
        return self._slipped(times)

    def _slipped(self, times: Array) -> Array:
        """Angles of wheels that slip along a path: hubs run ahead by their slip."""
        rover, sensor = self.setting.world.rover, self.sensor
        finer = max(1, math.ceil(_FINEST / sensor.rate_hz))
        moments = np.interp(
            np.arange((len(times) - 1) * finer + 1) / finer, np.arange(len(times)), times
        )
        state = self.setting.motion.base.at(moments)
        forwards = (state.rotation[:, :, 0] * state.velocity).sum(axis=1)
        aside = sensor.skid_gain * rover.wheel_centres[:, 1]
        hubs = forwards[:, None] - state.rate[:, 2:] * aside
        slip = np.full(hubs.shape, sensor.slip)
        if sensor.slip_noise:
            key = np.uint64(mix(self.setting.key(sensor), _SLIP))
            _vary(key, moments / _ALIKE, sensor.slip_noise, slip)
        rates = hubs / (rover.wheel_radii * (1.0 - np.minimum(slip, 0.99)))
        steps = 0.5 * np.diff(moments)[:, None] * (rates[:-1] + rates[1:])
        angles = np.concatenate([np.zeros((1, hubs.shape[1])), np.cumsum(steps, axis=0)])
        return np.asarray(angles[::finer])

    def _added(self, turned: Array, step: Array) -> Array:
        """Pose, twist and covariances of each sample, shape [measurements, 13].

        Errors of the wheels' speeds that are alike for a second add up to a random walk of a
        pose; twists have them as they are, and the ticks' rounding besides.
        """
        rover, sensor, left = self.setting.world.rover, self.sensor, self._left
        rolled = turned * rover.wheel_radii * (1.0 - sensor.assumed_slip)
        width = self._track * sensor.assumed_skid_gain
        sides = rolled[:, left].mean(axis=1), rolled[:, ~left].mean(axis=1)
        ahead, turn = 0.5 * (sides[0] + sides[1]), (sides[1] - sides[0]) / width
        rounding = 2.0 * math.pi / sensor.ticks_per_turn * rover.wheel_radii / math.sqrt(6.0)
        powers = [
            (((sensor.assumed_noise * rolled[:, side]) ** 2).mean(axis=1) / side.sum(),
             (rounding[side] ** 2).mean() / side.sum())
            for side in (left, ~left)
        ]  # fmt: skip
        slips = powers[0][0] + powers[1][0]
        variance = slips + powers[0][1] + powers[1][1]
        found = np.zeros((len(step) + 1, 13))
        found[1:, 3], found[1:, 4] = ahead / step, turn / step
        found[1:, 11] = 0.25 * variance / step**2
        found[1:, 12] = variance / (width * step) ** 2
        both = (powers[1][0] - powers[0][0]) / (2.0 * width)
        own = np.stack([0.25 * slips, slips / width**2, both], axis=1)
        _add_up(ahead, turn, own * (_POWER / step)[:, None], found)
        return found


@kernel
def _vary(key, times, deviation, slip):  # type: ignore[no-untyped-def]
    """Add to each wheel's slip a number that changes smoothly from one whole time to the next."""
    for wheel in range(slip.shape[1]):
        own = mix(key, wheel)
        for n in range(len(times)):
            cell = np.int64(np.floor(times[n]))
            part = times[n] - cell
            before, after = normal(mix(own, cell)), normal(mix(own, cell + 1))
            mixed = (1.0 - part) * before + part * after
            slip[n, wheel] += deviation * mixed / np.sqrt((1.0 - part) ** 2 + part**2)


@kernel
def _add_up(ahead, turn, powers, found):  # type: ignore[no-untyped-def]
    """Pose along arcs, and its covariance, by that of each step: ahead, of its turn, of both."""
    x = y = yaw = xx = xy = xt = yy = yt = tt = 0.0
    for n in range(len(ahead)):
        half = 0.5 * turn[n]
        chord = ahead[n] * (np.sin(half) / half if abs(half) > 1e-6 else 1.0)
        c, s = np.cos(yaw + half), np.sin(yaw + half)
        x, y, yaw = x + chord * c, y + chord * s, yaw + turn[n]
        # The covariance before, carried on by what a wrong heading makes of this step.
        a, b = -chord * s, chord * c
        xx, xy, yy = (
            xx + 2.0 * a * xt + a * a * tt,
            xy + a * yt + b * xt + a * b * tt,
            yy + 2.0 * b * yt + b * b * tt,
        )
        xt, yt = xt + a * tt, yt + b * tt
        # And this step's own, whose heading is wrong by half of its turn's error.
        p, q, r = powers[n, 0], powers[n, 1], powers[n, 2]
        xx += c * c * p + c * a * r + 0.25 * a * a * q
        xy += c * s * p + 0.5 * (c * b + s * a) * r + 0.25 * a * b * q
        yy += s * s * p + s * b * r + 0.25 * b * b * q
        xt += c * r + 0.5 * a * q
        yt += s * r + 0.5 * b * q
        tt += q
        row = found[n + 1]
        row[0], row[1], row[2] = x, y, yaw
        row[5], row[6], row[7], row[8], row[9], row[10] = xx, xy, xt, yy, yt, tt
