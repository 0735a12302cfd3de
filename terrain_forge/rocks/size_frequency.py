"""Size-frequency laws: how many rocks of which exposed diameter lie on a square metre.

A law is one class in terrain_forge.rocks.laws: its closed forms and its exact sampler. Adding a law
is adding a module there and its class here.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from terrain_forge.base import BY_KIND
from terrain_forge.rocks.laws.counts import Counts
from terrain_forge.rocks.laws.exponential import Exponential
from terrain_forge.rocks.laws.golombek import CoverAbove, Golombek
from terrain_forge.rocks.laws.law import SizeLaw
from terrain_forge.rocks.laws.power_law import PowerLaw
from terrain_forge.rocks.laws.tabulated import Tabulated

__all__ = [
    "Counts",
    "CoverAbove",
    "Exponential",
    "Golombek",
    "PowerLaw",
    "SizeFrequency",
    "SizeLaw",
    "Tabulated",
    "largest_diameter",
]

SizeFrequency = Annotated[Golombek | PowerLaw | Exponential | Counts | Tabulated, BY_KIND]
"""The laws that a recipe can name by their `kind`."""

_RANGE = 1e-9, 1e6
"""Diameters [m] among which the largest rock is looked for."""


def largest_diameter(law: SizeLaw, area: float) -> float:
    """The diameter D [m] that one rock of an area [m²] is expected to exceed: N(>D) · area = 1.

    0 where less than one rock of any size is expected.
    """
    from scipy.optimize import brentq

    def surplus(log_diameter: float) -> Any:
        return law.cumulative_number(np.exp(log_diameter)) * area - 1.0

    low, high = np.log(_RANGE)
    if surplus(low) <= 0.0:
        return 0.0
    return float(np.exp(brentq(surplus, low, high, xtol=1e-14)))
