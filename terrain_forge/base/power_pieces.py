"""Numbers by size that are known at some diameters: a power law from each to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import portable
from terrain_forge.base.arrays import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerPieces:
    """N(≥D) = number (D / diameter)^-exponent from each diameter on.

    The first piece goes on to smaller diameters, the last has no end.
    """

    diameters: Array
    """Rising diameters [m], shape [pieces]."""
    numbers: Array
    """N(≥D) at each [1/m²], falling, shape [pieces]."""
    exponents: Array
    """How steeply each piece falls, shape [pieces]."""

    @classmethod
    def through(cls, diameters: ArrayLike, numbers: ArrayLike) -> PowerPieces:
        """The pieces between points, at least two; the last goes on beyond."""
        diameters, numbers = np.array(diameters, np.float64), np.array(numbers, np.float64)
        exponents = -np.diff(portable.log(numbers)) / np.diff(portable.log(diameters))
        last = exponents[-1]
        return cls(diameters=diameters, numbers=numbers, exponents=np.append(exponents, last))

    def row(self, diameter: Array) -> NDArray[np.intp]:
        """The piece that each diameter lies on."""
        return np.maximum(np.searchsorted(self.diameters, diameter, side="right") - 1, 0)

    def number(self, diameter: Array) -> Array:
        """N(≥D) on a square metre [1/m²]."""
        row = self.row(diameter)
        number: Array = self.numbers[row] * portable.power(
            diameter / self.diameters[row], -self.exponents[row]
        )
        return number

    def slope(self, diameter: Array) -> Array:
        """-d ln N / d ln D of the piece."""
        return np.asarray(self.exponents[self.row(diameter)])
