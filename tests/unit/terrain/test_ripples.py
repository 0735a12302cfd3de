"""Bedforms of the wind: direction, wavelength, asymmetry, defects, and where there are none."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.base import RecipeError
from terrain_forge.making import plan
from terrain_forge.model import Image
from terrain_forge.rocks import Golombek, PopulationSpec, RocksSpec
from terrain_forge.terrain import shape_ground
from terrain_forge.terrain.layers.displacement_map import DisplacementMap
from terrain_forge.terrain.layers.ripples import Ripples, steepest_lee
from tests.helpers import worlds
from tests.helpers.recipes import flat

SITE = worlds.site().replace(size=(80.0, 80.0), spacing=0.125)


def heights(layer, site=SITE):
    return shape_ground(site=site, window=site.window, layers=(layer,)).elevation.astype(float)


def spectrum(z):
    """Wave numbers east and north [1/m] and the power of each."""
    taper = np.hanning(len(z))[:, None] * np.hanning(z.shape[1])
    power = np.abs(np.fft.fft2(z * taper)) ** 2
    k = np.fft.fftfreq(len(z), SITE.spacing)
    return k[None, :], k[:, None], power


@pytest.mark.parametrize("wind", [0.0, 60.0, 305.0])
def test_crests_lie_across_the_wind_at_their_wavelength(wind):
    z = heights(Ripples(wavelength_m=2.0, wind_from_deg=wind, rock_cover=None))
    east, north, power = spectrum(z)
    along = np.sin(np.radians(wind)) * east + np.cos(np.radians(wind)) * north
    length = np.hypot(east, north)
    first = (length > 0.3) & (length < 0.75)
    mean = np.sum((np.abs(along) * power)[first]) / power[first].sum()
    assert 1.0 / mean == pytest.approx(2.0, rel=0.1)
    bend = np.degrees(np.arccos(np.clip(np.abs(along[first]) / length[first], 0, 1)))
    assert np.sqrt(np.sum(bend**2 * power[first]) / power[first].sum()) < 25.0


def test_lee_side_looks_downwind_and_is_the_steeper_one():
    layer = Ripples(
        wavelength_m=2.0, wind_from_deg=270.0, stoss=0.75, sinuosity=0.0, defects=0.0,
        height_m=0.1, rock_cover=None,
    )  # fmt: skip
    rise = np.diff(heights(layer), axis=1) / SITE.spacing  # the wind blows east
    assert -rise.min() > 2.0 * rise.max()
    assert np.mean(rise > 0.0) == pytest.approx(0.75, abs=0.07)
    other = heights(Ripples(**(vars(layer) | {"wind_from_deg": 90.0})))
    assert np.diff(other, axis=1).max() > 2.0 * -np.diff(other, axis=1).min()


def test_without_defects_and_bends_they_are_straight_and_of_full_height():
    layer = Ripples(
        wavelength_m=4.0, wind_from_deg=270.0, sinuosity=0.0, defects=0.0, height_m=0.2,
        rock_cover=None,
    )  # fmt: skip
    z = heights(layer)
    assert np.ptp(z) == pytest.approx(0.2, rel=0.02)
    assert np.abs(z - z[0]).max() < 1e-6
    assert np.abs(z[:, 32:] - z[:, :-32]).max() < 1e-6


def ends(z, wavelength=2.0):
    """Points about which the phase of the first harmonic turns once: ends and forks of crests."""
    k = np.fft.fftfreq(z.shape[1], SITE.spacing)
    half = np.fft.fft(z, axis=1) * ((k > 0.4 / wavelength) & (k < 1.7 / wavelength))
    phase = np.angle(np.fft.ifft(half, axis=1))[16:-16:2, 16:-16:2]
    corners = phase[:-1, :-1], phase[:-1, 1:], phase[1:, 1:], phase[1:, :-1]
    turn = sum(
        (b - a + np.pi) % (2 * np.pi) - np.pi
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
    )
    return int(np.sum(np.abs(turn) > np.pi))


def test_more_defects_make_more_crests_end():
    counts = [
        ends(heights(Ripples(wavelength_m=2.0, wind_from_deg=270, defects=d, rock_cover=None)))
        for d in (0.0, 0.4, 0.9)
    ]
    assert counts[0] == 0
    assert 0 < counts[1] < counts[2]


def test_they_keep_the_mean_height_and_are_no_sine():
    layer = Ripples(wavelength_m=2.0, height_m=0.15, rock_cover=None)
    z = heights(layer)
    assert abs(z.mean()) < 0.01 * layer.height
    assert np.ptp(z) <= layer.height * 1.001
    # The phase wanders: correlation is lost some wavelengths away.
    lag = round(20.0 / SITE.spacing)
    assert abs(np.corrcoef(z[:, lag:].ravel(), z[:, :-lag].ravel())[0, 1]) < 0.5


def test_profile_has_its_height_and_mean_and_lee_its_slope():
    part = (np.arange(20000) + 0.5) / 20000
    for stoss, sharpness in ((0.5, 0.0), (0.65, 0.3), (0.9, 1.0)):
        layer = Ripples(
            wavelength_m=1.0, stoss=stoss, sharpness=sharpness, sinuosity=0.0, defects=0.0
        )
        height, spacing = np.ones((1, len(part))), 1.0 / len(part)
        form = layer.bedforms(np.uint64(1), part, np.zeros(1), spacing=spacing, height=height)[0]
        assert form.mean() == pytest.approx(0.0, abs=1e-4)
        assert np.ptp(form) == pytest.approx(1.0, abs=1e-3)
        steepest = -np.diff(form).min() * len(part) * 0.06
        lee = steepest_lee(ratio=0.06, stoss=stoss, sharpness=sharpness)
        assert np.tan(lee) == pytest.approx(steepest, rel=1e-3)


def test_steep_ground_has_none():
    ramp = np.broadcast_to(np.linspace(0.0, 1.0, 641) ** 2 * 20.0, (641, 641))
    site = SITE.replace(images=(Image(path="ramp", values=ramp / 20.0),))
    ground = DisplacementMap(image="ramp", height_m=20.0)
    layer = Ripples(wavelength_m=2.0, slope_deg=(8.0, 16.0), rock_cover=None, defects=0.0)
    both = shape_ground(site=site, window=site.window, layers=(ground, layer)).elevation
    bare = shape_ground(site=site, window=site.window, layers=(ground,)).elevation
    added = (both - bare).astype(float)
    slope = np.degrees(np.arctan(0.5 * np.linspace(0.0, 1.0, 641)))
    assert np.abs(added[:, slope > 16.5]).max() < 1e-5
    full = added[:, slope < 7.5].std()
    assert full == pytest.approx(heights(layer)[:, slope < 7.5].std(), rel=1e-3)
    half = added[:, (slope > 11.8) & (slope < 12.2)].std()
    assert half == pytest.approx(0.5 * full, rel=0.2)


def test_name_and_seed_make_other_ripples():
    one = heights(Ripples(wavelength_m=2.0, rock_cover=None))
    named = heights(Ripples(name="others", wavelength_m=2.0, rock_cover=None))
    seeded = heights(Ripples(wavelength_m=2.0, rock_cover=None), SITE.replace(seed=9))
    assert abs(np.corrcoef(one.ravel(), named.ravel())[0, 1]) < 0.3
    assert abs(np.corrcoef(one.ravel(), seeded.ravel())[0, 1]) < 0.3


def recipe(layer, *, k=0.02, density_image=None, spacing=0.25):
    population = PopulationSpec(
        name="stones",
        size_frequency=Golombek(k=k),
        diameter_m=(0.2, 1.0),
        density_image=density_image,
    )
    terrain, rocks = {"layers": (layer,)}, RocksSpec(populations=(population,))
    return flat((40.0, 40.0), spacing, terrain=terrain, rocks=rocks, exports=())


def test_rocky_ground_has_lower_ripples(tmp_path):
    from PIL import Image as Picture

    half = np.zeros((40, 40), np.uint8)
    half[:, 20:] = 255  # rocks in the east
    Picture.fromarray(half).save(tmp_path / "half.png")
    layer = Ripples(wavelength_m=2.0, rock_cover=(0.02, 0.1), defects=0.0)
    site = plan(recipe(layer, k=0.25, density_image="half.png"), folder=tmp_path)
    z = shape_ground(site=site, window=site.window, layers=(layer,)).elevation
    assert z[:, :70].std() > 0.02
    assert np.abs(z[:, 90:]).max() == 0.0


def test_what_sand_or_the_grid_cannot_do_is_refused():
    with pytest.raises(RecipeError, match=r"0\.5 m at a spacing of 0\.25 m.*1 m") as error:
        plan(recipe(Ripples(wavelength_m=0.5)))
    assert error.value.key == ("terrain", "layers", 0, "wavelength_m")
    with pytest.raises(RecipeError, match=r"lee sides of 5\d°, sand rests at up to 34°"):
        plan(recipe(Ripples(wavelength_m=2.0, height_m=0.6)))
    with pytest.raises(ValueError, match="the lower value first"):
        Ripples(wavelength_m=2.0, slope_deg=(20.0, 10.0))
