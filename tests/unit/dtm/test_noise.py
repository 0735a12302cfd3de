"""Noise of a DTM: found where there is some, taken away, and what it hid drawn again."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rasterio
from scipy.ndimage import gaussian_filter, uniform_filter

from terrain_forge.base import stage_key
from terrain_forge.dtm import ArrayDtm, Posts, site_survey, site_warnings, survey
from terrain_forge.dtm.denoising import denoised
from terrain_forge.dtm.increments import local_square_increments
from terrain_forge.dtm.landforms import landforms
from terrain_forge.dtm.matcher_windows import Window as MatcherWindow
from terrain_forge.dtm.noise_floor import find_noise
from terrain_forge.dtm.noisy_part import find_noisy_part
from terrain_forge.dtm.vertical import height_step
from terrain_forge.model import MARS, Window
from terrain_forge.terrain import Fractal, rms_deviation, shape_ground, terrain_statistics
from tests.helpers import worlds
from tests.helpers.places import DATA, SAMPLES

LAGS = (1, 2, 3, 4)


@pytest.fixture(scope="module")
def jezero():
    """Heights of a real DTM [m]."""
    path = DATA / "mars" / "jezero_hirise_3p69m_1024.tif"
    if not path.is_file():
        pytest.skip("the real DTMs are not at hand")
    with rasterio.open(path) as file:
        return file.read(1).astype(float)


@cache
def clean(name="gale_floor_synthetic.tif", factor=2):
    with rasterio.open(SAMPLES / name) as file:
        heights = file.read(1).astype(float)
    return averaged(heights, factor)


def averaged(heights, factor):
    rows, columns = (n // factor for n in heights.shape)
    cut = heights[: rows * factor, : columns * factor]
    return cut.reshape(rows, factor, columns, factor).mean(axis=(1, 3))


def matcher_noise(shape, deviation, window, seed=1):
    """White noise averaged over a matcher's window: a Gaussian of posts, or a square of them."""
    white = np.random.default_rng(seed).normal(size=shape)
    smooth = uniform_filter if isinstance(window, int) else gaussian_filter
    noise = smooth(white, window, mode="wrap")
    return deviation * noise / noise.std()


def everywhere(heights):
    return np.ones(heights.shape, bool)


def planned(heights, posting, *, factor=2, margin=20, **options):
    """A site in the middle of an array of heights."""
    rows, columns = (n - 2 * margin for n in heights.shape)
    size = (columns * posting, rows * posting)
    spec = ArrayDtm(posting_m=posting, size_m=size, **options)
    found = survey(spec, body=MARS, folder=Path(), heights=heights)
    return worlds.site().replace(size=size, spacing=posting / factor, **vars(found))


@pytest.mark.parametrize("window", [0.0, 0.5, 0.55, 0.6, 0.7, 1.0, 1.5, 3, 4])
@pytest.mark.parametrize("deviation", [0.2, 0.35])
def test_noisy_dtm_comes_back_to_the_roughness_of_the_clean_one(deviation, window):
    truth = clean()
    noisy = truth + matcher_noise(truth.shape, deviation, window)
    floor = find_noise(noisy, 2.0, everywhere(noisy)).floor
    assert floor.deviation == pytest.approx(deviation, rel=0.12)
    found = denoised(noisy, floor, stage_key(1, "noise"))
    for lag in LAGS:
        assert rms_deviation(found, lag) == pytest.approx(rms_deviation(truth, lag), rel=0.15)
    assert rms_deviation(noisy, 1) > 1.4 * rms_deviation(truth, 1)
    # The means stay within the noise.
    assert np.std(found - noisy) < 1.1 * deviation
    assert np.std(found - truth) < deviation


@pytest.mark.parametrize(("window", "each"), [(6, 0.0), (8, 0.0), (3, 0.3), (5, 0.3)])
def test_noise_over_many_posts_or_with_some_of_each_is_taken_away(jezero, window, each):
    truth = averaged(jezero[200:840, 100:740], 2)
    deviation = 0.7
    noisy = truth + matcher_noise(truth.shape, deviation, window)
    noisy += matcher_noise(truth.shape, each * deviation, 0.0, seed=2)
    floor = find_noise(noisy, 7.38, everywhere(noisy)).floor
    assert floor is not None
    assert floor.deviation == pytest.approx(np.hypot(1.0, each) * deviation, rel=0.2)
    found = denoised(noisy, floor, stage_key(1, "noise"))
    for lag in LAGS:
        assert rms_deviation(found, lag) == pytest.approx(rms_deviation(truth, lag), rel=0.15)


@pytest.mark.parametrize(("deviation", "window"), [(0.1, 0.0), (0.1, 3), (0.2, 0.0)])
def test_smooth_ground_beside_rough_stays_smooth(deviation, window):
    whole = clean()
    across = np.linspace(0.0, 1.0, whole.shape[1])
    factor = 0.25 + 0.75 * np.clip((across - 0.35) / 0.3, 0.0, 1.0)
    truth = whole.mean() + (whole - whole.mean()) * factor
    noisy = truth + matcher_noise(truth.shape, deviation, window)
    floor = find_noise(noisy, 2.0, everywhere(noisy)).floor
    found = denoised(noisy, floor, stage_key(1, "noise"))
    third = whole.shape[1] // 3
    for part in (np.s_[:, :third], np.s_[:, -third:]):
        for lag in LAGS:  # the smooth part was 1.4 to 2.1 times too rough
            rough = rms_deviation(found[part], lag) / rms_deviation(truth[part], lag)
            assert rough == pytest.approx(1.0, abs=0.3)


def self_affine(side, *, hurst, deviation, seed):
    """Heights of a periodic self-affine surface [m], shape [side, side]."""
    rng, waves = np.random.default_rng(seed), np.fft.fftfreq(side)
    number = np.hypot(*np.meshgrid(waves, waves))
    number[0, 0] = 1.0
    noise = np.fft.fft2(rng.normal(size=(side, side)))
    surface = np.fft.ifft2(noise * number ** -(hurst + 1.0)).real
    return deviation * surface / surface.std()


def bowls(side, diameter, count=24, seed=3):
    """Craters of one size [posts], a tenth as deep, with rims; and the places of their middles."""
    y, x = np.mgrid[:side, :side]
    random, places, heights = np.random.default_rng(seed), [], np.zeros((side, side))
    while len(places) < count:
        place = random.uniform(diameter, side - diameter, 2)
        if all(np.hypot(*(place - other)) > 1.7 * diameter for other in places):
            places.append(place)
            away = np.hypot(y - place[0], x - place[1]) / (0.5 * diameter)
            rim = 0.02 * diameter * np.maximum(away, 1.0) ** -3.0 * (away < 6.0)
            heights += np.where(away < 1.0, 0.1 * diameter * (away**2 - 1.0), 0.0) + rim
    return heights, places


def depth(heights, places, diameter):
    """Mean height of rims over floors."""
    y, x = np.mgrid[: heights.shape[0], : heights.shape[1]]
    found = []
    for place in places:
        away = np.hypot(y - place[0], x - place[1]) / (0.5 * diameter)
        rim = heights[(away > 0.85) & (away < 1.2)].mean()
        found.append(rim - heights[away < 0.4].mean())
    return np.mean(found)


@pytest.mark.parametrize(("side", "diameter"), [(128, 10), (192, 5), (256, 5)])
def test_craters_of_one_size_are_no_noise(side, diameter):
    """Their spectrum is that of a matcher's noise; they stand out of their surroundings."""
    count = 60 if side == 256 else 24
    ground = self_affine(side, hurst=0.8, deviation=0.02, seed=1)
    forms, places = bowls(side, diameter, count)
    heights = ground + forms
    assert find_noise(heights, 1.0, everywhere(heights)).floor is not None
    patch = planned(heights, 1.0).dtm
    assert patch.noise == 0.0
    assert patch.doubt > 0.0
    assert depth(patch.heights, places, diameter) > 0.95 * depth(heights, places, diameter)


def test_craters_stand_out_of_noise():
    """They were kept too, but the plain between them came out more than three times too rough."""
    forms, places = bowls(192, 12)
    truth = self_affine(192, hurst=0.8, deviation=0.02, seed=1) + forms
    noisy = truth + matcher_noise(truth.shape, 0.2, 0.8)
    patch = planned(noisy, 1.0).dtm
    assert patch.noise == pytest.approx(0.2, rel=0.12)
    assert 0.6 < depth(patch.heights, places, 12) / depth(truth, places, 12) < 1.05
    assert 0.6 < rms_deviation(patch.heights, 1) / rms_deviation(truth, 1) < 1.3
    assert np.std(patch.heights - truth) < 0.6 * np.std(noisy - truth)


@pytest.mark.parametrize("columns", [64, 96])
def test_noise_in_a_part_of_a_dtm_is_warned_of(columns):
    """Its quietest parts tell of none, so that it is left in."""
    clean_ground = self_affine(192, hurst=0.8, deviation=0.08, seed=3)
    noise = matcher_noise(clean_ground.shape, 0.4, 0.8, seed=5)
    noise[:, columns:] = 0.0
    site = planned(clean_ground + noise, 1.0)
    assert site.dtm.noise == 0.0
    assert site.dtm.doubt == pytest.approx(0.4, rel=0.4)
    assert 0.15 < site.dtm.doubtful < 0.5
    told = " ".join(site_warnings(site))
    assert f"at least {site.dtm.doubtful:.0%} of the DTM seems to have noise of" in told


@pytest.mark.parametrize(
    ("step", "seeds"),
    [
        (0.0, 12),
        (1.0, 12),
        pytest.param(0.0, 24, marks=pytest.mark.slow),
        pytest.param(1.0, 24, marks=pytest.mark.slow),
    ],
)
def test_clean_ground_has_noise_in_no_part(step, seeds):
    """Rounded or not: squares that overlap have noise by chance together."""
    found = []
    for seed in range(seeds):
        hurst = (0.5, 0.7, 0.9)[seed % 3]
        heights = self_affine(192, hurst=hurst, deviation=0.8, seed=seed)
        heights = np.round(heights / step) * step if step else heights
        whole = find_noise(heights, 1.0, everywhere(heights), step=step)
        if whole.floor is None and not whole.doubt:  # it is looked for only then
            found.append(find_noisy_part(heights, 1.0, everywhere(heights), step=step)[1])
    assert len(found) > seeds // 8
    assert np.count_nonzero(found) <= seeds // 24


@pytest.mark.parametrize("given", [0.03, 0.1])
def test_noise_that_is_given_is_taken_beside_craters_too(given):
    heights = self_affine(128, hurst=0.8, deviation=0.02, seed=1) + bowls(128, 10)[0]
    patch = planned(heights, 1.0, noise=given).dtm
    assert (patch.noise, patch.doubt) == (pytest.approx(given), 0.0)


@pytest.mark.parametrize("given", [1e-9, 50.0])
def test_noise_that_is_given_must_be_some_of_the_dtms(given):
    heights = self_affine(192, hurst=0.8, deviation=0.08, seed=3)
    patch = planned(heights, 1.0, noise=given).dtm
    assert patch.noise == 0.0
    assert np.array_equal(patch.heights, heights)
    assert "it is kept" in patch.repairs[-1]


def test_nothing_stands_out_of_noise_alone():
    noise = matcher_noise((256, 256), 0.3, 0.8)
    out = landforms(noise + self_affine(256, hurst=0.8, deviation=0.05, seed=1), everywhere(noise))
    assert np.std(out) < 0.1 * 0.3
    assert np.mean(out != 0.0) < 0.02


def test_what_is_as_high_as_posts_are_apart_is_no_noise():
    white = np.random.default_rng(1).normal(size=(96, 96))
    floors = [find_noise(scale * white, 1.0, everywhere(white)).floor for scale in (0.5, 0.8)]
    assert floors[0].deviation == pytest.approx(0.5, rel=0.1)
    assert floors[1] is None


@pytest.mark.parametrize("window", [0.0, 1.0, 3])
def test_noise_that_is_as_high_as_posts_are_apart_is_warned_of(window):
    truth = clean(factor=1)
    site = planned(truth + matcher_noise(truth.shape, 1.0, window), 1.0, margin=4)
    assert site.dtm.noise == 0.0
    assert site.dtm.doubt == pytest.approx(1.0, rel=0.1)
    assert any("may have noise" in text for text in site_warnings(site))


def test_a_massif_does_not_roughen_the_plain_beside_it():
    plain = self_affine(192, hurst=0.8, deviation=0.02, seed=1)
    massif = 50.0 * self_affine(192, hurst=0.8, deviation=0.02, seed=2) * (np.arange(192) >= 96)
    near, alone = (
        local_square_increments(heights, 1, everywhere(heights), 1.0)[:, :70].mean()
        for heights in (plain + massif, plain)
    )
    assert near == pytest.approx(alone, rel=0.02)


def test_what_is_not_measured_does_not_tell_how_rough_the_ground_is(monkeypatch):
    asked = []
    monkeypatch.setattr(
        site_survey, "denoised", lambda heights, _, __, trusted: asked.append(trusted) or heights
    )
    noisy = clean() + matcher_noise(clean().shape, 0.35, 3)
    noisy[90:110, 90:110] = noisy[90:110, 90:110].mean()  # a plane, which was filled in
    planned(noisy, 2.0, noise=0.35)
    assert asked[0].shape == noisy.shape
    assert not asked[0][92:108, 92:108].any()
    assert asked[0].mean() > 0.9


@pytest.mark.parametrize("deviation", [0.7, 1.0])
def test_noise_over_two_posts_is_found_on_a_real_dtm(jezero, deviation):
    truth = averaged(jezero[200:712, 250:762], 4)
    noisy = truth + matcher_noise(truth.shape, deviation, 2)
    floor = find_noise(noisy, 14.76, everywhere(noisy)).floor
    assert floor is not None
    assert floor.deviation == pytest.approx(deviation, rel=0.12)
    found = denoised(noisy, floor, stage_key(1, "noise"))
    assert rms_deviation(found, 1) == pytest.approx(rms_deviation(truth, 1), rel=0.15)


@pytest.mark.parametrize("corner", [(0, 0), (0, 500), (200, 250), (384, 0), (384, 500)])
def test_noise_of_narrow_windows_on_a_real_dtm_is_found_or_in_doubt(jezero, corner):
    row, column = corner
    truth = averaged(jezero[row : row + 512, column : column + 512], 4)
    noisy = truth + matcher_noise(truth.shape, 0.7, 0.6, seed=row + column)
    found = find_noise(noisy, 14.76, everywhere(noisy))
    deviation = found.doubt if found.floor is None else found.floor.deviation
    assert deviation == pytest.approx(0.7, rel=0.2)


def test_gaussian_window_is_folded_at_the_posts():
    """Its spectrum is that of its correlation from post to post, and no more than it."""
    window = MatcherWindow(width=0.5, square=False)
    across, down = (part.ravel() for part in np.meshgrid(*2 * [np.linspace(-0.5, 0.5, 9)]))
    lags = np.arange(-9, 10)
    near = np.array([window.correlation(abs(float(lag))) for lag in lags])
    rows, columns = (near @ np.cos(2.0 * np.pi * np.outer(lags, n)) for n in (down, across))
    assert window.spectrum(across, down) == pytest.approx(rows * columns * window.white, abs=3e-4)


@pytest.mark.parametrize(("factor", "window", "deviation"), [(2, 0.6, 0.05), (4, 0.55, 0.08)])
def test_noise_that_is_in_doubt_is_warned_of_and_left(factor, window, deviation):
    truth = clean(factor=factor)
    noisy = truth + matcher_noise(truth.shape, deviation, window)
    site = planned(noisy, float(factor), margin=4)
    assert site.dtm.noise == 0.0
    assert site.dtm.doubt == pytest.approx(deviation, rel=0.15)
    assert np.array_equal(site.dtm.heights, noisy)
    (told,) = (text for text in site_warnings(site) if "may have noise" in text)
    assert f"may have noise of {100.0 * site.dtm.doubt:.2g} cm RMS" in told
    kept = planned(noisy, float(factor), margin=4, noise="keep")
    assert kept.dtm.doubt == 0.0
    assert not any("may have noise" in text for text in site_warnings(kept))
    given = planned(noisy, float(factor), margin=4, noise=deviation).dtm
    assert (given.noise, given.doubt) == (pytest.approx(deviation), 0.0)


@pytest.mark.slow
def test_few_parts_of_a_real_dtm_are_in_doubt(jezero):
    parts = [
        averaged(jezero[row : row + side, column : column + side], factor)
        for factor, side in ((1, 160), (2, 320), (4, 512))
        for row in range(0, 1025 - side, 128)
        for column in range(0, 1025 - side, 128)
    ]
    doubts = [find_noise(part, 3.69, everywhere(part)).doubt for part in parts]
    assert sum(doubt > 0.0 for doubt in doubts) <= 0.12 * len(parts)


@pytest.mark.parametrize("noise", ["auto", 0.4])
def test_white_noise_is_taken_away_found_or_given(noise):
    truth = clean(factor=4)
    noisy = truth + matcher_noise(truth.shape, 0.4, 0.0)
    found = planned(noisy, 4.0, margin=4, noise=noise).dtm
    assert found.noise == pytest.approx(0.4, rel=0.1)
    assert rms_deviation(noisy, 1) > 3.0 * rms_deviation(truth, 1)
    for lag in LAGS:
        assert rms_deviation(found.heights, lag) == pytest.approx(
            rms_deviation(truth, lag), rel=0.15
        )


def test_points_of_clean_ground_are_not_taken_for_white_noise():
    for name, factor in (("gale_floor_synthetic.tif", 4), ("moon_mare_synthetic.tif", 2)):
        points = clean(name, 1)[::factor, ::factor]
        assert find_noise(points, float(factor), everywhere(points)).floor is None


# A square window hides more of what would tell the exponent.
@pytest.mark.parametrize(("window", "off_by"), [(1.2, 0.15), (3, 0.2)])
def test_ground_of_a_noisy_dtm_is_as_rough_as_that_of_the_clean_one(window, off_by):
    truth = clean()
    noisy = truth + matcher_noise(truth.shape, 0.3, window)
    grounds = []
    for heights in (truth, noisy):
        site = planned(heights, 2.0)
        grounds.append(shape_ground(site=site, window=site.window, layers=(Fractal(),)).elevation)
    for lag in (1, 2, 4, 8):
        ours, theirs = (rms_deviation(ground.astype(float), lag) for ground in grounds[::-1])
        assert ours == pytest.approx(theirs, rel=off_by)
    told = terrain_statistics(
        site=site, ground=shape_ground(site=site, window=site.window, layers=())
    ).as_json()["dtm_state"]
    assert told["noise_m"] == pytest.approx(0.3, rel=0.15)
    assert f"noise of {100.0 * told['noise_m']:.2g} cm RMS" in told["warnings"][0]
    assert any("drawn as the longer ones tell" in repair for repair in told["repairs"])
    # A window is the cut, since the DTM is filtered once.
    window = Window(column=31, row=50, columns=40, rows=30)
    part = shape_ground(site=site, window=window, layers=(Fractal(),)).elevation
    assert np.array_equal(part, grounds[1][50:81, 31:72])


def dunes(count=256):
    """A pattern across the wind over self-affine ground."""
    random = np.random.default_rng(4)
    y, x = np.mgrid[0:count, 0:count]
    phase = 60.0 * gaussian_filter(random.normal(size=(count, count)), 20.0)
    along = ((0.9 * x + 0.35 * y) / 12.0 + phase) % 1.0
    crests = np.where(along < 0.7, along / 0.7, (1.0 - along) / 0.3)
    number = np.hypot(np.fft.fftfreq(count)[:, None], np.fft.rfftfreq(count)[None, :])
    number[0, 0] = np.inf
    waves = np.fft.rfft2(random.normal(size=(count, count))) * number**-1.8
    ground = np.fft.irfft2(waves)
    return gaussian_filter(2.0 * crests, 0.7) + 0.5 * ground / rms_deviation(ground, 1)


@pytest.mark.parametrize(
    "heights",
    [
        clean(factor=1)[:256, :256], clean(), clean(factor=4), clean("moon_mare_synthetic.tif", 2),
        dunes(), gaussian_filter(clean(), 1.0), np.zeros((128, 128)),
    ],
    ids=["gale", "gale/2", "gale/4", "mare/2", "dunes", "smoothed", "flat"],
)  # fmt: skip
def test_clean_dtm_is_left_alone(heights):
    """Not even dunes, craters, nor ground that a matcher smoothed are taken for noise."""
    assert find_noise(heights, 2.0, everywhere(heights)).floor is None
    site = planned(heights, 2.0)
    assert np.array_equal(site.dtm.heights, heights)
    assert site.dtm.noise == 0.0


@pytest.mark.parametrize("step", [0.5, 2.0])
def test_steps_of_a_clean_dtm_are_no_more_than_rounding(step):
    """Of small DTMs of smooth ground, whose steps hide its shortest waves."""
    for seed in range(1000, 1006):
        clean_heights = self_affine(128, hurst=1.2, deviation=20.0, seed=seed)
        heights = step * np.round(clean_heights / step)
        assert height_step(heights.ravel()) == pytest.approx(step)
        floor = find_noise(heights, 10.0, everywhere(heights), step=step).floor
        if step < 1.0:
            assert floor is None or floor.deviation < 1.1 * step / np.sqrt(12.0)
        else:  # which are as high as what is between two posts
            assert floor.deviation == pytest.approx(step / np.sqrt(12.0), rel=0.1)
            error = denoised(heights, floor, stage_key(1, "noise")) - clean_heights
            assert error.std() < step / np.sqrt(12.0)


@pytest.mark.slow
@pytest.mark.parametrize("corner", [(0, 0), (0, 512), (512, 0), (512, 512)])
def test_noise_over_a_real_dtm(jezero, corner):
    heights = jezero[corner[0] : corner[0] + 400, corner[1] : corner[1] + 400]
    assert find_noise(heights, 3.69, everywhere(heights)).floor is None
    noisy = heights + matcher_noise(heights.shape, 0.35, 3)
    found = denoised(noisy, find_noise(noisy, 3.69, everywhere(noisy)).floor, stage_key(1, "noise"))
    for lag in LAGS:
        assert rms_deviation(found, lag) == pytest.approx(rms_deviation(heights, lag), rel=0.15)


@pytest.mark.slow
def test_parts_of_a_real_dtm_are_left_alone(jezero):
    parts = [
        averaged(jezero[row : row + size, column : column + size], factor)
        for size in (256, 400, 512)
        for row in range(0, 1025 - size, 128)
        for column in range(0, 1025 - size, 128)
        for factor in (1, 2)
        if size / factor >= 160
    ]
    found = [find_noise(part, 3.69, everywhere(part)).floor for part in parts]
    assert sum(floor is not None for floor in found) <= 0.01 * len(parts)


def test_noise_can_be_kept_or_given():
    noisy = clean() + matcher_noise(clean().shape, 0.3, 1.0)
    for kept in ("keep", 0.0):
        assert np.array_equal(planned(noisy, 2.0, noise=kept).dtm.heights, noisy)
    given = planned(noisy, 2.0, noise=0.3)
    assert given.dtm.noise == pytest.approx(0.3)
    assert "said to be" in given.dtm.repairs[0]
    small = planned(noisy[:60, :60], 2.0, noise=0.3)
    assert small.dtm.noise == 0.0
    assert "could not be told" in small.dtm.repairs[0]
    ours = rms_deviation(given.dtm.heights, 1)
    assert ours == pytest.approx(rms_deviation(clean(), 1), rel=0.2)


def test_what_is_drawn_follows_the_seed():
    noisy = clean() + matcher_noise(clean().shape, 0.3, 1.0)
    floor = find_noise(noisy, 2.0, everywhere(noisy)).floor
    one, same, other = (denoised(noisy, floor, stage_key(n, "noise")) for n in (1, 1, 2))
    assert np.array_equal(one, same)
    assert 0.01 < np.std(one - other) < 0.3


def test_an_exponent_that_ground_has_not_is_told():
    rough = 0.05 * np.random.default_rng(1).normal(size=(90, 90))
    site = planned(rough, 2.0, margin=10)
    assert any("is below 0.5" in text for text in site_warnings(site))
    assert site_warnings(planned(clean(), 2.0)) == []


def steepest_detail(site):
    """RMS slope of the detail over one spacing, where it is greatest."""
    factors = Fractal().variation(site, Posts(slice(None), slice(None)))
    return factors.max() * Fractal().figures(site).deviation_over(site.spacing) / site.spacing


def test_detail_is_no_steeper_than_loose_ground_rests():
    loose, calm = planned(1.5 * clean(), 2.0, factor=64), planned(clean(), 2.0, factor=8)
    assert steepest_detail(loose) == pytest.approx(0.5 * math.tan(MARS.repose), rel=1e-6)
    assert steepest_detail(calm) < 0.3


@pytest.mark.parametrize("body", [MARS, MARS.replace(repose=None)])
def test_crags_are_rough_and_stand_on_no_needles(body):
    site = planned(20.0 * clean(), 2.0, factor=64).replace(body=body)
    assert steepest_detail(site) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(("deviation", "warned"), [(0.35, True), (0.05, False)])
def test_ground_that_lies_wholly_below_the_noise_is_warned_of(deviation, warned):
    truth = clean("moon_mare_synthetic.tif", 1)
    site = planned(truth + matcher_noise(truth.shape, deviation, 3), 2.0, noise=deviation)
    words = [text for text in site_warnings(site) if "hid all waves" in text]
    assert len(words) == warned
    assert (site.dtm.hidden > 16.0) == warned
    for text in words:
        assert f"up to {site.dtm.hidden:.3g} m" in text
