"""The Earth and stars in a black sky: where they stand, how bright they are, in pictures too."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.base import RecipeError
from terrain_forge.model import MOON, Heightfield, Lighting
from terrain_forge.scene import Instances, RayScene, Subject, look, prepare_stage
from terrain_forge.scene.stage import SUN
from terrain_forge.sky import SkySpec, SunSpec, days_of, earth_disc, look_up, sky_points
from terrain_forge.sky.orbits import about_sun, unit
from tests.helpers.recipes import flat


def recipe(body="moon", **sky):
    sun = SunSpec(time="2030-01-01", ltst="09:00")
    more = {"body": body, "horizon": tf.HorizonSpec(reach_m=0), "sun": sun, "sky": SkySpec(**sky)}
    return flat((4.0, 4.0), 0.5, shapes=1, lonlat=(10.0, -20.0), **more)


@pytest.fixture(scope="module")
def light():
    return tf.realise(tf.plan(recipe(stars=True, star_gain=100.0))).lighting


def test_the_celestial_frame_is_that_of_the_sun():
    days = days_of(datetime(2031, 2, 18, tzinfo=UTC)) + 7.3 * np.arange(5)
    above = look_up(MOON.ephemeris, (0.4, -0.3), days)
    celestial = unit(-about_sun(MOON.ephemeris, days))
    turned = (above.celestial * celestial[:, None, :]).sum(axis=2)
    assert (turned * above.sun).sum(axis=1) == pytest.approx(1.0, abs=1e-7)
    assert above.celestial @ above.celestial.swapaxes(1, 2) == pytest.approx(
        np.tile(np.eye(3), (5, 1, 1)), abs=1e-12
    )
    # The Sun lights the Earth from nearly where it lights the Moon from.
    assert (above.earth_sun * above.sun).sum(axis=1) == pytest.approx(1.0, abs=0.003)


def test_stars_stand_where_catalogues_say(light):
    """Sirius and Canopus, and what 1627 stars send: some 0.9 of that of all of magnitude 5."""
    stars = sky_points(light)
    for row, (ra, dec) in enumerate(((101.287, -16.716), (95.988, -52.696))):
        ra, dec = np.radians((ra, dec))
        wanted = light.celestial @ [np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)]
        assert stars.towards[row] == pytest.approx(wanted, abs=1e-5)
    flux = stars.rgb[:, 1] / light.star_gain
    distance = 2.0 * 695_700.0 / 149_597_870.7 / light.sun_diameter
    assert flux[0] == pytest.approx(10 ** (-0.4 * (26.76 - 1.44)) * distance**2, rel=1e-6)
    assert 2.512**-6.5 < flux.min() / flux.max() < 2.512**-6.4
    blue, red = stars.rgb[0], stars.rgb[2 + np.argmax(stars.rgb[2:60, 0] / stars.rgb[2:60, 2])]
    assert blue[2] > blue[0]
    assert red[0] > 1.5 * red[2]


def test_the_earth_is_as_wide_and_as_full_as_it_is(light):
    disc = earth_disc(light)
    assert np.degrees(2.0 * disc.radius) == pytest.approx(1.9, abs=0.12)
    phase = np.arccos(-disc.sun @ disc.towards)
    across = np.cross(disc.towards, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    up = np.cross(across, disc.towards)
    x, y = np.meshgrid(*[np.linspace(-1.1, 1.1, 301) * disc.radius] * 2)
    image = disc.radiance(disc.towards + x[..., None] * across + y[..., None] * up, 1e-5)
    pixel = (2.2 * disc.radius / 300) ** 2
    # A Lambert sphere: 2/3 A (sin α + (π - α) cos α) / π of the Sun on its disc.
    wanted = 2.0 / 3.0 * (np.sin(phase) + (np.pi - phase) * np.cos(phase)) / np.pi
    wanted *= np.pi * disc.radius**2 * disc.rgb
    assert image.sum(axis=(0, 1)) * pixel == pytest.approx(wanted, rel=0.01)


def subject(light, **changes):
    return Subject(
        ground=Heightfield(elevation=np.zeros((9, 9)), spacing=1.0, origin=(-4.0, -4.0)),
        ground_rgb=np.full((9, 9, 3), 120, np.uint8),
        instances=Instances(
            meshes=(), mesh=np.zeros(0, np.int32), position=np.zeros((0, 3)),
            rotation=np.zeros((0, 3, 3)), scale=np.zeros(0), grain=np.zeros(0),
            rgb=np.zeros((0, 3)),
        ),
        lighting=light,
        sun_diameter=0.0093,
        seed=1,
        **changes,
    )  # fmt: skip


def photograph(light, towards, *, width=120, height=90, pixel=1e-3, channels=3):
    """A picture towards a place of the sky, the pixel there, and the Sun's radiance."""
    ahead = towards + 0.01 * np.array([0.3, -0.2, 0.1])
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    turn = np.column_stack([right, np.cross(ahead, right), ahead])
    x, y = np.meshgrid(np.arange(width) - 0.5 * (width - 1), np.arange(height) - 0.5 * (height - 1))
    rays = np.stack([pixel * x, pixel * y, np.ones_like(x)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    with RayScene(subject(light)) as scene:
        stage = prepare_stage(scene, light, channels)
        seen = look(
            scene, stage, rays=rays.astype(np.float32),
            position=np.tile([0.0, 0.0, 1.5], (height, 1)),
            rotation=np.tile(turn, (height, 1, 1)),
        )  # fmt: skip
    own = turn.T @ towards
    place = own[:2] / own[2] / pixel + 0.5 * np.array([width - 1, height - 1])
    return seen.radiance, place, stage.colours[SUN]


def test_pictures_show_the_earth_where_it_stands(light):
    disc = earth_disc(light)
    image, place, sun = photograph(light.replace(celestial=None), disc.towards)
    lit = image[..., 1] > 0.02 * image[..., 1].max()
    assert lit.any()
    rows, columns = np.nonzero(image[..., 1] > 0.0)
    away = np.hypot(columns - place[0], rows - place[1])
    assert away.max() == pytest.approx(disc.radius / 1e-3, abs=1.1)
    phase = np.arccos(-disc.sun @ disc.towards)
    flux = 2.0 / 3.0 * (np.sin(phase) + (np.pi - phase) * np.cos(phase)) * disc.radius**2
    assert image.sum(axis=(0, 1)) * 1e-6 == pytest.approx(flux * disc.rgb * sun, rel=0.02)
    none, _, _ = photograph(light.replace(celestial=None, earth=None), disc.towards)
    assert not none.any()


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.77])
def test_pictures_show_stars_to_a_fraction_of_a_pixel(light, shift):
    stars = sky_points(light)
    high = np.flatnonzero(stars.towards[:, 2] > 0.3)[0]
    alone = light.replace(earth=None, star_gain=1.0)
    towards = stars.towards[high] + shift * 1e-3 * np.array([0.2, 0.5, -0.1])
    towards /= np.linalg.norm(towards)
    image, _, sun = photograph(alone, towards, channels=1, width=24, height=18)
    mass = image[..., 0].astype(np.float64)
    assert (mass > 0).sum() <= 6
    flux = np.pi * stars.rgb[high].mean() / light.star_gain * sun[0]
    assert mass.sum() * 1e-6 == pytest.approx(flux, rel=0.01)
    centre = (np.indices(mass.shape)[::-1].reshape(2, -1) * mass.ravel()).sum(axis=1) / mass.sum()
    ahead = towards + 0.01 * np.array([0.3, -0.2, 0.1])
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    own = np.column_stack([right, np.cross(ahead, right), ahead]).T @ stars.towards[high]
    assert centre == pytest.approx(own[:2] / own[2] / 1e-3 + [11.5, 8.5], abs=0.01)


def test_a_small_earth_is_a_point():
    far = Lighting(
        sun_azimuth=1.0, sun_elevation=0.5, irradiance=9000.0, sky_rgb=(0.0, 0.0, 0.0),
        earth=(0.0, 0.6, 0.8), earth_diameter=1.5e-4, earth_sun=(1.2, -2.0, -1.5),
    )  # fmt: skip
    assert earth_disc(far) is None
    points = sky_points(far)
    assert len(points.towards) == 1
    assert 1e-12 < points.rgb[0, 1] < 1e-9


@pytest.mark.parametrize(
    ("made", "why"),
    [
        (recipe("mars", stars=True), "no stars are seen by day through the air of mars"),
        (replace(recipe(stars=True), sun=SunSpec()), "stars need the date: give sun.time"),
    ],
)
def test_stars_that_cannot_be_are_refused(made, why):
    with pytest.raises(RecipeError, match=why) as error:
        tf.plan(made)
    assert error.value.key == ("sky", "stars")
