"""Fresh craters: depth, rim and ejecta by diameter and body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.model import Body

RIM_SHARE = 0.5
"""Largest part of a rim's height that its ejecta make up; the rest is uplift."""


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
    body: Body,
    depth_to_diameter: Array | float | None = None,
    ejecta: bool = True,
) -> FreshShapes:
    """Measures of fresh simple craters.

    Depths are those of the body. Rims are as high a part of the depth as the Moon's are by Pike
    1977: depth 0.196 D^1.010, rim 0.036 D^1.014, km.

    Args:
        diameter: diameters [m].
        body: whose craters they are.
        depth_to_diameter: depth over diameter, of all or of each, instead of the body's; NaN for
            the body's.
        ejecta: whether rims carry an ejecta blanket.
    """
    diameter = np.asarray(diameter, np.float64)
    kilometres = diameter / 1000.0
    pike = 0.196 * portable.power(kilometres, 0.010)
    given = np.nan if depth_to_diameter is None else depth_to_diameter
    classes = np.searchsorted(body.craters.depth_steps, diameter, side="right")
    usual = np.array(body.craters.depth_ratios)[classes]
    if body.craters.depth_power is not None:
        factor, exponent = body.craters.depth_power
        usual = np.minimum(usual, factor * portable.power(kilometres, exponent))
    depth = np.where(np.isnan(given), usual, given) * diameter
    rim = depth * (0.036 * portable.power(kilometres, 0.014)) / pike
    blanket = np.minimum(ejecta_thickness(0.5 * diameter), RIM_SHARE * rim)
    return FreshShapes(depth=depth, rim=rim, ejecta=blanket if ejecta else np.zeros_like(blanket))


def ejecta_thickness(radius: Array) -> Array:
    """Ejecta at the rim of a crater of a radius [m]: 0.14 R^0.74 [m].

    McGetchin et al. 1973, doi:10.1016/0012-821X(73)90162-3, for large craters: below a radius of
    about 16 m it is more than the whole rim.
    """
    return np.asarray(0.14 * portable.power(radius, 0.74))
