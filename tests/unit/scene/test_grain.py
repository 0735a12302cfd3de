"""Soil finer than the ground's grid: as rough as measured, crumbs with shadows behind them."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from terrain_forge.scene import ground_grain, relief
from terrain_forge.scene.packets import LANES
from terrain_forge.scene.pebbles import clast_lanes

KEY, COUNT, SPACING = np.uint64(77), 60_000, 0.25


@njit
def grain_at(places, share, pixel, slabs=0.0):
    """Brightness, rise east and north at places [m], shape [n, 3]."""
    found = np.empty((len(places), 3))
    for n in range(len(places)):
        grain = share, 1.0, slabs
        found[n] = ground_grain(KEY, grain, places[n, 0], places[n, 1], SPACING, pixel)
    return found


@njit
def pictured(places, share, pixel, about):
    """Depth of shadows, rise east and north at places [m] as pictures have them, shape [n, 3]."""
    space, found = np.zeros(relief.RELIEF_ROWS * LANES, np.float32), np.empty((len(places), 3))
    for n in range(0, len(places), LANES):
        lanes = space.reshape(-1, LANES)
        for row, told in ((relief.FOOTPRINT, pixel), (relief.ROUGH, 1.0), (relief.PEBBLY, share)):
            lanes[row // LANES] = told
        lanes[relief.PLACE_X // LANES : relief.PLACE_Y // LANES + 1] = places[n : n + LANES].T
        relief.soil_lanes(space, about, about.soil, about.soil_keys)
        clast_lanes(space, about)
        for column, row in enumerate((relief.SHADOWED, relief.RISE_X, relief.RISE_Y)):
            found[n : n + LANES, column] = lanes[row // LANES]
    return found


def pictured_in(sun, places, share, pixel):
    """Those where things of unit height have their shadows' ends so far from the foot [m]."""
    told = {"key": KEY, "spacing": SPACING, "rough": 0.1, "shadow": tuple(sun)}
    return pictured(places, share, pixel, relief.relief_about(np.zeros(2), **told))


def places(seed=5):
    return np.random.default_rng(seed).uniform(-40.0, 40.0, (COUNT, 2))


@pytest.mark.parametrize(
    ("pixel", "degrees"),
    [
        pytest.param(0.03, 5.0, marks=pytest.mark.slow),
        pytest.param(0.01, 9.0, marks=pytest.mark.slow),
        (0.005, 13.0),
        (0.002, 19.0),
        (0.001, 24.0),
    ],
)
def test_soil_is_as_rough_as_measured_with_crumbs_or_without(pixel, degrees):
    for share in (0.0, 0.6):
        rise = grain_at(places(), share, pixel)[:, 1:]
        tilt = np.degrees(np.arctan(np.hypot(*rise.T)))
        assert np.sqrt((tilt**2).mean()) == pytest.approx(degrees, rel=0.25)


@pytest.mark.slow
def test_a_low_sun_has_longer_shadows():
    shade = [pictured_in((sun, 0), places(), 0.6, 0.002)[:, 0].mean() for sun in (0, 1, 3)]
    assert shade[0] < 0.5 * shade[1]
    assert shade[1] < shade[2]


def test_shadows_lie_on_the_side_that_the_sun_does_not_see():
    """Ground in a crumb's shadow has the crumb between itself and the Sun: it rises towards it."""
    step = 0.002
    for turn in (0.3, 2.0, 4.4):
        to_sun = np.array([np.cos(turn), np.sin(turn)])
        here = places()
        shade = pictured_in(1.5 * to_sun, here, 0.6, 0.001)[:, 0]
        near, behind = (
            pictured_in(1.5 * to_sun, here + side * step * to_sun, 0.6, 0.001)
            for side in (1.0, -1.0)
        )
        dark = shade > 0.5
        assert 0.02 < dark.mean() < 0.4
        assert near[dark, 1:].mean(axis=0) @ to_sun > 0.1
        assert abs(behind[~dark, 1:].mean(axis=0) @ to_sun) < 0.05


def test_ground_without_pebbles_has_no_shadows():
    assert pictured_in((3.0, 0.0), places(), 0.0, 0.002)[:, 0].max() == 0.0


def test_slabs_fade_where_pixels_are_as_large():
    """Else each pixel would have the colour of another slab: noise, far away."""
    here = places()[:20_000]
    added = [
        np.std(grain_at(here, 0.0, pixel, 1.0) - grain_at(here, 0.0, pixel))
        for pixel in (0.1, 0.45, 0.62, 3.0)
    ]
    assert added[0] > 2.0 * added[1] > 0.0
    assert added[2:] == [0.0, 0.0]


@pytest.mark.parametrize("spacing", [0.05, 0.11, 0.5, 2.0])
def test_soil_is_as_steep_on_the_land_beyond_a_level_site(spacing):
    """Waves that the site has as soil are no part of what the land has for the site's heights."""
    shadow = 0.0, 0.0
    about = relief.relief_about(np.zeros(2), key=KEY, spacing=spacing, rough=0.0, shadow=shadow)
    steep = about.far[about.far[:, 3] > 0.0]
    shared = min(len(steep), len(about.soil))
    assert shared >= 5
    assert steep[:shared, 0] == pytest.approx(about.soil[:shared, 0])
    assert steep[:shared, 3] == pytest.approx(about.soil[:shared, 3])
    assert about.far[0, 0] >= relief.SOIL_COARSEST
