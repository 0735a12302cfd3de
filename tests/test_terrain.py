"""The ground's layers: statistics, orientation, window identity."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.seeds import stage_key
from terrain_forge.site import Image, Window
from terrain_forge.terrain.ground import shape_ground
from terrain_forge.terrain.layer import layer_types
from terrain_forge.terrain.layers import fractal
from terrain_forge.terrain.layers.displacement_map import DisplacementMap
from terrain_forge.terrain.layers.fractal import Fractal
from terrain_forge.terrain.noise import octaves
from tests import worlds


def deviation(heights, lag):
    """RMS height difference over a lag, both directions."""
    east, north = heights[:, lag:] - heights[:, :-lag], heights[lag:] - heights[:-lag]
    return np.sqrt(0.5 * (np.mean(east**2) + np.mean(north**2)))


@pytest.mark.parametrize("hurst", [0.5, 0.7])
def test_fractal_has_its_structure_function(hurst):
    site = worlds.site().replace(size=(300.0, 300.0), spacing=0.25)
    layer = Fractal(hurst=hurst, deviation_1m_m=0.1, longest_wavelength_m=512.0)
    ground = shape_ground(site=site, window=site.window, layers=(layer,))
    heights = ground.elevation.astype(float)
    for lag in (4, 8, 16, 32):
        expected = 0.1 * (lag * 0.25) ** hurst
        assert deviation(heights, lag) == pytest.approx(expected, rel=0.08)


def test_structure_table_of_the_noise():
    """The table of the fractal layer, measured again on a fine grid."""
    axis = np.arange(0, 96, 1 / 16)
    noise = octaves(
        stage_key(9, "table"), east=axis, north=axis, wavelengths=np.ones(1), amplitudes=np.ones(1)
    )
    for n in (-8, -6, -4, -2, 0, 2, 4, 6):
        lag = round(16 * 2 ** (n / 2))
        measured = deviation(noise, lag) ** 2
        assert fractal._structure(np.array(lag / 16)) == pytest.approx(measured, rel=0.08)


def test_fractal_of_a_window_is_the_cut():
    site = worlds.site()
    layers = (Fractal(), Fractal(hurst=0.9, longest_wavelength_m=3.0))
    whole = shape_ground(site=site, window=site.window, layers=layers)
    window = Window(column=31, row=17, columns=40, rows=29)
    part = shape_ground(site=site, window=window, layers=layers)
    assert np.array_equal(part.elevation, whole.elevation[17:47, 31:72])
    other = shape_ground(site=site.replace(seed=2), window=window, layers=layers)
    assert not np.array_equal(part.elevation, other.elevation)


def test_displacement_map_covers_the_site_north_up():
    site = worlds.site()
    rows, columns = site.window.rows + 1, site.window.columns + 1
    values = np.random.default_rng(0).random((rows, columns))
    site = site.replace(images=(Image(path="a.png", values=values),))
    layer = DisplacementMap(image="a.png", height_m=0.4, zero_level=0.5)
    ground = shape_ground(site=site, window=site.window, layers=(layer,))
    assert np.abs(ground.elevation - 0.4 * (values - 0.5)).max() < 1e-6


def test_displacement_map_in_tiles_repeats():
    values = np.random.default_rng(0).random((16, 16))
    site = worlds.site().replace(images=(Image(path="a.png", values=values),))
    layer = DisplacementMap(image="a.png", height_m=1.0, tile_m=(4.0, 4.0))
    z = shape_ground(site=site, window=site.window, layers=(layer,)).elevation
    assert np.abs(z[:, 16:] - z[:, :-16]).max() < 1e-5
    assert np.abs(z[16:] - z[:-16]).max() < 1e-5


def test_layers_are_found_by_their_module():
    kinds = [kind.kind for kind in layer_types()]
    assert {"fractal", "displacement_map"} <= set(kinds)
    assert len(kinds) == len(set(kinds))
