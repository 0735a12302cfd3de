"""Measures tables of sensors: `python benchmarks/inertial.py [-n SAMPLES]`.

A rover drives a winding path. Prints, for an IMU, wheel odometry and an inclinometer of so many
samples, the wall time of the first and of later tables, then how the Allan deviation of an IMU at
rest agrees with its figures. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from exports import made_world
from run import model, spread

from terrain_forge.model import ImuSensor, InclinometerSensor, OdometrySensor, Sensor
from terrain_forge.rovers import find_rover
from terrain_forge.sensors import Curve, Motion, Series, Setting, allan_deviation, instrument_kinds

_STEP = 1.0 / 12.0
_REPEATS = 5


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=1_000_000, help="samples of each")
    count = parser.parse_args().n
    print(f"{model()}; {count} samples")
    print(f"{'':<16}{'first, s':>10}{'later, s':>24}")
    sensors = ImuSensor(name="i", position_m=(0.2, 0.1, 0.4)), OdometrySensor(name="o")
    for sensor in (*sensors, InclinometerSensor(name="t")):
        setting = measured(winding(count / sensor.rate_hz))
        taken = []
        for _ in range(_REPEATS):
            begin = time.perf_counter()
            series(sensor, setting).samples()
            taken.append(time.perf_counter() - begin)
        print(f"{sensor.kind:<16}{taken[0]:>10.2f}{spread(taken[1:], 2):>24}")
    imu = ImuSensor(name="i", rate_hz=100.0)
    told = series(imu, measured(resting(count / imu.rate_hz))).samples()
    times, found = allan_deviation(np.stack(list(told.values()), axis=1), imu.rate_hz, [1.0])
    white = np.repeat([imu.gyro_noise, imu.accelerometer_noise], 3)
    walk = np.repeat([imu.gyro_walk, imu.accelerometer_walk], 3)
    wanted = np.sqrt(white**2 + walk**2 / 3.0)
    print(f"Allan deviation at {times[0]:g} s over that of its figures: {found[0] / wanted}")


def measured(motion: Motion) -> Setting:
    """A setting that casts no rays."""
    world = made_world(33, 0).replace(rover=find_rover("skid4"))
    return Setting(world=world, motion=motion, scenery=None, gravity=3.7, seed=1)  # type: ignore[arg-type]


def series(sensor: Sensor, setting: Setting) -> Series:
    """The instrument of a sensor that is one table."""
    found = instrument_kinds()[sensor.kind](sensor, setting)
    assert isinstance(found, Series)
    return found


def winding(seconds: float) -> Motion:
    """A motion of some length that turns about all axes."""
    t = np.arange(0.0, seconds + _STEP, _STEP)
    place = 0.1 * t, 2.0 * np.sin(0.1 * t), 0.03 * np.cos(0.7 * t)
    turn = 0.05 * np.sin(t), 0.04 * np.cos(t), 0.5 * np.cos(0.1 * t)
    base = Curve(begin=0.0, step=_STEP, samples=np.stack([*place, *turn], axis=1))
    return Motion(path="winding", source="path", base=base)


def resting(seconds: float) -> Motion:
    """A motion that is none."""
    base = Curve(begin=0.0, step=seconds, samples=np.zeros((2, 6)))
    return Motion(path="resting", source="path", base=base)


if __name__ == "__main__":
    main()
