"""The controller by itself: legs, corners, skidding, easing."""

import math

import numpy as np
import pytest

from terrain_forge.driving import eased
from terrain_forge.driving.controller import (
    RIM_ACCELERATION,
    TURN_RATE,
    PlanarPath,
    PurePursuit,
    SkidGain,
    wheel_rates,
    wheels_turn_rate,
)
from terrain_forge.model import Trajectory
from tests.helpers.rovers import morpheus, skid4
from tests.unit.driving.test_drive import drive_through, line, path, plain

CORNER = np.vstack([np.linspace((-3, -3), (3, -3), 61), np.linspace((3, -2.9), (3, 3), 60)])


def with_a_stop():
    """East for 4 m, a spot turn to the north of 5 s, north for 2 m."""
    time = np.array([0.0, 10.0, 15.0, 20.0])
    position = np.array([(0, 0, 0), (4, 0, 0), (4, 0, 0), (4, 2, 0)], float)
    yaw = np.array([0.0, 0.0, math.pi / 2, math.pi / 2])
    rpy = np.column_stack([0 * yaw, 0 * yaw, yaw])
    return Trajectory(
        name="stop", time=time, position=position, rpy=rpy, closed=False,
        spot_turns=np.array([[10.0, 15.0]]),
    )  # fmt: skip


def test_spot_turns_of_a_trajectory_are_corners():
    found = PlanarPath.of(with_a_stop())
    assert found.corners == pytest.approx([4.0])
    assert found.speed == pytest.approx(6.0 / 15.0)
    assert [found.leg(n) for n in (0, 1)] == [(0.0, 4.0), (4.0, 6.0)]


def test_sharp_bends_are_corners_and_smooth_ones_are_not():
    assert PlanarPath.of(path(CORNER)).corners == pytest.approx([6.0])
    angle = np.linspace(0, 2 * np.pi, 60)
    circle = path(np.column_stack([np.cos(angle), np.sin(angle)]))
    assert len(PlanarPath.of(circle).corners) == 0
    assert PlanarPath.of(circle).bend(2.0, end=6.0) == pytest.approx(1.0, rel=0.25)


def test_the_rover_stops_at_a_corner_and_turns_there():
    pursuit = PurePursuit(PlanarPath.of(path(CORNER)))
    pursuit.progress = 5.9
    speed, turn = pursuit.command(np.array([2.8, -3.0]), 0.0)
    assert (speed > 0.0, turn) == (True, pytest.approx(0.0, abs=1e-6))
    assert pursuit.command(np.array([2.99, -3.0]), 0.0) == (0.0, TURN_RATE)
    assert pursuit.command(np.array([2.99, -3.0]), 1.0) == (0.0, TURN_RATE)
    assert pursuit.command(np.array([2.99, -3.0]), 1.55) == (0.0, 0.0)
    speed, _ = pursuit.command(np.array([3.0, -2.8]), math.pi / 2)
    assert speed > 0.0
    assert pursuit.progress == pytest.approx(6.2)


def test_a_corner_is_turned_at_its_point(tmp_path):
    result = drive_through(plain(path(CORNER[30:91])), tmp_path)
    assert result.completed
    assert result.largest_cross_track < 0.25


def test_tight_bends_are_driven_slower():
    angle = np.linspace(0, np.pi, 100)
    arc = path(0.8 * np.column_stack([np.sin(angle), 1 - np.cos(angle)]), speed=1.0)
    speed, turn = PurePursuit(PlanarPath.of(arc)).command(np.zeros(2), 0.0)
    assert speed < 0.6
    assert abs(turn) <= TURN_RATE + 1e-9


def test_the_skid_gain_is_learned_and_not_fooled_by_noise():
    random = np.random.default_rng(3)
    skid = SkidGain()
    assert skid.value == 2.0
    for n in range(3000):
        wheels = 0.4 * math.sin(0.05 * n)
        skid.note(wheels=wheels, rover=wheels / 1.5 + random.normal(0, 0.2), time=0.02)
    assert skid.value == pytest.approx(1.5, rel=0.1)
    for _ in range(10_000):
        skid.note(wheels=0.0, rover=random.normal(0, 0.2), time=0.02)
    assert skid.value == pytest.approx(2.0, rel=0.02)


def test_wheels_turn_as_they_were_asked():
    rover = morpheus()
    assert wheels_turn_rate(rover, wheel_rates(rover, 0.2, 0.1, gain=1.7)) == pytest.approx(0.17)
    assert wheels_turn_rate(rover, np.full(6, 3.0)) == pytest.approx(0.0)


def test_rates_change_evenly_and_no_faster_than_allowed():
    rover = morpheus()
    wanted = wheel_rates(rover, 0.4, 0.1)
    first = eased(rover, wanted, np.zeros(6), time=0.02)
    assert np.abs(first * 0.14).max() == pytest.approx(RIM_ACCELERATION * 0.02)
    np.testing.assert_allclose(first / wanted, (first / wanted)[0])
    np.testing.assert_array_equal(eased(rover, wanted, wanted + 1e-4, time=0.02), wanted)


def test_four_wheels_are_driven_like_six(tmp_path):
    """Nothing of the drive knows the rover but its record."""
    angle = np.linspace(0, np.pi / 2, 100)
    half = path(2 * np.column_stack([np.cos(angle), np.sin(angle)]))
    result = drive_through(plain(half).replace(rover=skid4()), tmp_path)
    assert result.completed
    assert len(result.wheels) == 4
    assert result.joints == ()
    assert result.largest_cross_track < 0.1
    assert 1.2 < result.skid_gain < 3.0


def test_axles_may_point_to_either_side(tmp_path):
    """A rover whose right wheels turn about the right drives the same way."""
    rover = skid4()
    turned = tuple(
        link.replace(axis=-link.axis) if link.name.endswith("right") else link
        for link in rover.links
    )
    rover = rover.replace(links=turned)
    assert sum(link.axis[1] < 0 for link in rover.links) == 2
    result = drive_through(plain(line((-1, 0), (1, 0))).replace(rover=rover), tmp_path)
    assert result.completed
    assert result.largest_cross_track < 0.02
    assert (result.wheel_rate[20] > 0.5).all()
    assert result.mean_slip < 0.1


def test_a_path_that_does_not_move_is_refused():
    still = line((0, 0), (1, 0))
    with pytest.raises(ValueError, match="does not move"):
        PlanarPath.of(still.replace(position=0 * still.position))
