"""How bright exported lights are, for formats that take numbers as viewers do; the sky as an image.

In nature the Sun is hundreds of W/m² or tens of kilolux, for which no viewer opens its eyes by
itself: the world is white. Lights for display are such that level ground shows somewhat below its
own albedo where a viewer takes light as it stands (`usdview`, three.js). How much of the daylight
comes straight from the Sun is the same in both: as little as the dust lets through.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from terrain_forge.base import Array, linear_from_srgb, portable
from terrain_forge.model import Lighting, World
from terrain_forge.sky import Daylight, daylight, earth_disc, sky_points

Lights = Literal["display", "physical"]
_AIRY, _AIRLESS = 0.65, 0.4
"""Level white ground in daylight, on a body with a sky and without."""
_LOWEST = 0.15
"""Sine of the Sun's elevation below which level ground gets darker, for display."""
_SKY_SHARE = 0.3
"""Part of the daylight that comes from a sky of which no dust is known."""
SIZE = 512, 256
"""Pixels around and from zenith to nadir of a dusty sky."""
_EYE = 5.0
"""How high over the highest ground the sky is looked at [m]."""
_LOW = 2.0, 15.0
"""Elevations between which the sky over the horizon is looked at [deg]."""
BLACK_SIZE = 1024, 512
"""The same of a black one, in which the Earth is five pixels wide."""


class LightLevels(NamedTuple):
    """Brightness of Sun and sky."""

    sun: float
    """Irradiance of a surface that faces the Sun: [W/m²], or that over π which shows as 1."""
    sky: float
    """Radiance of a sky of the colour 1: [W/(m² sr)], or what shows as 1."""
    share: float
    """Part of the light on level ground that comes straight from the Sun."""


class SkyColours(NamedTuple):
    """Colours of a sky, linear RGB, shape [3] each."""

    mean: Array
    """As level ground takes it."""
    horizon: Array
    """As it looks over the horizon."""


def light_levels(world: World, lights: Lights) -> LightLevels:
    """How bright Sun and sky are as an export has them."""
    lighting = world.lighting
    mean, sine = sum(lighting.sky_rgb) / 3.0, float(lighting.towards_sun[2])
    level = _AIRY if mean > 0.0 else _AIRLESS
    direct, diffuse = 1.0, _SKY_SHARE / (1.0 - _SKY_SHARE) if mean > 0.0 else 0.0
    if lighting.dust is not None:
        day = world_daylight(world)[0]
        direct, diffuse = float(day.direct.mean()), float(day.diffuse.mean())
    share = direct / (direct + diffuse)
    if lights == "physical":
        sun = lighting.irradiance * direct
        ground = lighting.irradiance * max(sine, 0.0) / np.pi * diffuse
    else:
        sun = facing_sun(lighting, level * share)
        ground = level * (1.0 - share)
    return LightLevels(sun=float(sun), sky=float(ground / mean) if mean else 0.0, share=share)


def facing_sun(lighting: Lighting, level: float) -> float:
    """Irradiance, for display, of what faces a Sun that lights level white ground to a level."""
    return float(level * np.pi / max(float(lighting.towards_sun[2]), _LOWEST))


def world_daylight(world: World) -> tuple[Daylight, Array]:
    """Daylight under a world's dust, and the albedo of its ground, shape [3]."""
    lighting = world.lighting
    assert lighting.dust is not None
    pixels = world.appearance.ground_rgb[::16, ::16]
    albedo = linear_from_srgb(pixels.mean(axis=(0, 1)) / 255.0)
    return daylight(lighting.dust, float(lighting.towards_sun[2]), albedo), albedo


def dome_image(world: World, *, highest: float | None = None) -> Array | None:
    """Longitude and latitude image of a world's sky, linear RGB, shape [rows, columns, 3].

    The top row is the zenith, the left edge looks north, the middle south, clockwise between them.
    A dusty sky is as bright in the mean, as level ground takes it, as a sky of the colour of the
    lighting; below the land's skyline it is what distant ground sends back. In a black one are the
    Earth and the stars, 1 for white that faces the Sun. None where there is nothing of either.

    Args:
        world: The world.
        highest: Highest node of the site's ground [m], where the world is a part of it.
    """
    if world.lighting.dust is not None:
        top = float(world.ground.elevation.max()) if highest is None else highest
        return _dusty(world, top)
    return _black(world.lighting) if _shines(world.lighting) else None


def sky_colours(world: World) -> SkyColours:
    """What formats show that have no image of the sky, for display."""
    lighting, level = world.lighting, light_levels(world, "display").sky
    if lighting.dust is None:
        colour = level * np.array(lighting.sky_rgb)
        return SkyColours(colour, colour)
    day, _ = world_daylight(world)
    towards = _directions(SIZE)
    low, high = np.sin(np.radians(_LOW))
    towards = towards[(low < towards[:, 0, 2]) & (towards[:, 0, 2] < high)]
    horizon = _lit_sky(world, day, towards).mean(axis=(0, 1))
    return SkyColours(*(level * np.round([_gain(world, day) * day.diffuse, horizon], 6)))


def dome_level(lighting: Lighting, levels: LightLevels) -> float | None:
    """What an export takes its values times, None where there is no image."""
    if lighting.dust is not None:
        return levels.sky
    return levels.sun / float(np.pi) if _shines(lighting) else None


def _shines(lighting: Lighting) -> bool:
    return earth_disc(lighting) is not None or len(sky_points(lighting).towards) > 0


def _directions(size: tuple[int, int]) -> Array:
    """Unit vectors through the pixels, shape [rows, columns, 3]."""
    columns, rows = size
    up = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)[:, None]
    azimuth = 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
    flat = np.cos(up)
    whole = (flat * np.sin(azimuth), flat * np.cos(azimuth), np.sin(up))
    return np.stack(np.broadcast_arrays(*whole), axis=-1)


def _dusty(world: World, highest: float) -> Array:
    towards = _directions(SIZE)
    day, albedo = world_daylight(world)
    image = _lit_sky(world, day, towards)
    ground = albedo * (day.direct + day.diffuse)
    image[towards[:, 0, 2] < _skyline(world, highest)] = ground * _gain(world, day)
    return image


def _lit_sky(world: World, day: Daylight, towards: Array) -> Array:
    """Radiance of a dusty sky, as bright in the mean as one of the colour of the lighting."""
    return np.asarray(day.radiance(towards, world.lighting.towards_sun) * _gain(world, day))


def _gain(world: World, day: Daylight) -> float:
    return float(np.mean(world.lighting.sky_rgb) / day.diffuse.mean())


def _skyline(world: World, highest: float) -> float:
    """Sine of the elevation above which sky may be seen beyond the land, from the top."""
    land = world.horizon
    if land is None:
        return 0.0
    nodes, radius = land.mesh.vertices[: land.ground_vertices], world.site.body.mean_radius
    plan, up = nodes[:, :2], nodes[:, 2]
    # Those of the outermost ring, which is a rectangle around the site's middle.
    last = ((plan <= 0.999 * plan.min(axis=0)) | (plan >= 0.999 * plan.max(axis=0))).any(axis=1)
    far = (up + (plan * plan).sum(axis=1) / (2.0 * radius))[last]
    above = highest + _EYE - float(far.min())
    # A pixel more, since viewers blend them.
    return float(-np.sqrt(2.0 * max(above, 0.0) / radius) - np.pi / SIZE[1])


def _black(lighting: Lighting) -> Array:
    columns, rows = BLACK_SIZE
    towards, pixel = _directions(BLACK_SIZE), np.pi / rows
    disc, points = earth_disc(lighting), sky_points(lighting)
    image = np.zeros((rows, columns, 3)) if disc is None else disc.radiance(towards, pixel)
    # Points fill the pixel that they are in, of π times their share of the Sun's irradiance.
    east, north, up = points.towards.T
    down, around = portable.arctan2(np.hypot(east, north), up), portable.arctan2(east, north)
    row = np.minimum((down / pixel).astype(np.int64), rows - 1)
    column = np.minimum((around % (2.0 * np.pi) / pixel).astype(np.int64), columns - 1)
    area = 2.0 * np.sin(0.5 * pixel) * pixel * np.sin((row + 0.5) * pixel)
    np.add.at(image, (row, column), np.pi * points.rgb / area[:, None])
    return image
