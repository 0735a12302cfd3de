"""The sky as an image for lights that take one."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, linear_from_srgb
from terrain_forge.model import World
from terrain_forge.sky import daylight

SIZE = 512, 256
"""Pixels around and from zenith to nadir."""


def dome_image(world: World) -> Array | None:
    """Longitude and latitude image of a world's sky, linear RGB, shape [rows, columns, 3].

    The top row is the zenith, the left edge looks north, the middle south, clockwise between them.
    It is as bright in the mean, as level ground takes it, as a sky of the colour of the lighting;
    below the horizon it is what distant ground sends back. None where there is no dust in the air.
    """
    lighting = world.lighting
    if lighting.dust is None:
        return None
    columns, rows = SIZE
    up = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)
    azimuth = 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
    flat = np.cos(up)[:, None]
    towards = np.stack(
        [
            flat * np.sin(azimuth)[None, :],
            flat * np.cos(azimuth)[None, :],
            np.broadcast_to(np.sin(up)[:, None], (rows, columns)),
        ],
        axis=-1,
    )
    pixels = world.appearance.ground_rgb[::16, ::16]
    albedo = linear_from_srgb(pixels.mean(axis=(0, 1)) / 255.0)
    day = daylight(lighting.dust, float(lighting.towards_sun[2]), albedo)
    image = day.radiance(towards, lighting.towards_sun)
    image[up < 0.0] = albedo * (day.direct + day.diffuse)
    return np.asarray(image * (np.mean(lighting.sky_rgb) / day.diffuse.mean()))
