"""Electrons of a chip: photon transfer, patterns that stay, noise that does not, the shutter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from terrain_forge.model import AutoExposure, CameraSensor, FixedExposure
from terrain_forge.model.camera_parts import CameraNoise
from terrain_forge.sensors.exposure import Chip, Shutter, blur, electrons_per_radiance, vignetting
from terrain_forge.sensors.lens import lens_of, rays_of
from terrain_forge.sensors.metering import Meter

_NOISE = CameraNoise(full_well_e=20_000.0, read_e=12.0, prnu=0.01, dsnu_e=20.0)
_SHAPE = 160, 200
_TIME = 1e-3


def _camera(**more):
    given = {"bits": 12, "noise": _NOISE, "vignetting": None, "psf_px": 0.0, **more}
    return CameraSensor(name="eye", width_px=_SHAPE[1], height_px=_SHAPE[0], **given)


def _chip(key=7, **more):
    sensor = _camera(**more)
    return Chip(sensor, lens_of(sensor, rectified=False), np.uint64(key))


def _flat(chip, electrons, key, gain=1.0):
    """Values of an even scene of so many electrons."""
    channels = 3 if chip.sensor.colour else 1
    radiance = np.full((*_SHAPE, channels), electrons / (chip.per_radiance * _TIME), np.float32)
    return chip.read(radiance, Shutter(_TIME, gain), np.uint64(key)).astype(float)


@pytest.mark.parametrize("gain", [1.0, 4.0])
def test_variance_over_mean_is_the_line_of_the_photon_transfer(gain):
    """Var = K mean + (K read)² + 1/12: K the gain, 1/12 of rounding; half of a difference's."""
    chip = _chip()
    k = chip.values_per_electron(gain)
    assert k == pytest.approx(gain * 4095 / 20_000)
    levels = np.array([5, 20, 60, 200, 1000, 2500, 4500])
    pairs = [
        (_flat(chip, e, 2 * n, gain), _flat(chip, e, 2 * n + 1, gain))
        for n, e in enumerate(levels + 200)
    ]
    mean = np.array([0.5 * (a + b).mean() for a, b in pairs])
    variance = np.array([0.5 * (a - b).var() for a, b in pairs])
    spread = variance * np.sqrt(2.0 / np.prod(_SHAPE))
    wanted = k * mean + (k * _NOISE.read_e) ** 2 + 1.0 / 12.0
    assert np.all(np.abs(variance - wanted) < 4.5 * spread)
    assert np.allclose(mean, k * (levels + 200), rtol=0.004)


def test_few_electrons_are_poissons():
    chip = _chip(noise=CameraNoise(full_well_e=4095.0, read_e=0.0, prnu=0.0, dsnu_e=0.0))
    for mean in (0.3, 4.0, 39.0, 41.0):
        counts = _flat(chip, mean, 3)
        assert counts.mean() == pytest.approx(mean, abs=4.5 * np.sqrt(mean / counts.size))
        assert counts.var() == pytest.approx(mean, rel=4.5 * np.sqrt(2.5 / counts.size) + 0.01)
    assert (_flat(chip, 0.0, 3) == 0).all()


def test_patterns_stay_and_are_each_cameras_own():
    chip, other = _chip(7), _chip(8)
    high, low = (
        np.mean([_flat(chip, e, n) for n in range(24)], axis=0) / chip.values_per_electron(1.0)
        for e in (8000.0, 300.0)
    )
    slope = (high - low) / 7700.0
    assert np.std(slope) == pytest.approx(_NOISE.prnu, rel=0.1)
    assert np.std(low - 300.0 * slope) == pytest.approx(_NOISE.dsnu_e, rel=0.1)
    flat = np.mean([_flat(other, 8000.0, n) for n in range(100, 124)], axis=0)
    assert abs(np.corrcoef(high.ravel(), flat.ravel())[0, 1]) < 0.025


def test_noise_hangs_neither_on_its_neighbour_nor_on_the_last_picture():
    chip = _chip(noise=CameraNoise(prnu=0.0, dsnu_e=0.0))
    one, two = (_flat(chip, 5000.0, key) for key in (1, 2))
    bound = 3.3 / np.sqrt(one.size)
    pairs = [
        (one, two),
        (one[1:], one[:-1]),
        (one[:, 1:], one[:, :-1]),
        (one[1:, 1:], one[:-1, :-1]),
    ]
    for a, b in pairs:
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < bound
    assert np.array_equal(one, _flat(chip, 5000.0, 1))


def test_noise_is_gauss_out_to_its_tails():
    plain = {"shot": False, "prnu": 0.0, "dsnu_e": 0.0}
    chip = _chip(noise=CameraNoise(full_well_e=1e6, read_e=1000.0, **plain), bits=16)
    k = chip.values_per_electron(1.0)
    found = np.concatenate([_flat(chip, 5e5, n).ravel() for n in range(6)]) / k
    z = (found - 5e5) / 1000.0
    assert stats.kstest(z, "norm").pvalue > 0.001
    for sigma in (3.0, 3.6):
        wanted = 2.0 * stats.norm.sf(sigma) * z.size
        assert np.count_nonzero(np.abs(z) > sigma) == pytest.approx(wanted, abs=4 * np.sqrt(wanted))


def test_simulators_noise_is_that_of_half_a_well():
    """Of a ZED, 0.007 of full scale."""
    noise = CameraNoise(prnu=0.0, dsnu_e=0.0)
    assert noise.at_half == pytest.approx(0.007, abs=2e-4)
    values = _flat(_chip(noise=noise, bits=16), 0.5 * noise.full_well_e, 1)
    assert values.std() / 65535 == pytest.approx(noise.at_half, rel=0.02)


def test_a_full_well_is_white_and_colours_have_three_values():
    for bits in (8, 10, 16):
        white = _flat(_chip(bits=bits, noise=CameraNoise(dsnu_e=0.0)), 1e5, 1)
        assert (white == 2**bits - 1).all()
    assert _flat(_chip(colour=True), 100.0, 1).shape == (*_SHAPE, 3)
    quiet = CameraNoise(shot=False, read_e=0.0, prnu=0.0, dsnu_e=0.0)
    half = _flat(_chip(bits=8, gamma=2.0, noise=quiet), 2500.0, 1)
    assert (half == round(255 * 0.5)).all()


def test_blur_keeps_light_and_has_the_variance_that_it_says():
    for width in (0.3, 0.5, 1.7):
        point = np.zeros((31, 33, 3), np.float32)
        point[15, 16, 1] = 1.0
        spread = blur(point, width)[:, :, 1]
        assert spread.sum() == pytest.approx(1.0, abs=1e-5)
        for axis, middle in ((0, 16), (1, 15)):
            profile = spread.sum(axis=axis)
            assert profile @ (np.arange(len(profile)) - middle) ** 2 == pytest.approx(
                width**2, rel=0.005
            )
    noise = np.random.default_rng(0).random((9, 13, 3)).astype(np.float32)
    for width in (0.5, 6.0):
        assert blur(noise, width).sum() == pytest.approx(float(noise.sum()), rel=1e-5)


def test_corners_are_darker_by_the_fourth_power_of_the_cosine():
    sensor = _camera(vignetting=(-0.1, 0.02, 0.0), horizontal_fov_deg=90.0)
    lens = lens_of(sensor, rectified=False)
    r2 = ((0 - 99.5) ** 2 + (0 - 79.5) ** 2) / (0.25 * (200**2 + 160**2))
    wanted = (1 - 0.1 * r2 + 0.02 * r2**2) * float(rays_of(lens)[0, 0, 2]) ** 4
    assert vignetting(sensor, lens)[0, 0] == pytest.approx(wanted, rel=1e-5)


def test_electrons_follow_from_the_optics():
    """Radiance 20 W/(m² sr), f/2, 4 µm, 1 ms: L π/(4N²) p² t = 6.3e-14 J; 39 % of it visible."""
    photons = 20.0 * np.pi / 16.0 * 16e-12 * 1e-3 * 0.39 / 3.61e-19
    assert 20.0 * 1e-3 * electrons_per_radiance(_camera()) == pytest.approx(0.5 * photons)


@pytest.mark.parametrize("noise", [_NOISE, CameraNoise(full_well_e=9e6, read_e=500.0)])
def test_a_quick_picture_is_that_of_pixels_two_by_two(noise):
    """As bright at the same exposure, and with the noise of means of four pixels or more."""
    full = _camera(noise=noise, exposure=FixedExposure(time_s=_TIME), bits=16)
    quick, electrons = full.quick, 0.4 * noise.full_well_e
    radiance = electrons / (electrons_per_radiance(full) * _TIME)

    def values(sensor):
        chip = Chip(sensor, lens_of(sensor, rectified=False), np.uint64(7))
        even = np.full((sensor.height_px, sensor.width_px, 1), radiance, np.float32)
        return chip.read(even, Shutter(_TIME, 1.0), np.uint64(3)).astype(float)

    fine, found = values(full), values(quick)
    means = fine.reshape(80, 2, 100, 2).mean(axis=(1, 3))
    assert found.mean() == pytest.approx(0.4 * 65535, rel=1e-3)
    assert found.mean() == pytest.approx(fine.mean(), rel=1e-3)
    if noise is _NOISE:
        assert found.shape == means.shape
        assert found.std() == pytest.approx(means.std(), rel=0.05)
    dark = [one.noise.read_e / one.noise.full_well_e for one in (full, quick)]
    assert dark[1] == pytest.approx(dark[0] / np.sqrt(quick.noise.full_well_e / noise.full_well_e))


def _meter(spec, radiance, *, rate=10.0, seen=None, above=1.0):
    def look(number):
        if seen is not None:
            seen.append(number)
        sky = np.arange(18)[:, None] < 6 + np.zeros(32)
        image = np.where(sky, above, 1.0) * radiance(number)
        return image[:, :, None].astype(np.float32), sky

    return Meter(spec, rate=rate, enough=0.02, look=look)


def test_the_shutter_follows_with_its_lag():
    """After a step of a factor 4 the logarithm is nearer by 1 - exp(-t / lag)."""
    spec = AutoExposure(level=0.5, lag_s=1.0, shortest_s=1e-6, longest_s=0.1)
    meter = _meter(spec, lambda n: 10.0 if n < 50 else 40.0)
    assert meter.shutter(49).time == pytest.approx(0.5 * 0.02 / 10.0, rel=0.006)
    found = np.log2([meter.shutter(50 + n).time / 1e-3 for n in (9, 19, 39)])
    for steps, step in zip((10, 20, 40), found, strict=True):
        assert step == pytest.approx(-2.0 * (1.0 - np.exp(-steps / 10.0)), abs=0.08)
    alone = _meter(spec, lambda n: 10.0 if n < 50 else 40.0)
    assert alone.shutter(63) == meter.shutter(63)
    assert _meter(spec, lambda n: 10.0).shutter(0) == _meter(spec, lambda n: 10.0).shutter(400)


def test_the_shutter_keeps_to_its_limits_and_then_amplifies():
    spec = AutoExposure(level=0.5, lag_s=0.0, longest_s=2e-3, shortest_s=1e-4, most_gain=8.0)
    wanted = {0.0: (2e-3, 8.0), 1.0: (2e-3, 5.0), 10.0: (1e-3, 1.0), 1e6: (1e-4, 1.0)}
    for radiance, shutter in wanted.items():
        found = _meter(spec, lambda _, value=radiance: value).shutter(3)
        assert tuple(found) == pytest.approx(shutter, rel=0.006)
    assert _meter(FixedExposure(time_s=0.003, gain=2.0), None).shutter(9) == (0.003, 2.0)


def test_the_ground_is_metered_until_the_sky_gets_white():
    """At 0.5 for the ground the sky may be 1.9 times as bright; at 3.8 times the shutter halves."""
    spec = AutoExposure(level=0.5, lag_s=0.0)
    found = [_meter(spec, lambda _: 10.0, above=above).shutter(0).time for above in (0, 1.8, 3.8)]
    assert found == pytest.approx([1e-3, 1e-3, 5e-4], rel=0.006)


def test_a_sky_that_is_ignored_gets_white():
    spec = AutoExposure(level=0.5, lag_s=0.0, sky="ignored")
    for above in (0, 1.8, 100.0):
        found = _meter(spec, lambda _: 10.0, above=above).shutter(0).time
        assert found == pytest.approx(1e-3, rel=0.006)
    presets, plain = CameraSensor.PRESETS, CameraSensor(name="eye")
    assert (presets["paper"]["exposure"]["sky"], plain.exposure.sky) == ("ignored", "held")


def test_few_looks_serve_many_pictures():
    seen = []
    meter = _meter(AutoExposure(lag_s=0.5), lambda n: 5.0 + n, rate=100.0, seen=seen)
    for number in range(200, 400):
        meter.shutter(number)
    assert len(seen) == len(set(seen)) < 60
