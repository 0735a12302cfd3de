"""The Sun as a directional light (KHR_lights_punctual)."""

from __future__ import annotations

from typing import Any

import numpy as np

from terrain_forge.model import Lighting

from .options import Options

LIGHTS = "KHR_lights_punctual"
_SUNLIGHT_EFFICACY = 98.0
"""Luminous efficacy of sunlight above an atmosphere [lm/W]: 133.1 klx (IES RP-21) of 1361 W/m²."""


def sun_light(lighting: Lighting, options: Options) -> dict[str, Any]:
    """The light; glTF measures it in lux on a surface that faces it."""
    lux = options.sun_lux or lighting.irradiance * _SUNLIGHT_EFFICACY
    return {"type": "directional", "name": "sun", "color": [1, 1, 1], "intensity": lux}


def sun_node(lighting: Lighting) -> dict[str, Any]:
    """The node that holds the first light of the file and aims it: it shines along its -z."""
    east, north, up = lighting.towards_sun
    # The shortest turn from +z to the Sun, of which (north × up) is the axis.
    turn = np.array([-north, east, 0.0, 1.0 + up])
    rotation = turn / np.linalg.norm(turn)
    return {"name": "sun", "rotation": rotation.tolist(), "extensions": {LIGHTS: {"light": 0}}}
