"""How bright exported lights are, for formats that take numbers as viewers do.

In nature the Sun is hundreds of W/m² or tens of kilolux, for which no viewer opens its eyes by
itself: the world is white. Lights for display are such that level ground shows somewhat below its
own albedo where a viewer takes light as it stands (`usdview`, three.js).
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from terrain_forge.model import Lighting

Lights = Literal["display", "physical"]
_SUNNY, _AIRLESS, _SKY = 0.3, 0.4, 0.35
"""Level white ground in the Sun, on a body with air and without; under the sky alone."""
_LOWEST = 0.15
"""Sine of the Sun's elevation below which level ground gets darker."""
_SKY_SHARE = 0.2
"""Irradiance of the sky over the Sun's, an even compromise between a dusty day and a clear one."""


class LightLevels(NamedTuple):
    """Brightness of Sun and sky."""

    sun: float
    """Irradiance of a surface that faces the Sun: [W/m²], or that over π which shows as 1."""
    sky: float
    """Radiance of a sky of the colour 1: [W/(m² sr)], or what shows as 1."""


def light_levels(lighting: Lighting, lights: Lights) -> LightLevels:
    """How bright Sun and sky are as an export has them."""
    if lights == "physical":
        sky = _SKY_SHARE * lighting.irradiance / np.pi
        return LightLevels(sun=lighting.irradiance, sky=float(sky))
    mean = sum(lighting.sky_rgb) / 3.0
    level = _SUNNY if mean > 0.0 else _AIRLESS
    sun = level * np.pi / max(float(lighting.towards_sun[2]), _LOWEST)
    return LightLevels(sun=float(sun), sky=_SKY / mean if mean > 0.0 else 0.0)
