"""Wheel odometry, Sun sensor and inclinometer on motions whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.base import RecipeError
from terrain_forge.model import InclinometerSensor, OdometrySensor, SunSensor
from terrain_forge.sensors import Curve, Motion, Scenery, Setting
from terrain_forge.sensors.instruments.inclinometer import Inclinometer
from terrain_forge.sensors.instruments.odometry import Odometry
from terrain_forge.sensors.instruments.sun_sensor import SunSensing
from tests.helpers import rovers, worlds

_EXACT = {"slip": 0.0, "slip_noise": 0.0, "skid_gain": 1.0, "assumed_skid_gain": 1.0}
_TICKS = 10_000_000


@pytest.fixture(scope="module")
def world():
    return worlds.with_horizon(worlds.world().replace(rover=rovers.morpheus()))


def arc(radius=3.0, speed=0.2, seconds=30.0, lift=0.0, source="path", wheels=None):
    """A level arc to the left from (1, 2), heading east, so finely sampled that it is one."""
    t = np.arange(0.0, seconds + 0.025, 0.05)
    angle, flat = speed / radius * t, np.zeros_like(t)
    x, y = 1.0 + radius * np.sin(angle), 2.0 + radius * (1.0 - np.cos(angle))
    samples = np.stack([x, y, flat + lift, flat, flat, angle], axis=1)
    base = Curve(begin=0.0, step=0.05, samples=samples)
    return Motion(path="arc", source=source, base=base, wheels=wheels)


def setting(world, motion, *, seed=1, scenery=None):
    return Setting(world=world, motion=motion, scenery=scenery, gravity=3.711, seed=seed)


def odometer(world, motion, seed=1, **figures):
    sensor = OdometrySensor(**{"name": "wheels", **figures})
    return Odometry(sensor, setting(world, motion, seed=seed))


def test_wheels_that_do_not_slip_lead_along_the_path(world):
    device = odometer(world, arc(), **_EXACT, ticks_per_turn=_TICKS)
    told, angle = device.samples(), 0.2 / 3.0 * device.times * 1e-9
    np.testing.assert_allclose(told["x [m]"], 3 * np.sin(angle), atol=2e-5)
    np.testing.assert_allclose(told["y [m]"], 3 * (1 - np.cos(angle)), atol=2e-5)
    np.testing.assert_allclose(told["yaw [rad]"], angle, atol=1e-5)
    np.testing.assert_allclose(told["v [m s^-1]"][100:-100], 0.2, atol=2e-4)
    np.testing.assert_allclose(told["w [rad s^-1]"][100:-100], 0.2 / 3.0, atol=1e-3)


def test_slip_and_skid_lengthen_and_turn_by_what_is_not_made_up_for(world):
    """1 / (1 - s) of the distance; turning by the gain over the assumed one."""
    slips = {**_EXACT, "slip": 0.1, "skid_gain": 2.0, "ticks_per_turn": _TICKS}
    true = odometer(world, arc(), **_EXACT, ticks_per_turn=_TICKS).samples()
    found = odometer(world, arc(), **slips).samples()
    ahead = found["v [m s^-1]"][100:-100] / true["v [m s^-1]"][100:-100]
    np.testing.assert_allclose(ahead, 1 / 0.9, rtol=2e-3)
    assert found["yaw [rad]"][-1] / true["yaw [rad]"][-1] == pytest.approx(2 / 0.9, rel=1e-4)
    right = slips | {"assumed_slip": 0.1, "assumed_skid_gain": 2.0}
    made_up = odometer(world, arc(), **right).samples()
    for name in ("x [m]", "y [m]", "yaw [rad]"):
        np.testing.assert_allclose(made_up[name], true[name], atol=1e-4)


def test_ticks_are_whole_and_count_the_wheels_of_a_drive(world):
    """Each wheel its own turns, forwards positive; a tick is late by less than one."""
    rates = np.linspace(0.5, 1.5, len(world.rover.wheels))
    looks = np.arange(601)[:, None] * 0.05
    device = odometer(
        world, arc(source="drive", wheels=looks * rates), rate_hz=20.0, ticks_per_turn=100
    )
    told = device.samples()
    for wheel, rate in zip(world.rover.wheels, rates, strict=True):
        ticks = told[f"ticks_{wheel.link} []"]
        assert ticks.dtype == np.int64
        assert ticks[0] == 0
        wanted = rate * device.times * 1e-9 * 100 / (2 * np.pi)
        assert np.abs(ticks - wanted).max() < 1.0
        mean = told[f"rate_{wheel.link} [rad s^-1]"][1:].mean()
        assert mean == pytest.approx(rate, rel=2 * np.pi / 100 / (rate * 30))


def test_slip_varies_by_its_deviation_and_hangs_on_the_seed(world):
    told = {**_EXACT, "slip_noise": 0.05, "ticks_per_turn": _TICKS, "rate_hz": 20.0}
    drawn = [odometer(world, arc(radius=1e6), seed=s, **told).samples() for s in range(10)]
    rates = [f"rate_{wheel.link} [rad s^-1]" for wheel in world.rover.wheels]
    radius = world.rover.wheel_radii[0]
    slips = np.array([1 - 0.2 / (radius * one[name][5:-5]) for one in drawn for name in rates])
    assert slips.std() == pytest.approx(0.05, rel=0.1)
    assert abs(slips.mean()) < 4 * 0.05 / np.sqrt(len(slips) * 30)
    again = odometer(world, arc(radius=1e6), seed=3, **told).samples()
    assert all(again[name].tobytes() == column.tobytes() for name, column in drawn[3].items())
    short = odometer(world, arc(radius=1e6, seconds=20.0), seed=3, **told).samples()
    np.testing.assert_allclose(short["x [m]"], drawn[3]["x [m]"][: len(short["x [m]"])], atol=1e-6)


def test_the_covariance_is_that_of_what_it_says(world):
    """Over many slips the pose at the end spreads as its covariance tells."""
    told = {"slip_noise": 0.03, "assumed_noise": 0.03, "ticks_per_turn": _TICKS, "rate_hz": 10.0}
    motion = arc(seconds=40.0)
    told = [odometer(world, motion, seed=s, **_EXACT | told).samples() for s in range(150)]
    ends = np.array([[one[n][-1] for n in ("x [m]", "y [m]", "yaw [rad]")] for one in told])
    names = ("x_x [m^2]", "y_y [m^2]", "yaw_yaw [rad^2]")
    wanted = np.sqrt([told[0][f"cov_{name}"][-1] for name in names])
    ratio = ends.std(axis=0) / wanted
    assert np.all(np.abs(ratio - 1) < 0.2), ratio
    matrix = np.array([[told[0][f"cov_{n}"][-1] for n in row] for row in (
        ("x_x [m^2]", "x_y [m^2]", "x_yaw [m rad]"),
        ("x_y [m^2]", "y_y [m^2]", "y_yaw [m rad]"),
        ("x_yaw [m rad]", "y_yaw [m rad]", "yaw_yaw [rad^2]"),
    )])  # fmt: skip
    assert np.linalg.eigvalsh(matrix).min() > 0
    correlated = np.corrcoef(ends.T)[0, 2], matrix[0, 2] / np.sqrt(matrix[0, 0] * matrix[2, 2])
    assert correlated[0] == pytest.approx(correlated[1], abs=0.2)


def test_a_rover_without_wheels_has_no_odometry(world):
    bare = world.replace(rover=worlds.world().rover)
    with pytest.raises(RecipeError, match="'wheels': odometry needs a rover with wheels on both"):
        odometer(bare, arc()).check()
    odometer(world, arc()).check()
    for figures in ({"position_m": (0.1, 0, 0)}, {"rpy_deg": (0, 10, 0)}):
        with pytest.raises(RecipeError, match="'wheels': odometry tells where base_link is"):
            odometer(world, arc(), **figures).check()


def tilted(roll, pitch, push=0.0):
    """A frame that keeps its roll and pitch, heads north, and speeds up along its path."""
    t = np.arange(0.0, 10.05, 0.1)
    flat = np.zeros_like(t)
    place = np.stack([flat, 0.5 * push * t**2, flat + 30, flat + roll, flat + pitch, flat], axis=1)
    place[:, 5] = np.pi / 2
    return Motion(path="p", source="path", base=Curve(begin=0.0, step=0.1, samples=place))


def inclined(world, motion, **figures):
    clean = {"noise_deg": 0.0, "bias_deg": 0.0}
    sensor = InclinometerSensor(**{"name": "tilt", **clean, **figures})
    return np.stack(list(Inclinometer(sensor, setting(world, motion)).samples().values()), axis=1)


def test_an_inclinometer_tells_roll_and_pitch_at_rest_and_leans_when_pushed(world):
    still = inclined(world, tilted(0.2, -0.3))
    np.testing.assert_allclose(still, [[0.2, -0.3]] * len(still), atol=1e-9)
    pushed = inclined(world, tilted(0.0, 0.0, push=0.4))[20:-20]
    np.testing.assert_allclose(pushed, [[0.0, -np.arctan2(0.4, 3.711)]] * len(pushed), atol=1e-6)
    noisy = inclined(world, tilted(0.2, 0.1), noise_deg=0.5, rate_hz=100.0)
    assert np.degrees(noisy.std(axis=0)) == pytest.approx(0.5, rel=0.1)
    cut = inclined(world, tilted(0.2, -0.3), range_deg=10.0, step_deg=1.0)
    assert np.degrees(cut[5]) == pytest.approx([10.0, -10.0])


def sighted(world, motion, **figures):
    sensor = SunSensor(**{"name": "sun", "noise_deg": 0.0, **figures})
    with Scenery(world, motion) as scenery:
        device = SunSensing(sensor, setting(world, motion, scenery=scenery))
        table = np.stack(list(device.samples().values()), axis=1)
        return table, device.state(device.times * 1e-9).rotation


def test_a_sun_sensor_points_at_the_sun_of_the_world(world):
    sun = world.lighting.towards_sun
    table, turn = sighted(world, tilted(0.2, -0.3), fov_deg=360.0, position_m=(0, 0, 2))
    assert np.all(table[:, 3] == 1)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", turn, table[:, :3]), [sun] * len(table))
    noisy, _ = sighted(world, tilted(0.2, -0.3), fov_deg=360.0, position_m=(0, 0, 2),
                       noise_deg=1.0, rate_hz=100.0)  # fmt: skip
    np.testing.assert_allclose(np.linalg.norm(noisy[:, :3], axis=1), 1.0, atol=1e-12)
    angle = np.arccos(noisy[:, :3] @ table[0, :3])
    assert np.degrees(np.sqrt((angle**2).mean() / 2)) == pytest.approx(1.0, rel=0.1)


def test_it_is_blind_where_the_sun_is_outside_hidden_or_down(world):
    high = 90.0 - np.degrees(world.lighting.sun_elevation)
    above, around = {"position_m": (0, 0, 2)}, tilted(0.0, 0.0)
    for wider, seen in ((1.0, 1), (-1.0, 0)):
        table, _ = sighted(world, around, fov_deg=2 * high + wider, **above)
        assert np.all(table[:, 3] == seen)
    assert not table.any()  # and tells nothing else
    below, _ = sighted(world, around, fov_deg=360.0, position_m=(0, 0, -40.0))
    assert not below.any()
    # Under the rover's body, whose shadow it stands in.
    shaded, _ = sighted(
        world, around, fov_deg=360.0, position_m=(0, 0, world.rover.clearance - 0.02)
    )
    assert not shaded.any()
    night = world.replace(lighting=world.lighting.replace(sun_elevation=-0.1))
    table, _ = sighted(night, around, fov_deg=360.0, **above)
    assert not table.any()
    with Scenery(world, around) as scenery:
        sunk = SunSensor(name="sun", position_m=(0, 0, -40))
        with pytest.raises(RecipeError, match=r"'sun' is .* m below the ground"):
            SunSensing(sunk, setting(world, around, scenery=scenery)).check()
