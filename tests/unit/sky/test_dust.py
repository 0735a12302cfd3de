"""Daylight under dust: energy, limits, the glow, and that pictures show the model's sky."""

from __future__ import annotations

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.base import RecipeError
from terrain_forge.model import MARS, MOON
from terrain_forge.scene import open_scene, pinhole_camera
from terrain_forge.scene.buffers import prepare_light
from terrain_forge.scene.picture import radiance_seen
from terrain_forge.sky import SkySpec, beam, daylight
from tests.helpers import worlds
from tests.helpers.recipes import flat

_GROUND = np.array([0.3, 0.15, 0.07])


def dust(tau):
    return MARS.dust.replace(tau=tau)


def towards(elevation_deg, azimuth_deg=0.0):
    e, a = np.radians([elevation_deg, azimuth_deg])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


@pytest.mark.parametrize("elevation_deg", [8.0, 40.0, 75.0])
@pytest.mark.parametrize("tau", [0.2, 0.5, 1.5])
def test_the_sky_that_is_seen_is_the_light_that_arrives(tau, elevation_deg):
    sun = towards(elevation_deg)
    day = daylight(dust(tau), float(sun[2]), _GROUND)
    random = np.random.default_rng(3)
    # Half of the looks about the Sun, where the sky is brightest: both kinds weighed together.
    count = 100_000
    up, turn = random.random(count), random.uniform(-np.pi, np.pi, count)
    level = np.sqrt(1.0 - up * up)
    looks = np.stack([level * np.cos(turn), level * np.sin(turn), up], axis=-1)
    cosine = 1.0 - random.random(count) ** 3 * 2.0
    spin, off = random.uniform(-np.pi, np.pi, count), np.sqrt(1.0 - cosine**2)
    aside = np.array([0.0, 1.0, 0.0])
    other = np.cross(sun, aside)
    near = cosine[:, None] * sun + (off * np.cos(spin))[:, None] * aside
    near += (off * np.sin(spin))[:, None] * other
    every = np.concatenate([looks, near])
    angle = np.clip(0.5 * (1.0 - every @ sun), 1e-9, 1.0)
    density = 0.5 / (2.0 * np.pi) * (every[:, 2] > 0.0)
    density = density + 0.5 / (12.0 * np.pi) * angle ** (-2.0 / 3.0)
    shines = day.radiance(every, sun) * np.maximum(every[:, 2], 0.0)[:, None] / density[:, None]
    assert shines.mean(axis=0) / np.pi == pytest.approx(day.diffuse, rel=0.04)
    # The aureole is what of it was scattered once and comes from within 15° of the Sun.
    once = shines - day.rest * np.maximum(every[:, 2], 0.0)[:, None] / density[:, None]
    close = once * (every @ sun > np.cos(np.radians(15.0)))[:, None]
    assert close.mean(axis=0) / np.pi == pytest.approx(day.aureole, rel=0.05)


def test_dust_takes_from_the_sun_and_gives_to_the_sky():
    taus, sine = (0.05, 0.3, 1.0, 3.0), 0.7
    days = [daylight(dust(tau), sine, _GROUND) for tau in taus]
    assert [day.direct[0] for day in days] == sorted((d.direct[0] for d in days), reverse=True)
    for day in days:
        assert (day.direct + day.diffuse < 1.0).all(), "dust absorbs"
        assert (np.diff(day.diffuse) < 0.0).all(), "blue more than red"
    clear = daylight(dust(1e-4), sine, _GROUND)
    assert clear.diffuse == pytest.approx(0.0, abs=3e-4)
    light = worlds.world().lighting.replace(dust=dust(0.5), sun_elevation=np.arcsin(sine))
    assert beam(light) == pytest.approx(np.exp(-0.5 / sine), rel=0.01)
    assert beam(light.replace(dust=None)) == 1.0


def test_a_thin_layer_scatters_as_its_phase_function_says():
    """L = ω P τ / (4 μ) of the Sun's irradiance over π, of small τ (Chandrasekhar 1960)."""
    tau, sun = 1e-4, towards(50.0)
    day = daylight(dust(tau), float(sun[2]), _GROUND)
    for angle in (20.0, 60.0, 110.0):
        look = towards(50.0 - angle) if angle < 40.0 else towards(50.0, angle * 1.2)
        cosine = float(look @ sun)
        share, forward, wide = (
            np.array(getattr(MARS.dust, n)) for n in ("share", "forward", "wide")
        )
        phase = share * (1 - forward**2) / (1 + forward**2 - 2 * forward * cosine) ** 1.5
        phase += (1 - share) * (1 - wide**2) / (1 + wide**2 - 2 * wide * cosine) ** 1.5
        wanted = np.array(MARS.dust.albedo) * phase * tau / (4.0 * look[2] * sun[2])
        once = day.radiance(look, sun) - day.rest
        assert once == pytest.approx(wanted, rel=0.06)


def test_the_glow_is_blue_and_the_sky_is_not():
    sun = towards(8.0)
    day = daylight(dust(0.5), float(sun[2]), _GROUND)
    glow, away = day.radiance(towards(10.0), sun), day.radiance(towards(10.0, 120.0), sun)
    assert glow[2] / glow[0] > 1.2
    assert away[2] / away[0] < 0.7
    assert glow[0] > 20.0 * away[0]


@pytest.mark.parametrize("azimuth_deg", [90.0, 290.0])
def test_pictures_show_this_sky(azimuth_deg):
    world = worlds.world()
    light = world.lighting.replace(
        dust=dust(0.8), sun_azimuth=np.radians(60.0), sun_elevation=np.radians(25.0)
    )
    camera = pinhole_camera(
        position=np.array([0.0, 0.0, 4.0]), yaw=np.radians(90.0 - azimuth_deg), pitch=-1.1,
        field_of_view=0.6, width=16, height=12,
    )  # fmt: skip
    with open_scene(world.replace(lighting=light)) as scene:
        made = prepare_light(scene.subject, light, facing=0.35)
        image = radiance_seen(scene, camera, light)
        albedo = made.bounce[0] / 0.35, made.bounce[1] / 0.35, made.bounce[2] / 0.35
    day = daylight(light.dust, float(light.towards_sun[2]), np.array(albedo))
    rays = camera.rays()[1]
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    wanted = day.radiance(rays, light.towards_sun) / made.through
    assert image.reshape(-1, 3) == pytest.approx(wanted, rel=0.02)
    assert made.haze == pytest.approx(11_000.0 / 0.8)
    # What is left in a shadow: all but the Sun and its aureole.
    left = (day.diffuse - day.aureole) / (day.direct + day.diffuse)
    assert made.sky == pytest.approx(left)


def recipe(body, tau):
    more = {"horizon": tf.HorizonSpec(reach_m=0), "sky": SkySpec(tau=tau)}
    return flat((4.0, 4.0), 0.5, shapes=1, body=body, **more)


def test_the_recipe_says_how_dusty_it_is(tmp_path):
    light = tf.realise(tf.plan(recipe("mars", 1.25))).lighting
    assert light.dust is not None
    assert light.dust.tau == 1.25
    clear = tf.realise(tf.plan(recipe("mars", 0.0))).lighting
    assert (clear.dust, max(clear.sky_rgb)) == (None, 0.0)
    usual = tf.realise(tf.plan(recipe("mars", None))).lighting
    assert usual.dust == MARS.dust
    with pytest.raises(RecipeError, match="moon has no dusty air") as error:
        tf.plan(recipe("moon", 0.5))
    assert error.value.key == ("sky", "tau")
    assert tf.realise(tf.plan(recipe("moon", None))).lighting.dust is MOON.dust
    (tmp_path / "x.yaml").write_text(
        "name: x\nbody: mars\ndtm: {kind: flat, size_m: [4, 4]}\n"
        "terrain: {spacing_m: 0.5}\nsky: {tau: -0.1}\n"
    )
    with pytest.raises(RecipeError, match=r"x.yaml:5: sky.tau: .*-0\.1"):
        tf.load_recipe(tmp_path / "x.yaml")


@pytest.mark.parametrize(("tau", "sine"), [(0.3, 0.5), (0.5, 0.3), (1.5, 0.8)])
def test_slopes_that_face_the_sun_get_more_of_the_sky(tau, sine):
    """By a sum over the sky, aureole aside; the lean is right to first order of a slope."""
    sun = np.array([np.sqrt(1.0 - sine * sine), 0.0, sine])
    day = daylight(dust(tau), sine, _GROUND)
    up, turn = (np.arange(400) + 0.5) / 400, 2 * np.pi * (np.arange(800) + 0.5) / 800
    flat = np.sqrt(1.0 - up * up)[:, None]
    towards = np.stack(
        np.broadcast_arrays(flat * np.cos(turn), flat * np.sin(turn), up[:, None]), axis=-1
    )
    seen = day.radiance(towards, sun) * ((towards @ sun) <= np.cos(np.radians(15.0)))[..., None]
    slope = np.radians(3.0)
    facing, level = (
        (seen * np.maximum(towards @ normal, 0.0)[..., None]).sum(axis=(0, 1))
        for normal in ([np.sin(slope), 0.0, np.cos(slope)], [0.0, 0.0, 1.0])
    )
    assert facing / level == pytest.approx(np.cos(slope) + day.lean * np.sin(slope), rel=0.004)
    assert (day.lean > 0.1).all()
