"""Fresh craters: depth, rim and ejecta by diameter and body, and how far craters are simple."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array

LARGEST_SIMPLE = {"moon": 10_583.0, "mars": 6_000.0}
"""Diameter [m] at which craters become complex. Moon: where the depths of simple and complex
craters cross (Pike 1977); Mars: about 6 km (Robbins & Hynek 2012, doi:10.1029/2011JE003967)."""
RIM_SHARE = 0.5
"""Largest part of a rim's height that its ejecta make up; the rest is uplift."""

# Stopar et al. 2017, doi:10.1016/j.icarus.2017.05.022: depth over diameter of fresh lunar craters
# from these diameters [m] up, down to 40 m; below as continued by synthterrain (NASA Ames).
_STEPS = np.array([10.0, 40.0, 100.0, 200.0, 400.0])
_RATIOS = np.array([0.10, 0.11, 0.13, 0.15, 0.17, 0.21])
_MARS_RATIO = 0.2


@dataclass(frozen=True, kw_only=True)
class FreshShapes:
    """Measures of fresh craters, one each."""

    depth: Array
    """Floor below the rim's crest [m], shape [craters]."""
    rim: Array
    """Height of the crest above the ground around [m], shape [craters]."""
    ejecta: Array
    """Thickness of the ejecta at the crest [m], shape [craters]."""


def fresh_shapes(
    diameter: Array,
    *,
    body: str,
    depth_to_diameter: Array | float | None = None,
    ejecta: bool = True,
) -> FreshShapes:
    """Measures of fresh simple craters.

    Moon: Pike 1977 from 400 m up (depth 0.196 D^1.010, rim 0.036 D^1.014, km), and below the depths
    of Stopar et al. 2017, in the steps of their classes. Mars: depth 0.2 D, an average of what is
    reported for fresh primaries. Rims are as high a part of the depth as Pike's are.

    Args:
        diameter: diameters [m].
        body: `moon` or `mars`.
        depth_to_diameter: depth over diameter, of all or of each, instead of the body's.
        ejecta: whether rims carry an ejecta blanket.
    """
    diameter = np.asarray(diameter, np.float64)
    kilometres = diameter / 1000.0
    pike = 0.196 * kilometres**0.010
    if depth_to_diameter is not None:
        ratio = np.full(diameter.shape, depth_to_diameter, np.float64)
    elif body == "moon":
        ratio = np.minimum(_RATIOS[np.searchsorted(_STEPS, diameter, side="right")], pike)
    else:
        ratio = np.full(diameter.shape, _MARS_RATIO)
    depth = ratio * diameter
    rim = depth * (0.036 * kilometres**0.014) / pike
    blanket = np.minimum(ejecta_thickness(0.5 * diameter), RIM_SHARE * rim)
    return FreshShapes(depth=depth, rim=rim, ejecta=blanket if ejecta else np.zeros_like(blanket))


def ejecta_thickness(radius: Array) -> Array:
    """Ejecta at the rim of a crater of a radius [m]: 0.14 R^0.74 [m].

    McGetchin et al. 1973, doi:10.1016/0012-821X(73)90162-3, for large craters: below a radius of
    about 16 m it is more than the whole rim.
    """
    return np.asarray(0.14 * np.asarray(radius, np.float64) ** 0.74)
