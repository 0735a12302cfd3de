"""Detail that continues a DTM: means kept, spectrum joined, the same in every window."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from terrain_forge.base import portable
from terrain_forge.dtm import ArrayDtm, dtm_heights, survey
from terrain_forge.dtm.increments import expected_increment, mean_square_increment
from terrain_forge.dtm.point_posts import are_points
from terrain_forge.dtm.roughness import HURST_LIMITS, HURST_PRIOR, fit_roughness
from terrain_forge.model import MARS, MOON, DtmPatch, Roughness, Window
from terrain_forge.recipe import recipe_json
from terrain_forge.terrain import (
    Fractal,
    radial_spectrum,
    rms_deviation,
    shape_ground,
    terrain_statistics,
)
from terrain_forge.terrain.layers.fractal import PRESETS, RmsSlope
from terrain_forge.terrain.statistics import spectral_exponent
from terrain_forge.terrain.terrain_figure import write_terrain_figure
from tests.helpers import worlds
from tests.helpers.places import DATA, SAMPLES

JEZERO = DATA / "mars" / "jezero_hirise_3p69m_1024.tif"
GALE = DATA / "mars" / "gale_hirise_floor_5m_200_envi.bin"
EIGHT_BITS = DATA / "mars" / "marssim_flatsmars_513_8bit.png"
MOON_ALL = DATA / "moon" / "LDEM_4.LBL"


def block_means(heights, n):
    rows, columns = heights.shape[0] // n, heights.shape[1] // n
    return heights[: rows * n, : columns * n].reshape(rows, n, columns, n).mean(axis=(1, 3))


@cache
def natural_surface(count, hurst, seed, *, fine=4):
    """Self-affine pixel means with ν(1) = 1: an independent spectral synthesis, averaged."""
    size = 2 * count * fine
    number = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    number[0, 0] = np.inf
    white = np.random.default_rng(seed).standard_normal((size, size))
    heights = np.fft.irfft2(np.fft.rfft2(white) * number ** -(hurst + 1.0))[
        : size // 2, : size // 2
    ]
    # Second increments, since a spectral synthesis lacks long waves.
    everywhere = np.ones(heights.shape, bool)
    law = (4.0 - 4.0**hurst) * 16.0**hurst
    heights /= np.sqrt(mean_square_increment(heights, 4 * fine, everywhere) / law)
    means = block_means(heights, fine)
    means.setflags(write=False)
    return means


def continued(means, *, factor, posting=4.0, margin=8, layer=None, **changes):
    """Site and heights [m] at the middles of factor × factor parts of each pixel."""
    spacing = posting / factor
    rows, columns = (n - 2 * margin for n in means.shape)
    size = ((columns * factor - 1) * spacing, (rows * factor - 1) * spacing)
    spec = ArrayDtm(posting_m=posting, size_m=size)
    found = survey(spec, body=MARS, folder=Path(), heights=means)
    site = worlds.site().replace(size=size, spacing=spacing, **(vars(found) | changes))
    layers = (Fractal() if layer is None else layer,)
    ground = shape_ground(site=site, window=site.window, layers=layers)
    return site, ground.elevation.astype(float) + site.datum_height


def layered(site, *layers):
    """A site whose recipe has these layers."""
    recipe = site.recipe
    terrain = replace(recipe.terrain, layers=layers)
    return site.replace(recipe_json=recipe_json(replace(recipe, terrain=terrain)))


@pytest.mark.parametrize("hurst", [0.55, 0.9])
def test_exponent_and_amplitude_of_a_known_surface(hurst):
    heights = natural_surface(256, hurst, seed=2)
    found = fit_roughness(heights, 1.0, MARS)
    assert found.exponent[0] == pytest.approx(hurst, abs=0.06)
    assert found.exponent[1] < 0.06
    assert found.deviation == pytest.approx(1.0, rel=0.12)


def test_exponent_is_kept_within_nature():
    rough = np.random.default_rng(1).normal(size=(256, 256))
    assert fit_roughness(rough, 1.0, MARS).hurst == HURST_LIMITS[0]
    east, north = np.meshgrid(np.arange(256.0), np.arange(256.0))
    smooth = np.sin(east / 30.0) * np.sin(north / 40.0)
    assert fit_roughness(smooth, 1.0, MARS).hurst == 0.95


def test_smoothed_dtm_is_fitted_where_it_resolves():
    from scipy.ndimage import gaussian_filter

    heights = gaussian_filter(natural_surface(256, 0.6, seed=4), 1.0)
    found = fit_roughness(heights, 1.0, MARS)
    assert found.resolved > 1
    assert found.exponent[0] < 0.95
    assert fit_roughness(natural_surface(256, 0.6, seed=4), 1.0, MARS).resolved == 1


def test_small_dtm_says_as_much_as_it_knows():
    """Its exponent is weighed against those of other sites by its standard error."""
    heights = natural_surface(128, 0.9, seed=3)
    found = fit_roughness(heights[:30, :90], 1.0, MARS)
    fitted, error = found.exponent
    mean, scatter = HURST_PRIOR
    weight = scatter**2 / (scatter**2 + error**2)
    # A little more, where it rises towards the posting.
    assert 0.0 <= found.hurst - (weight * fitted + (1.0 - weight) * mean) <= 0.125 + 1e-9
    assert "preset of 0.75, moved to" in found.source
    assert "30 posts" in found.source
    assert "fitted to the DTM" in fit_roughness(heights, 1.0, MARS).source
    assert fit_roughness(heights[:20, :90], 1.0, MOON).deviation == MOON.roughness[1]
    assert "too small" in fit_roughness(heights[:20, :90], 1.0, MOON).source


def test_prior_is_that_of_the_published_sites():
    published = [preset.hurst for preset in PRESETS.values()]
    assert np.mean(published) == pytest.approx(HURST_PRIOR[0], abs=0.01)
    assert np.std(published, ddof=1) == pytest.approx(HURST_PRIOR[1], abs=0.01)


def test_bent_spectrum_is_continued_as_it_is_at_the_joint():
    """Ground whose exponent falls with the baseline, as craters of one size make it.

    Longer baselines would tell too small an exponent.
    """
    from scipy.ndimage import gaussian_filter

    flats = gaussian_filter(np.random.default_rng(3).normal(size=(256, 256)), 2.0)
    heights = 0.3 * natural_surface(256, 0.6, seed=2) + 3.0 * flats
    everywhere = np.ones(heights.shape, bool)
    fourfold, eightfold = (mean_square_increment(heights, lag, everywhere) for lag in (4, 8))
    assert fit_roughness(heights, 1.0, MARS).exponent[0] > 0.5 * np.log2(eightfold / fourfold) + 0.2


def test_increments_of_pixel_means():
    """The closed form against a surface of finer samples than pixels."""
    heights = natural_surface(192, 0.7, seed=6, fine=8)
    everywhere = np.ones(heights.shape, bool)
    for lag in (1, 2, 4):
        measured = mean_square_increment(heights, lag, everywhere)
        assert measured == pytest.approx(expected_increment(0.7, lag), rel=0.1)


def test_expected_increments_have_the_same_bits_as_portable_sums():
    steps = (np.arange(24) + 0.5) / 12.0 - 1.0
    weights = (1.0 - np.abs(steps)) / 12.0

    def variogram(hurst: float, lag: int) -> float:
        power = portable.power(np.hypot(lag + steps[None, :], steps[:, None]), 2.0 * hurst)
        return 0.5 * float(portable.product(portable.product(weights, power), weights))

    for hurst in np.random.default_rng(3).uniform(0.05, 0.98, 20).tolist():
        for lag in (1, 2, 4):
            near, far, none = (variogram(hurst, n) for n in (lag, 2 * lag, 0))
            assert expected_increment(hurst, lag) == 8.0 * near - 2.0 * far - 6.0 * none


def test_amplitude_follows_the_ground():
    heights = natural_surface(128, 0.7, seed=5)
    heights = heights - heights.mean()
    heights[:, 64:] *= 5.0
    local = fit_roughness(heights, 1.0, MARS).local
    assert local[:, 90:].mean() / local[:, :38].mean() == pytest.approx(5.0, rel=0.15)


def test_holes_and_facets_do_not_smooth_the_detail():
    heights = natural_surface(128, 0.7, seed=5).copy()
    trusted = np.ones(heights.shape, bool)
    whole = fit_roughness(heights, 1.0, MARS, trusted)
    heights[40:70, 40:70] = 0.0
    trusted[40:70, 40:70] = False
    found = fit_roughness(heights, 1.0, MARS, trusted)
    assert found.local[55, 55] == pytest.approx(whole.deviation, rel=0.4)


@pytest.mark.parametrize("layer", [Fractal(), Fractal(preset="lunar_highlands", gain=3.0)])
@pytest.mark.parametrize("factor", [3, 16])
def test_means_over_pixels_are_the_posts(layer, factor):
    means = natural_surface(40, 0.7, seed=7)
    _, heights = continued(means, factor=factor, layer=layer)
    excess = block_means(heights, factor) - means[8:-8, 8:-8]
    # The ground is some 20 m high, and five times as rough as Mars.
    assert np.abs(excess).max() < (2e-3 if factor <= 16 else 0.01)


def test_means_are_kept_on_a_turned_lattice():
    """A polar grid, say: north points anywhere, and no pixel holds a whole number of nodes."""
    posts = natural_surface(64, 0.7, seed=8)
    cos, sin = np.cos(0.6), np.sin(0.6)
    patch = worlds.patch(posts, (cos, sin, 31.2, -sin, cos, 30.7))
    roughness = fit_roughness(posts, 1.0, MARS)
    site = worlds.site().replace(
        size=(24.0, 24.0), spacing=0.0625, dtm=patch, roughness=roughness, slope=(0.02, -0.01)
    )
    ground = shape_ground(site=site, window=site.window, layers=(Fractal(),))
    found = terrain_statistics(site=site, ground=ground)
    assert found.worst_mean < 0.01 < 0.003 * np.ptp(posts)


@pytest.mark.parametrize("spacing", [0.125, 0.1, 0.3])
def test_window_is_the_cut_bit_for_bit(spacing):
    posts = natural_surface(64, 0.7, seed=8)
    patch = worlds.patch(posts, (0.8, 0.6, 31.2, 0.6, -0.8, 30.7))
    size = (160 * spacing, 120 * spacing)
    roughness = fit_roughness(posts, 1.0, MARS)
    site = worlds.site().replace(size=size, spacing=spacing, dtm=patch, roughness=roughness)
    whole = shape_ground(site=site, window=site.window, layers=(Fractal(),)).elevation
    random = np.random.default_rng(5)
    bare = dtm_heights(site=site, window=site.window)
    for _ in range(4):
        column, row = int(random.integers(0, 120)), int(random.integers(0, 80))
        window = Window(column=column, row=row, columns=37, rows=29)
        part = shape_ground(site=site, window=window, layers=(Fractal(),)).elevation
        assert np.array_equal(part, whole[row : row + 30, column : column + 38])
        # In double precision too: rounding to single would hide most of a difference.
        part = dtm_heights(site=site, window=window)
        assert np.array_equal(part, bare[row : row + 30, column : column + 38])


def test_strips_do_not_show(monkeypatch):
    from terrain_forge.terrain import ground

    posts = natural_surface(40, 0.7, seed=8)
    _, whole = continued(posts, factor=8)
    monkeypatch.setattr(ground, "STRIP", 7)
    _, strips = continued(posts, factor=8)
    assert np.array_equal(whole, strips)


def test_spectrum_has_no_step_at_the_joint():
    """A surface of a known law, continued to a quarter of its posting, keeps to the law."""
    hurst = 0.7
    _, heights = continued(0.3 * natural_surface(128, hurst, seed=9), factor=4, posting=1.0)
    number, density = radial_spectrum(heights, 0.25, bins=16)
    inside = (number > 0.05) & (number < 1.4)
    law = number ** -(2.0 * hurst + 2.0)
    ratio = (density / law)[inside]
    ratio /= np.exp(np.mean(np.log(ratio)))
    assert ratio.max() < 1.6
    assert ratio.min() > 0.6
    found = spectral_exponent(number, density, (0.2, 1.2))  # across the joint at 0.5
    assert found[0] == pytest.approx(hurst, abs=0.12)


@pytest.mark.parametrize("factor", [4, 16, 32])
def test_no_octave_is_lost_where_spacing_and_posting_hardly_differ(factor):
    """The detail of a spacing a little finer or coarser is nearly the same."""
    means = natural_surface(24, 0.6, seed=7)
    found = []
    for spacing in (16.0 / factor, 16.01 / factor):
        spec = ArrayDtm(posting_m=16.0, size_m=(12 * factor * spacing, 12 * factor * spacing))
        site = worlds.site().replace(
            size=spec.size_m,
            spacing=spacing,
            **vars(survey(spec, body=MARS, folder=Path(), heights=means)),
        )
        bare, ground = (
            shape_ground(site=site, window=site.window, layers=layers).elevation.astype(float)
            for layers in ((), (Fractal(),))
        )
        found.append(rms_deviation(ground - bare, 1))
    assert found[1] == pytest.approx(found[0], rel=0.05)


def test_given_amplitude_is_what_comes_out():
    site = worlds.site().replace(size=(200.0, 200.0), spacing=0.25)
    for layer in (
        Fractal(rms_slope=RmsSlope(slope_deg=6.0, baseline_m=2.0), hurst=0.6),
        Fractal(preset="pathfinder", longest_wavelength_m=512.0),
    ):
        layer = Fractal(**(vars(layer) | {"longest_wavelength_m": 512.0}))
        ground = shape_ground(site=site, window=site.window, layers=(layer,))
        measured = rms_deviation(ground.elevation.astype(float), 8)
        expected = 2.0 * np.tan(np.radians(6.0)) if layer.rms_slope else 0.0959 * 2.0**0.57
        assert measured == pytest.approx(expected, rel=0.1)


def test_presets_give_the_published_slopes():
    """RMS slope at 1 m of Pathfinder and Viking 1, median slopes at 17 m of the Moon.

    The Moon's, 2.0° of maria and 7.5° of highlands (Rosenburg et al. 2011), are of planes through
    three spots: the size of a gradient whose parts are normal.
    """
    slope = {name: np.degrees(np.arctan(p.deviation)) for name, p in PRESETS.items()}
    assert slope["pathfinder"] == pytest.approx(5.4, abs=1.0)
    assert slope["viking_1"] == pytest.approx(4.8, abs=1.0)
    for name, median in (("lunar_mare", 2.0), ("lunar_highlands", 7.5)):
        preset = PRESETS[name]
        along_a_line = preset.deviation * 17.0 ** (preset.hurst - 1.0)
        gradient = along_a_line * np.random.default_rng(1).standard_normal((100_000, 2))
        slopes = np.degrees(np.arctan(np.hypot(*gradient.T)))
        assert np.median(slopes) == pytest.approx(median, rel=0.01)


def test_another_exponent_turns_about_the_joint():
    site = worlds.site().replace(
        dtm=DtmPatch(
            heights=np.zeros((9, 9)), to_pixel=(0.25, 0.0, 4.0, 0.0, 0.25, 4.0), crs="",
            wrap=(0.0, 0.0), posting=4.0, filled=0,
        ),
        roughness=Roughness(hurst=0.8, deviation=0.1, source="", local=np.full((9, 9), 0.1)),
    )  # fmt: skip
    law = Fractal(hurst=0.5).figures(site)
    assert law.hurst == 0.5
    assert law.deviation * 4.0**0.5 == pytest.approx(0.1 * 4.0**0.8)


def test_two_amplitudes_are_one_too_many():
    with pytest.raises(ValueError, match="one of deviation_1m_m and preset"):
        Fractal(preset="pathfinder", deviation_1m_m=0.1)


def test_statistics_are_plain_and_compare():
    posts = natural_surface(64, 0.7, seed=8)
    site, heights = continued(posts, factor=4)
    from terrain_forge.model import Heightfield

    ground = Heightfield(
        elevation=(heights - site.datum_height).astype(np.float32),
        spacing=site.spacing,
        origin=(site.west, site.south),
    )
    found = terrain_statistics(site=site, ground=ground)
    plain = found.as_json()
    assert plain["exponent_at_the_joint"]["value"] == pytest.approx(0.7, abs=0.15)
    assert sum(plain["ground"]["slope_shares_per_degree"]) == pytest.approx(1.0)
    assert found.ground.deviation[3] == pytest.approx(
        rms_deviation(heights, round(found.ground.baseline[3] / site.spacing)), rel=1e-4
    )


@pytest.mark.parametrize(
    ("layers", "hurst", "deviation"),
    [
        ((Fractal(),), 0.6, 0.05),
        ((Fractal(gain=2.0),), 0.6, 0.1),
        ((Fractal(hurst=0.9, deviation_1m_m=0.3, gain=0.5),), 0.9, 0.15),
        ((Fractal(gain=0.0),), None, None),
        ((), None, None),
    ],
)
def test_statistics_tell_the_law_of_what_is_made(tmp_path, layers, hurst, deviation):
    """Not the one that was fitted to the DTM, which a layer may be told to leave."""
    site = layered(worlds.site(), *layers)
    ground = shape_ground(site=site, window=site.window, layers=layers)
    found = terrain_statistics(site=site, ground=ground)
    plain = found.as_json()
    assert plain["hurst"] == hurst
    assert plain["deviation_1m_m"] == (deviation and pytest.approx(deviation))
    write_terrain_figure(found, tmp_path / "terrain.png")


def test_report_tells_what_the_dtm_needed():
    from terrain_forge.report.page import render
    from terrain_forge.report.sections.ground import dtm_part

    posts = natural_surface(64, 0.7, seed=8)
    site, _ = continued(posts, factor=4)
    repaired = site.dtm.replace(repairs=("12 samples filled",), filled=12, planar_fraction=0.25)
    site = layered(site.replace(dtm=repaired), Fractal())
    ground = shape_ground(site=site, window=site.window, layers=(Fractal(),))
    found = terrain_statistics(site=site, ground=ground).as_json()
    state = found["dtm_state"]
    assert (state["samples"], state["filled_samples"]) == ([64, 64], 12)
    shown = render("blocks.html", blocks=dtm_part(found))
    for words in ("64 × 64", "12 samples filled", "25.0 %", "as given", "mm off at most", " ± "):
        assert words in shown
    assert f"{site.roughness.hurst:.2f}" in shown
    without = terrain_statistics(site=layered(site), ground=ground).as_json()
    assert "none is made" in render("blocks.html", blocks=dtm_part(without))
    assert dtm_part({}) == []
    flat = worlds.site()
    ground = shape_ground(site=flat, window=flat.window, layers=())
    assert dtm_part(terrain_statistics(site=flat, ground=ground).as_json()) == []


def eightfold(heights):
    """Errors of ν at 1, 2, 3, 4 original posts and of the 95th percentile of slopes, from 8 × 8."""
    means = block_means(heights, 8)
    rows, columns = (8 * n - 64 for n in means.shape)
    truth = heights[64:rows, 64:columns]
    _, found = continued(means, factor=8, posting=29.5)
    slopes = [
        np.percentile(np.hypot(np.diff(z, axis=1)[:-1], np.diff(z, axis=0)[:, :-1]), 95)
        for z in (found, truth)
    ]
    errors = [rms_deviation(found, lag) / rms_deviation(truth, lag) - 1.0 for lag in (1, 2, 3, 4)]
    return np.array(errors), slopes[0] / slopes[1] - 1.0


@pytest.mark.skipif(not DATA.is_dir(), reason="the real DTMs are not at hand")
@pytest.mark.parametrize(
    "corner",
    [
        (0, 0), (256, 256), (512, 512),
        *(
            pytest.param((row, column), marks=pytest.mark.slow)
            for row in (0, 128, 256, 384, 512) for column in (64, 192, 320, 448)
        ),
    ],
)  # fmt: skip
def test_dtm_averaged_eightfold_is_given_back_its_roughness(corner):
    errors, steep = eightfold(read(JEZERO, corner, 512))
    assert abs(errors[0]) < 0.15
    assert np.abs(errors[1:]).max() < 0.10
    assert abs(steep) < 0.15


@pytest.mark.parametrize("hurst", [0.5, 0.7, 0.9])
def test_self_affine_ground_averaged_eightfold_is_given_back_its_roughness(hurst):
    errors, steep = eightfold(natural_surface(256, hurst, seed=3))
    assert abs(errors[0]) < 0.15
    assert np.abs(errors[1:]).max() < 0.10
    assert abs(steep) < 0.10


@pytest.mark.parametrize("hurst", [0.5, 0.7, 0.9])
def test_thinned_out_dtm_is_given_back_its_roughness(hurst):
    """Posts that are points: continued as means they would be 45 to 55 % too rough."""
    heights = natural_surface(256, hurst, seed=3)
    points = heights[2::4, 2::4]
    everywhere = np.ones(points.shape, bool)
    assert are_points(points, everywhere)
    assert not are_points(block_means(heights, 4), everywhere)
    site, found = continued(points, factor=4)
    assert "heights of points" in site.dtm.repairs[0]
    truth = heights[32:-32, 32:-32]
    for lag in (1, 2, 3, 4):
        assert rms_deviation(found, lag) == pytest.approx(rms_deviation(truth, lag), rel=0.1)


def test_points_can_be_kept():
    points = natural_surface(256, 0.7, seed=3)[2::4, 2::4]
    spec = ArrayDtm(posting_m=4.0, size_m=(160.0, 160.0), noise="keep")
    assert np.array_equal(
        survey(spec, body=MARS, folder=Path(), heights=points).dtm.heights, points
    )


def test_exponent_that_rises_towards_the_posting_goes_on_to_rise():
    """Ground whose exponent is 0.5 at 32 posts and rises by 0.1 in each octave below."""
    size = 1024
    number = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    number[0, 0] = 1.0
    octaves = np.clip(np.log2(number * 64.0), 0.0, 5.0)
    fall = np.where(number < 1.0 / 64.0, number * 64.0, 1.0) ** -1.5
    fall *= 2.0 ** -(1.5 * octaves + 0.05 * octaves**2)
    waves = np.fft.rfft2(np.random.default_rng(5).normal(size=(size, size))) * fall
    waves[0, 0] = 0.0
    heights = 100.0 * np.fft.irfft2(waves)
    errors, _ = eightfold(heights)
    assert np.abs(errors).max() < 0.1
    law = fit_roughness(block_means(heights, 8), 8.0, MARS)
    assert 0.03 < law.rise < 0.15
    straight = law.replace(rise=0.0, deviation=law.deviation_over(8.0) * 8.0**-law.hurst)
    assert straight.deviation_over(1.0) > 1.1 * law.deviation_over(1.0)
    assert straight.deviation_over(16.0) == pytest.approx(law.deviation_over(16.0))


def decimated(heights, seed):
    """Errors of ν at 1, 2, 3, 4 original posts of a DTM averaged 4 × 4 and continued again.

    First those of the interpolation alone.
    """
    from scipy.ndimage import maximum_filter, minimum_filter

    means = block_means(heights, 4)
    rows, columns = (4 * n - 32 for n in means.shape)
    truth = heights[32:rows, 32:columns]
    errors = []
    for gain in (0.0, 1.0):
        _, found = continued(means, factor=4, posting=14.8, layer=Fractal(gain=gain), seed=seed)
        # 1 cm, or a thousandth of the usual relief within three posts.
        allowed = max(0.01, 1e-3 * np.median(maximum_filter(means, 3) - minimum_filter(means, 3)))
        assert np.abs(block_means(found, 4) - means[8:-8, 8:-8]).max() < allowed
        errors.append(
            [rms_deviation(found, lag) / rms_deviation(truth, lag) - 1.0 for lag in (1, 2, 3, 4)]
        )
    return np.array(errors)


def read(source, corner, size, scale=1.0):
    from terrain_forge.dtm import open_dataset

    with open_dataset(source) as file:
        heights = file.read(1).astype(float) * scale
    return heights[corner[0] : corner[0] + size, corner[1] : corner[1] + size]


@pytest.mark.skipif(not DATA.is_dir(), reason="the real DTMs are not at hand")
@pytest.mark.parametrize(
    ("source", "corner", "size", "scale"),
    [
        (JEZERO, (600, 50), 320, 1.0),
        (JEZERO, (260, 660), 256, 1.0),
        (GALE, (0, 0), 200, 60.0 / 65535.0),
        (EIGHT_BITS, (256, 256), 256, 16.0 / 255.0),
        (MOON_ALL, (300, 200), 256, 4.0 / 7581.0),  # as steep as it is
    ],
)
@pytest.mark.parametrize("seed", [1])
def test_decimated_dtm_is_given_back_its_roughness(source, corner, size, scale, seed):
    alone, ours = decimated(read(source, corner, size, scale), seed)
    assert abs(ours[0]) < 0.15
    assert np.abs(ours[1:]).max() < 0.10
    assert abs(ours[0]) <= abs(alone[0]) + 0.01


@pytest.mark.parametrize(
    ("name", "corner", "size"),
    [
        ("gale_floor_synthetic.tif", (0, 0), 416),
        ("gale_floor_synthetic.tif", (160, 160), 256),
        ("moon_mare_synthetic.tif", (0, 0), 320),
        ("moon_mare_synthetic.tif", (64, 64), 256),
    ],
)
def test_decimated_sample_is_given_back_its_roughness(name, corner, size):
    alone, ours = decimated(read(SAMPLES / name, corner, size), 1)
    assert abs(ours[0]) < 0.15
    assert np.abs(ours[1:]).max() < 0.10
    assert np.all(np.abs(ours) < np.abs(alone))
