"""Craters fresh and worn: a profile is a sum of three shapes that wear down independently.

With x the distance from the centre in radii, h the rim's height, d the depth and T the thickness of
the ejecta at the crest: z = h - d A(x) within the crest, and (h - T) B(x) + T C(x) outside. A and B
are the profile of Fassett & Thomson 2014 (doi:10.1002/2014JE004698, eq. 4), C falls as x⁻³
(McGetchin et al. 1973, doi:10.1016/0012-821X(73)90162-3).

Wear: craters diffuse, ∂z/∂t = κ ∇²z, each for its own age. This is Culling & Soderblom's model of
small impacts as it is used since Fassett & Thomson. All craters of one shape wear alike in
τ = κ t / D², so that one table of diffused shapes serves them all.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.model import Body

CREST = 0.98
"""Distance of the rim's crest [radii]."""
FT_DEPTH = 0.2178221
"""Depth of Fassett & Thomson's profile, crest to floor [diameters]."""
FT_RIM = 0.0368221
"""Height of its crest [diameters]."""
EJECTA_FADE = (2.3, 2.7)
"""Where the continuous ejecta blanket ends [radii]: from all to nothing."""
_FLOOR = 0.2
_EDGE = 1.5
_INNER = (-0.228809953, 0.227533882, 0.083116795, -0.039499407)
_OUTER = (0.188253307, -0.187050452, 0.01844746, 0.01505647)
RIM_SHARE = 0.5
"""Largest part of a rim's height that its ejecta make up; the rest is uplift."""

REACH = 5.0
"""Farthest distance at which a crater of any age shows [radii]."""
STEP = 0.01
"""Distance of the table's columns [radii]; crest and floor's edge lie on columns."""
ROWS = 96
"""Rows of the table over 0 ≤ √τ ≤ 1. A crater of τ > 1 is gone."""

_DOMAIN = 8.0
_MODES = 400
_VISIBLE = 3e-4
"""Height [diameters] below which a worn crater ends."""
VANISHING = 0.046
"""Depth over diameter down to which craters are counted: with it, half of those of 40 to 100 m that
are at equilibrium on the Moon are shallower than 0.07 (Basilevsky 1976, as in NASA's SLS-SPEC-159,
table 3.4.1.2-2)."""


def fassett_thomson(x: Array) -> Array:
    """Height over diameter of Fassett & Thomson's fresh crater at distances in radii."""
    x = np.asarray(x, np.float64)
    inner = np.polynomial.polynomial.polyval(x, _INNER)
    outer = np.polynomial.polynomial.polyval(x, _OUTER)
    return np.where(x <= _FLOOR, -0.181, np.where(x <= CREST, inner, np.where(x < _EDGE, outer, 0)))


def shapes(x: Array) -> Array:
    """The three shapes at distances in radii, shape [3, …]: -A, B and C (within the crest 1)."""
    x = np.asarray(x, np.float64)
    profile, inside = fassett_thomson(x), x <= CREST
    cavity = np.where(inside, (FT_RIM - profile) / FT_DEPTH, 0.0)
    uplift = np.where(inside, 1.0, np.clip(profile / FT_RIM, 0.0, 1.0))
    start, end = EJECTA_FADE
    fade = np.clip((end - x) / (end - start), 0.0, 1.0)
    ejecta = portable.power(np.maximum(x, 1.0), -3.0) * fade * fade * (3.0 - 2.0 * fade)
    return np.stack([-cavity, uplift, ejecta])


@cache
def worn_shapes() -> tuple[Array, Array]:
    """The table of diffused shapes, and where a crater ends at each row's age [radii].

    The three shapes at √τ = row / (rows - 1) and x = column · STEP, shape [rows, columns, 3], by a
    Fourier-Bessel series on a disc of 8 radii.

    Summed without threads, so that its bits are the same everywhere.
    """
    from scipy.special import j0, j1, jn_zeros

    zeros = jn_zeros(0, _MODES)
    fine = (np.arange(int(EJECTA_FADE[1] / STEP) * 8, dtype=np.float64) + 0.5) * (STEP / 8.0)
    series = np.einsum("sx,kx->sk", shapes(fine) * fine, j0(zeros[:, None] * fine / _DOMAIN))
    series *= 2.0 * (STEP / 8.0) / (_DOMAIN * j1(zeros)) ** 2
    x = np.arange(round(REACH / STEP) + 2, dtype=np.float64) * STEP
    tau = (np.arange(ROWS) / (ROWS - 1)) ** 2
    # In radii, the time is κ t / R² = 4 τ.
    decay = portable.exp(-4.0 * tau[:, None] * (zeros / _DOMAIN) ** 2)
    waves = j0(zeros[:, None] * x / _DOMAIN)
    values = np.stack([np.einsum("tk,kx->tx", decay * one, waves) for one in series], axis=-1)
    values[0] = shapes(x).T
    usual = np.array([FT_DEPTH, 0.5 * FT_RIM, 0.5 * FT_RIM])  # of a deep crater
    seen = np.abs(portable.product(values, usual)) > _VISIBLE
    last = x.size - 1 - np.argmax(seen[:, ::-1], axis=1)
    # The part towards the end is faded out, which must not touch what is visible.
    reach = np.minimum(x[last] / 0.85, REACH)
    reach[0] = EJECTA_FADE[1]
    reach = np.maximum.accumulate(reach)
    share = np.clip((reach[:, None] - x) / (0.15 * reach[:, None]), 0.0, 1.0)
    values[1:] *= (share * share * (3.0 - 2.0 * share))[1:, :, None]
    values.setflags(write=False)
    return values, reach


def vanishing_wear(diameter: Array, *, body: Body) -> Array:
    """τ at which craters of diameters [m] are too shallow to be counted."""
    usual = np.array([FT_DEPTH, 0.5 * FT_RIM, 0.5 * FT_RIM])
    depth = np.ptp(portable.product(worn_shapes()[0], usual), axis=1)
    left = VANISHING / fresh_ratio(diameter, body=body)
    root = np.interp(left, (depth / depth[0])[::-1], np.arange(ROWS)[::-1] / (ROWS - 1))
    return root * root


def fresh_ratio(diameter: Array, *, body: Body) -> Array:
    """Depth over diameter of a body's fresh craters of diameters [m]: a D^b (1 - c exp(-D / s))."""
    (factor, exponent), (share, scale) = body.craters.depth, body.craters.shallow
    large = factor * portable.power(np.asarray(diameter, np.float64) / 1000.0, exponent)
    return np.asarray(large * (1.0 - share * portable.exp(-np.asarray(diameter) / scale)))


class FreshShapes(NamedTuple):
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
    """Measures of fresh simple craters of diameters [m], with or without an ejecta blanket.

    Depths are those of the body, or `depth_to_diameter` of all or of each, where that is not NaN.
    Rims are as high a part of the depth as the Moon's are by Pike 1977: depth 0.196 D^1.010, rim
    0.036 D^1.014, km.
    """
    diameter = np.asarray(diameter, np.float64)
    given = np.nan if depth_to_diameter is None else depth_to_diameter
    depth = np.where(np.isnan(given), fresh_ratio(diameter, body=body), given) * diameter
    rim = depth * (0.036 / 0.196) * portable.power(diameter / 1000.0, 0.004)
    blanket = np.minimum(ejecta_thickness(0.5 * diameter), RIM_SHARE * rim)
    return FreshShapes(depth=depth, rim=rim, ejecta=blanket if ejecta else np.zeros_like(blanket))


def ejecta_thickness(radius: Array) -> Array:
    """Ejecta at the rim of a crater of a radius [m]: 0.14 R^0.74 [m].

    McGetchin et al. 1973, doi:10.1016/0012-821X(73)90162-3, for large craters: below a radius of
    about 16 m it is more than the whole rim.
    """
    return np.asarray(0.14 * portable.power(radius, 0.74))
