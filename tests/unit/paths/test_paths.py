"""Routes and trajectories."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from terrain_forge.base import DataError, RecipeError
from terrain_forge.model import Heightfield, Trajectory
from terrain_forge.paths import (
    PathSpec,
    Spline,
    make_trajectory,
    overhang,
    plan_route,
    require_inside,
)
from terrain_forge.paths.cubic import cubic_spline
from terrain_forge.paths.spec import Corridor, Shake
from terrain_forge.rovers import find_rover
from tests.helpers import worlds

ROVER = find_rover("morpheus")
RANDOM = np.random.default_rng(3)
SQUARE = ((-8.0, -5.0), (8.0, -5.0), (8.0, 5.0), (-8.0, 5.0))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("count", [2, 3, 4, 5, 40, 300])
def test_splines_are_those_of_scipy_to_the_bit(count, closed):
    """Uneven knots make its equations exchange rows, too."""
    points = RANDOM.normal(size=(count, 2)) * 100.0
    points = np.vstack([points, points[:1]]) if closed else points
    knots = np.concatenate([[0.0], np.cumsum(10.0 ** RANDOM.uniform(-2, 2, len(points) - 1))])
    theirs = CubicSpline(knots, points, bc_type="periodic" if closed else "natural")
    ours = cubic_spline(knots, points, closed=closed)
    at = np.concatenate([knots, np.linspace(0.0, knots[-1], 1001)])
    assert np.array_equal(ours(at), theirs(at))
    assert np.array_equal(ours.derivative()(at), theirs.derivative()(at))


def path(**changes):
    fields = {"name": "p", "route": Spline(points_m=SQUARE, closed=True), "speed_m_s": 0.4}
    return PathSpec(**fields | changes)


def plane(rise_east, rise_north):
    axis = np.arange(-20, 20.25, 0.25)
    z = rise_east * axis[None, :] + rise_north * axis[:, None]
    return Heightfield(elevation=z, spacing=0.25, origin=(-20.0, -20.0))


def lay(spec, ground):
    route = plan_route(spec, rover=ROVER, driven=True)
    return route, make_trajectory(route, spec=spec, ground=ground, rover=ROVER, seed=3)


def test_route_goes_through_its_points_smoothly():
    route = plan_route(path(), rover=ROVER, driven=True)
    for point in SQUARE:
        assert np.linalg.norm(route.position - point, axis=1).min() < 0.02
    steps = np.linalg.norm(np.diff(route.position, axis=0), axis=1)
    assert steps.max() < 0.03
    assert route.length == pytest.approx(steps.sum())
    turn = route.heading[-1] - route.heading[0]
    assert turn == pytest.approx(2 * np.pi, abs=1e-6)
    assert np.abs(np.diff(route.heading)).max() < 0.05


def test_corridor_only_where_driven():
    assert plan_route(path(), rover=ROVER, driven=False).corridor_width == 0.0
    assert plan_route(path(), rover=ROVER, driven=True).corridor_width > ROVER.width
    chosen = path(corridor=Corridor(width_m=1.2))
    assert plan_route(chosen, rover=ROVER, driven=False).corridor_width == 1.2


def test_route_that_leaves_or_stands_still_is_refused():
    route = plan_route(path(), rover=ROVER, driven=True)
    require_inside(route, size=(24.0, 16.0), rover=ROVER)
    with pytest.raises(RecipeError, match="leaves the terrain"):
        require_inside(route, size=(17.0, 16.0), rover=ROVER)
    twice = Spline(points_m=((0.0, 0.0), (0.0, 0.0), (1.0, 1.0)))
    with pytest.raises(RecipeError, match="are the same"):
        plan_route(path(route=twice), rover=ROVER, driven=True)


def test_route_at_the_very_edge_is_laid():
    route = plan_route(path(), rover=ROVER, driven=True)
    excess, _ = overhang(route, bounds=(-12.0, -8.0, 12.0, 8.0), rover=ROVER)
    bounds = tuple(np.array([-12.0, -8.0, 12.0, 8.0]) + excess * np.array([-1, -1, 1, 1]))
    excess, _ = overhang(route, bounds=bounds, rover=ROVER)
    assert excess == pytest.approx(0.0, abs=1e-12)


def test_speed_rate_and_return():
    spec = path(rate_hz=12.0, shake=Shake(rms_deg=0.2))
    route, track = lay(spec, worlds.ground())
    assert np.allclose(np.diff(track.time), 1 / 12)
    assert route.length / track.time[-1] == pytest.approx(0.4, rel=2e-3)
    assert np.allclose(track.position[0], track.position[-1], atol=1e-6)
    difference = track.rpy[-1] - track.rpy[0]
    assert np.allclose(difference, (0.0, 0.0, 2 * np.pi), atol=1e-6)


def test_tilt_follows_the_plane():
    """On a plane that rises east, driving east is nose up: pitch is negative."""
    spec = path(route=Spline(points_m=((-5.0, 0.0), (0.0, 0.0), (5.0, 0.0))))
    _, track = lay(spec, plane(0.2, 0.1))
    x = track.position[:, 0]
    assert np.allclose(track.position[:, 2], 0.2 * x, atol=1e-6)
    assert np.allclose(track.rpy[:, 1], -np.arctan(0.2), atol=1e-6)
    assert np.all(track.rpy[:, 0] > 0.09)  # the left side, north, is higher: rolled to the right
    normal = np.cross((1, 0, 0.2), (0, 1, 0.1))
    w, i, j, k = track.quaternion[5]
    up = np.array([2 * (i * k + w * j), 2 * (j * k - w * i), 1 - 2 * (i * i + j * j)])
    assert np.allclose(up, normal / np.linalg.norm(normal), atol=1e-6)


def test_shake_has_its_strength_and_band():
    still = lay(path(), plane(0.0, 0.0))[1]
    shaken = lay(path(shake=Shake(rms_deg=0.5, cutoff_hz=1.5)), plane(0.0, 0.0))[1]
    noise = np.degrees(shaken.rpy - still.rpy)[:-1]
    assert np.sqrt(np.mean(noise**2, axis=0)) == pytest.approx([0.5] * 3, rel=1e-6)
    power = np.abs(np.fft.rfft(noise, axis=0)) ** 2
    above = np.fft.rfftfreq(len(noise), 1 / 12) > 1.5
    assert power[above].sum() < 1e-9 * power.sum()


def test_a_trajectory_ends_where_its_samples_do():
    track = Trajectory(
        name="line",
        time=np.arange(5.0),
        position=np.outer(np.arange(5.0), [1.0, 0.0, 0.0]),
        rpy=np.zeros((5, 3)),
        closed=False,
    )
    assert track.at([0.0 - 1e-9, 4.0 + 1e-9]).position[:, 0] == pytest.approx([0.0, 4.0], abs=1e-8)
    assert len(track.at([]).position) == 0
    for time in (-0.01, [1.0, 4.01], np.nan):
        with pytest.raises(DataError, match=r"'line' lasts from 0\.000000 to 4\.000000 s"):
            track.at(time)
    with pytest.raises(DataError, match=r"time of shape \(2, 2\), a number or a row of them"):
        track.at(np.ones((2, 2)))


def test_trajectory_is_twice_differentiable():
    track = lay(path(), worlds.ground())[1]
    time = np.linspace(1.0, 60.0, 500)
    now, later = track.at(time), track.at(time + 1e-4)
    assert np.allclose((later.position - now.position) / 1e-4, now.velocity, atol=2e-3)
    assert np.allclose((later.velocity - now.velocity) / 1e-4, now.acceleration, atol=5e-2)
