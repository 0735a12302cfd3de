"""How bright exported lights are, for formats that take numbers as viewers do.

In nature the Sun is hundreds of W/m² or tens of kilolux, for which no viewer opens its eyes by
itself: the world is white. Lights for display are such that level ground shows somewhat below its
own albedo where a viewer takes light as it stands (`usdview`, three.js). How much of the daylight
comes straight from the Sun is the same in both: as little as the dust lets through.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from terrain_forge.base import Array, linear_from_srgb
from terrain_forge.model import Lighting, World
from terrain_forge.sky import Daylight, daylight

Lights = Literal["display", "physical"]
_AIRY, _AIRLESS = 0.65, 0.4
"""Level white ground in daylight, on a body with a sky and without."""
_LOWEST = 0.15
"""Sine of the Sun's elevation below which level ground gets darker, for display."""
_SKY_SHARE = 0.3
"""Part of the daylight that comes from a sky of which no dust is known."""


class LightLevels(NamedTuple):
    """Brightness of Sun and sky."""

    sun: float
    """Irradiance of a surface that faces the Sun: [W/m²], or that over π which shows as 1."""
    sky: float
    """Radiance of a sky of the colour 1: [W/(m² sr)], or what shows as 1."""
    share: float
    """Part of the light on level ground that comes straight from the Sun."""


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
