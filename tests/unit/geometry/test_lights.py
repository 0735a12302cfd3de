"""Sun and sky of exports, against closed forms of what dust lets through."""

from dataclasses import replace

import numpy as np
import pytest

from terrain_forge.geometry import dome_image, dome_level, light_levels, sky_colours
from terrain_forge.making import make_horizon
from terrain_forge.model.bodies.mars import MARS

TAUS = (0.05, 0.5, 2.0, 5.0)
AIR_MASSES = MARS.dust.air_masses


def under(world, tau, elevation_deg=30.0):
    dust = replace(MARS.dust, tau=tau)
    sun = np.radians(elevation_deg)
    return world.replace(lighting=world.lighting.replace(dust=dust, sun_elevation=sun))


def on_the_level(world, levels):
    """Irradiance of level ground by the dome's image, over π where that shows as 1."""
    image = dome_image(world)
    rows, columns = image.shape[:2]
    up = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)
    solid = np.cos(up) * np.pi / rows * 2.0 * np.pi / columns
    weight = (solid * np.clip(np.sin(up), 0.0, None))[:, None, None]
    return float((image * weight).sum(axis=(0, 1)).mean() * dome_level(world.lighting, levels))


@pytest.mark.parametrize("tau", TAUS)
def test_the_physical_sun_is_what_gets_through(small_world, tau):
    world = under(small_world, tau)
    thick = np.hypot(0.5, 1.0 / AIR_MASSES)
    expected = world.lighting.irradiance * np.exp(-tau / thick)
    assert light_levels(world, "physical").sun == pytest.approx(expected, rel=1e-6)


def test_sun_and_sky_together_are_less_than_what_arrives_above(small_world):
    skies = []
    for tau in TAUS:
        world = under(small_world, tau)
        levels = light_levels(world, "physical")
        skies.append(on_the_level(world, levels))
        assert 0.5 * levels.sun + skies[-1] < 0.5 * world.lighting.irradiance
    assert skies[0] < skies[1] > skies[3]  # little dust scatters little, much of it lets none in


@pytest.mark.parametrize("tau", TAUS)
def test_lights_for_display_are_as_bright_and_as_soft_as_the_day(small_world, tau):
    world = under(small_world, tau)
    shown, real = light_levels(world, "display"), light_levels(world, "physical")
    sun, sky = 0.5 * shown.sun / np.pi, on_the_level(world, shown) / np.pi
    assert sun + sky == pytest.approx(0.65, rel=0.02)
    assert sun / (sun + sky) == pytest.approx(shown.share, abs=0.01)
    part = 0.5 * real.sun / (0.5 * real.sun + on_the_level(world, real))
    assert shown.share == pytest.approx(part, abs=0.01)
    assert real.share == shown.share


def test_without_a_sky_all_light_is_the_suns(small_world):
    bare = small_world.lighting.replace(dust=None, sky_rgb=(0.0, 0.0, 0.0))
    levels = light_levels(small_world.replace(lighting=bare), "physical")
    assert levels == (bare.irradiance, 0.0, 1.0)


def test_the_sky_goes_down_to_the_skyline_of_a_site_above_the_land(small_world):
    bare = under(small_world, 0.5)
    land = make_horizon(bare.site, bare.ground, bare.appearance, bare.library)
    mesh, world = land.mesh, bare.replace(horizon=land)
    lower = mesh.vertices.copy()
    lower[np.abs(lower[:, :2]).min(axis=1) < 0.9 * lower[:, 0].max(), 2] -= 4000.0  # not corners
    high = world.replace(horizon=land.replace(mesh=replace(mesh, vertices=lower)))
    pixel = 180.0 / len(dome_image(world))

    def rows_of_sky(world):
        image = dome_image(world)
        return int((np.abs(image - image[-1]).max(axis=(1, 2)) > 0.0).sum())

    level = rows_of_sky(bare)
    dip = np.degrees(np.sqrt(2.0 * 4000.0 / bare.site.body.mean_radius))
    assert level == 90.0 / pixel
    assert rows_of_sky(world) == level + 1
    assert (rows_of_sky(high) - level - 1) * pixel == pytest.approx(dip, abs=pixel)
    top = float(world.ground.elevation.max()) + 4000.0
    of_a_site = dome_image(world, highest=top)  # of which the world is a part
    assert np.array_equal(of_a_site, dome_image(high))


@pytest.mark.parametrize("tau", TAUS)
def test_colours_of_the_sky_are_those_of_its_image(small_world, tau):
    world = under(small_world, tau)
    levels, colours = light_levels(world, "display"), sky_colours(world)
    assert np.pi * colours.mean.mean() == pytest.approx(on_the_level(world, levels), rel=0.02)
    image = dome_image(world) * dome_level(world.lighting, levels)
    row = round(image.shape[0] * (0.5 - 8.0 / 180.0))
    assert colours.horizon == pytest.approx(image[row].mean(axis=0), rel=0.2)


def test_without_dust_the_sky_has_the_colour_of_the_lighting(small_world):
    for sky in ((0.0, 0.0, 0.0), (0.3, 0.4, 0.6)):
        world = small_world.replace(lighting=small_world.lighting.replace(dust=None, sky_rgb=sky))
        level = light_levels(world, "display").sky
        for colour in sky_colours(world):
            assert colour == pytest.approx(level * np.array(sky))
