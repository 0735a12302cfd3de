"""The sky as an image for lights that take one."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.geometry.lights import LightLevels, world_daylight
from terrain_forge.model import Lighting, World
from terrain_forge.sky import earth_disc, sky_points

SIZE = 512, 256
"""Pixels around and from zenith to nadir of a dusty sky."""
BLACK_SIZE = 1024, 512
"""The same of a black one, in which the Earth is five pixels wide."""


def dome_image(world: World) -> Array | None:
    """Longitude and latitude image of a world's sky, linear RGB, shape [rows, columns, 3].

    The top row is the zenith, the left edge looks north, the middle south, clockwise between them.
    A dusty sky is as bright in the mean, as level ground takes it, as a sky of the colour of the
    lighting; below the horizon it is what distant ground sends back. In a black one are the Earth
    and the stars, 1 for white that faces the Sun. None where there is nothing of either.
    """
    if world.lighting.dust is not None:
        return _dusty(world)
    return _black(world.lighting) if _shines(world.lighting) else None


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


def _dusty(world: World) -> Array:
    lighting, towards = world.lighting, _directions(SIZE)
    day, albedo = world_daylight(world)
    image = day.radiance(towards, lighting.towards_sun)
    image[towards[:, 0, 2] < 0.0] = albedo * (day.direct + day.diffuse)
    return np.asarray(image * (np.mean(lighting.sky_rgb) / day.diffuse.mean()))


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
