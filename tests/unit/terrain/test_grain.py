"""Detail that has the direction of the ground that it continues."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from terrain_forge.dtm.grain import find_grain
from terrain_forge.dtm.roughness import fit_roughness
from terrain_forge.model import MARS, Window
from terrain_forge.terrain import Fractal, rms_deviation, shape_ground
from tests.helpers import worlds
from tests.unit.terrain.test_continuation import natural_surface


@cache
def ridges(angle, count=96):
    """Ground that is drawn out: roughest along the angle from the columns towards the rows."""
    white = np.random.default_rng(6).normal(size=(count, count))
    down, across = np.fft.fftfreq(count)[:, None], np.fft.rfftfreq(count)[None, :]
    along = np.cos(angle) * across + np.sin(angle) * down
    aside = -np.sin(angle) * across + np.cos(angle) * down
    number = np.hypot(along, 5.0 * aside)
    number[0, 0] = np.inf
    heights = np.fft.irfft2(np.fft.rfft2(white) * number**-1.7, s=(count, count))
    heights *= 0.1 / rms_deviation(heights, 1)
    heights.setflags(write=False)
    return heights


def site_of(heights, *, north_up=False, spacing=0.25):
    rows = -1.0 if north_up else 1.0
    middle = 0.5 * (len(heights) - 1)
    patch = worlds.patch(heights, (1.0, 0.0, middle, 0.0, rows, middle))
    roughness = fit_roughness(heights, 1.0, MARS)
    return worlds.site().replace(size=(30.0, 30.0), spacing=spacing, dtm=patch, roughness=roughness)


def directions(ground):
    """Difference over sum of the mean square increments: east and north, then both diagonals."""
    z = ground.astype(float)
    steps = [
        z[:, 2:] - 2.0 * z[:, 1:-1] + z[:, :-2],
        z[2:] - 2.0 * z[1:-1] + z[:-2],
        z[2:, 2:] - 2.0 * z[1:-1, 1:-1] + z[:-2, :-2],
        z[2:, :-2] - 2.0 * z[1:-1, 1:-1] + z[:-2, 2:],
    ]
    east, north, rising, falling = (float(np.mean(step**2)) for step in steps)
    return (east - north) / (east + north), (rising - falling) / (rising + falling)


@pytest.mark.parametrize("north_up", [False, True])
@pytest.mark.parametrize("degrees", [0.0, 45.0, 90.0, 110.0])
def test_detail_has_the_direction_of_the_ground(degrees, north_up):
    angle = np.radians(degrees)
    site = site_of(ridges(angle), north_up=north_up)
    assert site.roughness.grain is not None
    bare, whole = (
        shape_ground(site=site, window=site.window, layers=layers).elevation
        for layers in ((), (Fractal(),))
    )
    found = np.array(directions(whole - bare))
    wanted = np.array([np.cos(2.0 * angle), np.sin(2.0 * angle)])
    if north_up:  # rows of such a raster run south
        wanted[1] *= -1.0
    assert found @ wanted > 0.35
    assert abs(found @ [wanted[1], -wanted[0]]) < 0.2


def test_ground_without_direction_has_none():
    surface = natural_surface(128, 0.7, seed=5)
    assert find_grain(surface, np.ones(surface.shape, bool)) is None
    assert site_of(surface).roughness.grain is None


def test_drawn_out_detail_is_as_high_as_any():
    """The mean over directions of the increments stays."""
    site = site_of(ridges(np.radians(45.0)))
    plain = site.replace(roughness=site.roughness.replace(grain=None))
    heights = [
        shape_ground(site=one, window=one.window, layers=(Fractal(),)).elevation.astype(float)
        for one in (site, plain)
    ]
    assert rms_deviation(heights[0], 1) == pytest.approx(rms_deviation(heights[1], 1), rel=0.1)


def test_window_is_the_cut_where_the_ground_has_a_direction():
    turn = np.radians(30.0)
    site = site_of(gaussian_filter(ridges(turn), 0.4))
    whole = shape_ground(site=site, window=site.window, layers=(Fractal(),)).elevation
    window = Window(column=17, row=40, columns=50, rows=33)
    part = shape_ground(site=site, window=window, layers=(Fractal(),)).elevation
    assert np.array_equal(part, whole[40:74, 17:68])
