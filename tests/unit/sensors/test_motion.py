"""The motion that all sensors share: derivatives, mounts, a start without a jolt."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.base import DataError
from terrain_forge.model import Trajectory
from terrain_forge.sensors import Curve, motion_of_path
from terrain_forge.sensors.instrument import on_moving_link

_TIME = np.arange(0.0, 30.0, 1.0 / 12.0)
_DELTA = 1e-4


def _place(t):
    return np.stack([2 * np.cos(0.3 * t), 2 * np.sin(0.3 * t), 0.05 * np.sin(2 * t)], axis=-1)


def _turn(t):
    return np.stack([0.05 * np.sin(3 * t), 0.04 * np.cos(2.2 * t), 0.3 * t + 1.57], axis=-1)


@pytest.fixture(scope="module")
def trajectory():
    return Trajectory(
        name="wave", time=_TIME, position=_place(_TIME), rpy=_turn(_TIME), closed=False
    )


def _agree(state):
    """Whether three states a moment apart have the derivatives that they tell."""
    for value, derivative in (("position", "velocity"), ("velocity", "acceleration")):
        found = np.diff(getattr(state, value)[[0, 2]], axis=0)[0] / (2 * _DELTA)
        assert found == pytest.approx(getattr(state, derivative)[1], abs=1e-7)
    turning = state.rotation[1].T @ (state.rotation[2] - state.rotation[0]) / (2 * _DELTA)
    found = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
    assert found == pytest.approx(state.rate[1], abs=1e-7)
    found = (state.rate[2] - state.rate[0]) / (2 * _DELTA)
    assert found == pytest.approx(state.rate_change[1], abs=1e-7)


_MOMENTS = 11.03 + _DELTA * np.array([-1.0, 0.0, 1.0])


def test_a_state_has_the_derivatives_of_one_curve(trajectory):
    state = motion_of_path(trajectory, ramp=0.0).base.at(_MOMENTS)
    _agree(state)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    _agree(state.at_mount(np.array([0.3, -0.1, 0.8]), turn))


def test_a_link_that_moves_against_a_moving_base_has_them_too(trajectory):
    t = _TIME
    places = np.stack([0.3 + 0.05 * np.sin(t), 0.1 * np.cos(t), 0.8 + 0 * t], axis=-1)
    link = Curve(begin=0.0, step=1 / 12, samples=np.hstack([places, 0.3 * _turn(1.3 * t)]))
    base = motion_of_path(trajectory, ramp=0.0).base
    _agree(on_moving_link(base.at(_MOMENTS), link.at(_MOMENTS)))


def test_the_curve_goes_through_the_path(trajectory):
    curve = motion_of_path(trajectory, ramp=0.0).base
    between = _TIME[5:-5] + 0.04
    assert curve.at(between).position == pytest.approx(_place(between), abs=1e-5)


def test_a_corner_does_not_ring():
    x = np.concatenate([np.arange(100) * 0.01, np.full(100, 1.0)])
    samples = np.zeros((200, 6))
    samples[:, 0] = x
    found = Curve(begin=0.0, step=0.1, samples=samples).at(np.linspace(0, 19.9, 2000))
    assert found.position[:, 0].max() < 1.0 + 0.07 * 0.01
    speed = found.velocity[:, 0]
    assert -0.008 < speed.min()
    assert speed.max() < 0.108


def test_it_stands_still_then_starts_and_stops_without_a_jolt(trajectory):
    motion = motion_of_path(trajectory, still=3.0, ramp=2.0)
    assert motion.end == pytest.approx(30 - 1 / 12 + 6 + 2 + 8 / 12, abs=0.1)
    still = motion.base.at([0.0, 1.5, 2.999, motion.end - 2.999, motion.end])
    assert np.abs(still.velocity).max() < 1e-12
    assert np.abs(still.acceleration).max() < 1e-10
    assert np.abs(still.rate).max() < 1e-12
    at = np.linspace(0.0, motion.end, 20_000)
    jerk = np.diff(motion.base.at(at).acceleration, axis=0) / (at[1] - at[0])
    assert np.abs(jerk).max() < 3.0


def test_a_path_too_short_to_start_on_is_refused(trajectory):
    short = trajectory.replace(
        time=_TIME[:5], position=trajectory.position[:5], rpy=trajectory.rpy[:5]
    )
    with pytest.raises(DataError, match=r"lasts 0\.333 s, starting and stopping takes 2 s"):
        motion_of_path(short, still=1.0)
    with pytest.raises(DataError, match="the motion lasts from"):
        motion_of_path(trajectory).base.at(99.0)
