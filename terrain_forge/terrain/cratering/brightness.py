"""Bright ejecta of young craters on airless bodies; figures of the Moon."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.terrain.cratering.craters import Craters
from terrain_forge.terrain.cratering.profile import EJECTA_FADE, shapes

FADES_IN = 0.05
"""Age [10⁹ years] at which a brightness has fallen to 1/e. This and the next two: assumptions."""
FULL_FROM = 100.0
"""Diameter [m] from which craters dig up fresh rock; smaller ones bring up old soil the more."""
BRIGHTEST = 2.0
"""Largest factor, where the ejecta of several craters lie."""
_VISIBLE = 0.005


def ejecta_brightness(craters: Craters, *, east: Array, north: Array, contrast: float) -> Array:
    """Factor on the albedo at the nodes of a grid, shape [north, east].

    Args:
        craters: Those that reach the grid, the youngest first.
        east: Coordinates of the columns [m], ascending.
        north: Coordinates of the rows [m], ascending.
        contrast: How much brighter the fresh ejecta of a large crater are at its rim, 0 for not.
    """
    factor = np.ones((north.size, east.size))
    strength = contrast * portable.exp(-craters.age / FADES_IN)
    strength *= np.minimum(craters.diameter / FULL_FROM, 1.0)
    for n in np.flatnonzero(strength > _VISIBLE):
        (x, y), radius = craters.xy[n], 0.5 * craters.diameter[n]
        reach = EJECTA_FADE[1] * radius
        columns = slice(*np.searchsorted(east, (x - reach, x + reach)))
        rows = slice(*np.searchsorted(north, (y - reach, y + reach)))
        away = np.hypot(east[columns] - x, north[rows, None] - y) / radius
        factor[rows, columns] += strength[n] * shapes(away)[2]
    return np.minimum(factor, BRIGHTEST)
