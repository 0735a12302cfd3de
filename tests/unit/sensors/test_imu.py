"""An IMU measures the motion's own derivatives, and errs as its data sheet says."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.base import DataError, RecipeError
from terrain_forge.model import ImuSensor, Trajectory, sensor_kinds
from terrain_forge.sensors import (
    Curve,
    Motion,
    Setting,
    allan_deviation,
    instrument_kinds,
    motion_of_path,
)
from terrain_forge.sensors.instruments.imu import COLUMNS, Imu
from tests.helpers import rovers, worlds

_G = 3.711
_IDEAL = ImuSensor.PRESETS["ideal"]


def imu(motion, *, seed=1, **figures):
    """An IMU on base_link of a motion, on Mars."""
    world = worlds.world().replace(rover=rovers.morpheus())
    sensor = ImuSensor(**{"name": "imu", **figures})
    return Imu(sensor, Setting(world=world, motion=motion, scenery=None, gravity=_G, seed=seed))


def read(motion, **figures):
    """Rates and specific forces, shape [n, 3] each."""
    told = imu(motion, **figures).samples()
    assert tuple(told) == COLUMNS
    values = np.stack(list(told.values()), axis=1)
    return values[:, :3], values[:, 3:]


def resting(seconds, rpy=(0.0, 0.0, 0.0)):
    samples = np.tile([1.0, 2.0, 3.0, *rpy], (2, 1))
    return Motion(path="p", source="path", base=Curve(begin=0.0, step=seconds, samples=samples))


def circling(radius=2.0, speed=0.5, seconds=20.0):
    """A level circle to the left; samples so near that the spline is the circle."""
    t = np.arange(0.0, seconds + 0.01, 0.01)
    angle = speed / radius * t
    flat = np.zeros_like(t)
    place = radius * np.sin(angle), -radius * np.cos(angle), flat, flat, flat, angle
    base = Curve(begin=0.0, step=0.01, samples=np.stack(place, axis=1))
    return Motion(path="p", source="path", base=base)


@pytest.fixture(scope="module")
def wavy():
    t = np.arange(0.0, 30.0, 1.0 / 12.0)
    place = np.stack([2 * np.cos(0.3 * t), 2 * np.sin(0.3 * t), 0.05 * np.sin(2 * t)], axis=-1)
    turn = np.stack([0.05 * np.sin(3 * t), 0.04 * np.cos(2.2 * t), 0.3 * t + 1.57], axis=-1)
    path = Trajectory(name="wave", time=t, position=place, rpy=turn, closed=False)
    return motion_of_path(path, still=1.0)


def test_at_rest_it_feels_gravity_upwards():
    rate, force = read(resting(1.0), **_IDEAL)
    assert np.all(rate == 0.0)
    np.testing.assert_allclose(force, np.tile([0, 0, _G], (len(force), 1)), atol=1e-12)
    tilted = resting(1.0, rpy=(0.1, -0.2, 2.0))
    rate, force = read(tilted, **_IDEAL, rpy_deg=(10.0, 20.0, 30.0))
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), _G, atol=1e-9)
    assert force[0] == pytest.approx(tilted.base.at(0.0).rotation[0].T[:, 2] * _G, abs=2.0)


def test_on_a_circle_it_feels_the_pull_inwards():
    """v²/r at base_link, and ω² times the arm more or less beside it."""
    motion = circling()
    omega = 0.5 / 2.0
    for aside in (0.0, 0.7, -0.4):
        rate, force = read(motion, **_IDEAL, position_m=(0.3, aside, 0.5))
        middle = slice(100, -100)
        np.testing.assert_allclose(rate[middle], [[0, 0, omega]] * len(rate[middle]), atol=1e-8)
        wanted = [-(omega**2) * 0.3, omega**2 * (2.0 - aside), _G]
        np.testing.assert_allclose(force[middle], [wanted] * len(rate[middle]), atol=1e-6)


def integrated(motion, rate):
    """How far samples without errors lead off the truth: place [m] and turn [rad]."""
    turned, force = read(motion, **_IDEAL, rate_hz=rate, position_m=(0.2, 0.1, 0.4))
    device = imu(motion, **_IDEAL, rate_hz=rate, position_m=(0.2, 0.1, 0.4))
    truth = device.state(device.times * 1e-9)
    turn, place, speed = truth.rotation[0], truth.position[0], truth.velocity[0]
    step, down = 1.0 / rate, np.array([0.0, 0.0, -_G])
    for n in range(len(force) - 1):
        x, y, z = 0.5 * step * (turned[n] + turned[n + 1])
        angle = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        part = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
        after = turn @ (np.eye(3) + part[0] * cross + part[1] * cross @ cross)
        push = 0.5 * (turn @ force[n] + after @ force[n + 1]) + down
        place = place + step * speed + 0.5 * step**2 * push
        speed, turn = speed + step * push, after
    error = truth.rotation[-1].T @ turn
    return np.linalg.norm(place - truth.position[-1]), np.linalg.norm(error - np.eye(3))


def test_samples_lead_back_to_the_motion_by_the_second_order(wavy):
    (coarse, turned), (fine, turned_less) = integrated(wavy, 50.0), integrated(wavy, 100.0)
    assert coarse / fine == pytest.approx(4.0, abs=0.4)
    assert turned / turned_less == pytest.approx(4.0, abs=0.4)
    assert fine < 0.02


@pytest.fixture(scope="module")
def night():
    """Four hours at rest, of a device whose walk shows at 1000 s."""
    walk = {"gyro_walk": 2e-6, "accelerometer_walk": 3e-5}
    return imu(resting(14400.0), rate_hz=25.0, **walk)


def test_the_allan_deviation_is_the_data_sheets(night):
    sensor = night.sensor
    values = np.stack(list(night.samples().values()), axis=1)
    times, found = allan_deviation(values, 25.0, [1.0, 1000.0])
    assert list(times) == [1.0, 1000.0]
    white = np.repeat([sensor.gyro_noise, sensor.accelerometer_noise], 3)
    walk = np.repeat([sensor.gyro_walk, sensor.accelerometer_walk], 3)
    np.testing.assert_allclose(found[0], white, rtol=0.02)
    wanted = np.sqrt(white**2 / 1000 + walk**2 * 1000 / 3)
    own = 1 / np.sqrt(2 * (14400 / 1000 - 1))
    assert np.all(np.abs(found[1] / wanted - 1) < 3 * own)
    assert walk[0] ** 2 * 1000 / 3 > white[0] ** 2 / 1000  # the walk is what shows


def test_the_allan_deviation_of_a_ramp_and_of_one_step_in_closed_form():
    times, found = allan_deviation(3.0 * np.arange(1000) / 10.0, 10.0)
    np.testing.assert_allclose(found, 3.0 * times / np.sqrt(2), rtol=1e-9)
    _, one = allan_deviation(np.tile([1.0, -1.0], 500), 10.0, [0.1, 0.2])
    np.testing.assert_allclose(one, [np.sqrt(2), 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("samples", "rate", "message"),
    [
        ([1.0, 2.0], 0.0, "rate 0.0 Hz: must be one number above 0"),
        ([1.0, 2.0], -1.0, "rate -1.0 Hz: must be one number above 0"),
        ([1.0, 2.0], "fast", "the rate must be numbers"),
        ([1.0, np.nan], 10.0, "samples must be finite"),
        (1.0, 10.0, r"samples of shape \(\)"),
    ],
)
def test_an_allan_deviation_of_no_samples_or_rate_is_refused(samples, rate, message):
    with pytest.raises(DataError, match=message):
        allan_deviation(samples, rate)


def test_noise_is_white_and_its_own_for_each_axis_seed_and_name():
    told = {"gyro_walk": 0.0, "accelerometer_walk": 0.0, "rate_hz": 100.0}
    device = imu(resting(1000.0), **told)
    values = np.stack(list(device.samples().values()), axis=1)
    values = (values - values.mean(axis=0)) / values.std(axis=0)
    limit = 4.0 / np.sqrt(len(values))
    assert np.abs(np.corrcoef(values.T) - np.eye(6)).max() < limit
    for lag in (1, 2, 7):
        assert np.abs((values[lag:] * values[:-lag]).mean(axis=0)).max() < limit
    assert abs((values**3).mean()) < 4 * np.sqrt(15 / values.size)
    assert abs((values**4).mean() - 3) < 4 * np.sqrt(96 / values.size)
    for other in (imu(resting(1000.0), seed=2, **told), imu(resting(1000.0), name="b", **told)):
        first = other.samples()[COLUMNS[0]]
        assert abs(np.corrcoef(values[:, 0], first)[0, 1]) < limit


def test_a_shorter_recording_begins_with_the_same_bytes():
    long, short = imu(resting(300.0)), imu(resting(110.0))
    count = len(short.times)
    for name, column in short.samples().items():
        assert column.tobytes() == long.samples()[name][:count].tobytes()
    chosen = long.times[[3, 20_000, 50_000]]
    told = long.biases(chosen)
    assert told.shape == (3, 6)
    assert np.abs(np.diff(told, axis=0)).min() > 0


def test_what_is_drawn_once_is_told(wavy):
    """Bias, scale, misalignment and g-sensitivity: a straight function of the true values."""
    errors = {
        "gyro_bias": 0.01, "gyro_scale": 0.02, "gyro_g_sensitivity": 1e-3,
        "accelerometer_bias": 0.1, "accelerometer_scale": 0.03, "misalignment": 0.01,
    }  # fmt: skip
    true = np.hstack(read(wavy, **_IDEAL))
    device = imu(wavy, **_IDEAL | errors)
    found = np.stack(list(device.samples().values()), axis=1)
    told = device.calibration()
    response = np.reshape(told["true_response"], (6, 6))
    np.testing.assert_allclose(found, true @ response.T + told["true_bias_at_start"], atol=1e-12)
    assert np.all(response[3:, :3] == 0)
    many = [imu(wavy, seed=s, **_IDEAL | errors).calibration() for s in range(300)]
    drawn = np.array([np.reshape(one["true_response"], (6, 6)) - np.eye(6) for one in many])
    assert drawn[:, :3, 3:].std() == pytest.approx(1e-3, rel=0.05)
    assert drawn[:, [3, 4, 5], [3, 4, 5]].std() == pytest.approx(0.03, rel=0.1)
    assert drawn[:, [0, 1, 5], [1, 2, 4]].std() == pytest.approx(0.01, rel=0.1)
    starts = np.array([one["true_bias_at_start"] for one in many])
    assert starts[:, :3].std() == pytest.approx(0.01, rel=0.1)


def test_it_rounds_and_cuts(wavy):
    limits = {"gyro_step": 0.01, "gyro_range": 0.25, "accelerometer_range": 2.0}
    rate, force = read(wavy, **_IDEAL | limits)
    np.testing.assert_allclose(rate / 0.01, np.rint(rate / 0.01), atol=1e-9)
    assert rate.max() == 0.25
    assert force[:, 2].min() == force[:, 2].max() == 2.0


def test_a_bandwidth_halves_the_power_at_its_frequency():
    """A roll that swings at 5 Hz, seen by an IMU of 5 Hz: its amplitude is √½, late by 90°."""
    t = np.arange(0.0, 20.0, 0.002)
    samples = np.zeros((len(t), 6))
    samples[:, 3] = 0.01 * np.sin(2 * np.pi * 5 * t)
    base = Curve(begin=0.0, step=0.002, samples=samples)
    motion = Motion(path="p", source="path", base=base)
    true, _ = read(motion, **_IDEAL, rate_hz=500.0)
    seen, _ = read(motion, **_IDEAL | {"bandwidth_hz": 5.0}, rate_hz=500.0)
    settled = slice(2500, 9500)
    phase = np.exp(-2j * np.pi * 5 * np.arange(len(true)) / 500)[settled]
    answer = (seen[settled, 0] @ phase) / (true[settled, 0] @ phase)
    assert abs(answer) == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert np.angle(answer) == pytest.approx(-np.pi / 2, abs=0.02)
    _, still = read(resting(1.0), **_IDEAL | {"bandwidth_hz": 5.0})
    np.testing.assert_allclose(still[:, 2], _G, atol=1e-12)


@pytest.mark.parametrize("kind", ["imu", "inclinometer", "odometry", "sun_sensor"])
def test_a_drive_is_not_sampled_faster_than_it_was_logged(kind):
    sensor = sensor_kinds()[kind](name="one", rate_hz=200.0)
    measures = instrument_kinds()[kind]
    measures.require_logged(sensor, 0.005)
    with pytest.raises(RecipeError, match=r"'one': rate_hz 200 is more than .* 12 Hz"):
        measures.require_logged(sensor, 1.0 / 12.0)
