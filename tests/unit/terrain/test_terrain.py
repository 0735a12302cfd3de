"""The ground's layers: statistics, orientation, window identity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terrain_forge.base import stage_key
from terrain_forge.making import plan
from terrain_forge.model import Image, Roughness, Window
from terrain_forge.pipeline import check
from terrain_forge.recipe import load_recipe
from terrain_forge.terrain import Fractal, layer_types, shape_ground
from terrain_forge.terrain.layers import fractal
from terrain_forge.terrain.layers.displacement_map import DisplacementMap
from terrain_forge.terrain.noise import octaves
from tests.helpers import worlds
from tests.helpers.places import ROOT

GALLERY = ROOT / "docs" / "gallery"


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


@pytest.mark.parametrize("hurst", [0.3, 0.57, 0.8, 0.95])
@pytest.mark.parametrize("spacing", [0.1, 0.25, 0.5])
def test_flat_sites_are_as_rough_as_the_law(hurst, spacing):
    """From one spacing up to a quarter of the longest wavelength, whatever H and spacing."""
    site = worlds.site().replace(size=(100.0, 100.0), spacing=spacing)
    wavelengths = Fractal().octaves(site)
    factors = fractal.octave_amplitudes(
        Roughness(hurst=hurst, deviation=0.05, source=""), wavelengths
    )
    factors *= fractal.end_factors(hurst, wavelengths, baselines=(1.0, spacing))
    for baseline in (spacing, 2 * spacing, 3 * spacing, 1.0, 2.0, 4.0, 8.0):
        squares = factors**2 * fractal.structure_function(baseline / wavelengths)
        expected = 0.05 * baseline**hurst
        assert np.sqrt(squares.sum()) == pytest.approx(expected, rel=0.05 if baseline > 4 else 0.02)


@pytest.mark.parametrize(
    ("layer", "expected"),
    [
        (Fractal(hurst=0.95, deviation_1m_m=0.05), 0.05),
        (Fractal(hurst=0.7, deviation_1m_m=0.05), 0.05),
        (Fractal(preset="lunar_highlands"), 0.129),
        (Fractal(hurst=0.9, rms_slope=fractal.RmsSlope(slope_deg=5, baseline_m=8)), 0.6999),
    ],
)
def test_roughness_that_is_asked_for_is_made(layer, expected):
    """RMS of four grounds, whose scatter is 2 % each, over the baseline that is stated."""
    baseline = 1.0 if layer.rms_slope is None else layer.rms_slope.baseline_m
    found = []
    for seed in range(4):
        site = worlds.site().replace(size=(250.0, 250.0), spacing=0.5, seed=seed)
        ground = shape_ground(site=site, window=site.window, layers=(layer,))
        found.append(deviation(ground.elevation.astype(float), round(baseline / 0.5)))
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(expected, rel=0.03)


def test_waves_that_no_node_shows_are_told():
    site = worlds.site().replace(spacing=0.5)
    for longest, adds in ((0.37, False), (0.4, True)):
        layer = Fractal(deviation_1m_m=0.1, longest_wavelength_m=longest)
        ground = shape_ground(site=site, window=site.window, layers=(layer,))
        assert bool(np.ptp(ground.elevation)) == adds
        warnings = [told for word, told in layer.facts(site) if word == "warning"]
        assert bool(warnings) != adds
    told = dict(Fractal(longest_wavelength_m=0.37).facts(site))["warning"]
    assert "adds nothing: its longest waves, 0.37 m, are below 0.375 m" in told


def test_a_finer_grid_keeps_the_longer_waves():
    """Spacing decides on the last octaves only: sampled coarsely, grounds are nearly alike."""
    coarse, fine = (worlds.site().replace(size=(60.0, 60.0), spacing=s) for s in (0.5, 0.25))
    layer = Fractal(hurst=0.8, deviation_1m_m=0.05)
    one = shape_ground(site=coarse, window=coarse.window, layers=(layer,)).elevation
    other = shape_ground(site=fine, window=fine.window, layers=(layer,)).elevation[::2, ::2]
    assert np.std(one - other) < 0.03 * np.std(one)


def test_structure_table_of_the_noise():
    """The table of the fractal layer, measured again on a fine grid."""
    axis = np.arange(0, 96, 1 / 16)
    noise = octaves(
        stage_key(9, "table"), east=axis, north=axis, wavelengths=np.ones(1), amplitudes=np.ones(1)
    )
    for n in (-8, -6, -4, -2, 0, 2, 4, 6):
        lag = round(16 * 2 ** (n / 2))
        measured = deviation(noise, lag) ** 2
        assert fractal.structure_function(np.array(lag / 16)) == pytest.approx(measured, rel=0.08)


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


def test_spectrum_of_a_grid_too_small_for_one_is_empty():
    from terrain_forge.terrain import radial_spectrum

    for side in (2, 3, 6):
        number, density = radial_spectrum(np.random.default_rng(1).normal(size=(side, side)), 1.0)
        assert len(number) == len(density) == 0
    assert np.isfinite(radial_spectrum(np.eye(7), 1.0)[1]).all()


@pytest.mark.parametrize("path", sorted(GALLERY.glob("*.yaml")), ids=lambda path: path.stem)
def test_sites_of_the_gallery_can_be_made_and_are_drawn(path):
    site = plan(path)
    part = Window(column=100, row=100, columns=60, rows=60)
    ground = shape_ground(site=site, window=part, layers=site.recipe.terrain.layers)
    assert np.ptp(ground.elevation) > 0.02
    for kind in ("hillshade", "slope", "view"):
        assert 0 < (GALLERY / f"{path.stem}_{kind}.png").stat().st_size < 400_000


def test_check_tells_the_roughness_that_is_made():
    """That fitted to the DTM only where a layer takes it."""
    recipe = load_recipe(ROOT / "recipes" / "hello.yaml", changes=("dtm.noise=keep",)).recipe

    def told(*layers):
        changed = replace(recipe, terrain=replace(recipe.terrain, layers=layers))
        lines = check(changed, folder=ROOT / "recipes")
        return [line.split(maxsplit=1)[1] for line in lines if line.startswith("  roughness")]

    (fitted,) = told(Fractal())
    assert "(the recipe)" not in fitted
    own = Fractal(hurst=0.8, deviation_1m_m=0.02)
    assert told(own) == ["H = 0.80, 2 cm at 1 m (the recipe)"]
    assert told(own, Fractal()) == ["H = 0.80, 2 cm at 1 m (the recipe)", fitted]
    assert told() == []
