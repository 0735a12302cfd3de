"""The radial profile of a fresh crater, as a sum of three shapes that wear down independently.

With x the distance from the centre in radii, h the rim's height, d the depth and T the thickness of
the ejecta at the crest: z = h - d A(x) within the crest, and (h - T) B(x) + T C(x) outside. A and B
are the profile of Fassett & Thomson 2014 (doi:10.1002/2014JE004698, eq. 4), C falls as x⁻³
(McGetchin et al. 1973, doi:10.1016/0012-821X(73)90162-3).
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable

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
