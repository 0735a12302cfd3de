"""A population of craters: production limited by equilibrium, and how old its craters are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, PowerPieces, portable
from terrain_forge.model import Body, Chronology
from terrain_forge.terrain.cratering.degradation import diffusivity
from terrain_forge.terrain.cratering.production import Counted, CraterProduction

_SEEN = 0.1133
"""κt/D² at which a tenth of a crater's depth is left."""
_PER_OCTAVE = 64
"""Diameters of the table on an octave; a power law between them is right to 2 in 100 000."""


Equilibrium = Literal["trask", "hartmann", "viper", "minton", "gault", "none"]
"""The laws by name."""


@dataclass(frozen=True, kw_only=True)
class Limit(PowerPieces):
    """N(≥D) in up to two ranges of diameters, each as if it went on to 1 m."""

    border: float
    """Largest diameter [m] of the first range."""

    def row(self, diameter: Array) -> NDArray[np.intp]:
        """The range of each diameter."""
        return (np.asarray(diameter) > self.border).astype(np.intp)


def _limit(numbers: list[float], exponents: list[float], border: float = np.inf) -> Limit:
    one, at_1_m, falling = (np.array(v) for v in (np.ones(len(numbers)), numbers, exponents))
    return Limit(diameters=one, numbers=at_1_m, exponents=falling, border=border)


LIMITS: dict[str, Limit] = {
    # Trask 1966 (JPL TR 32-800); as an upper limit also in NASA's SLS-SPEC-159 (DSNE).
    "trask": _limit([10.0**-1.1], [2.0]),
    # Hartmann 1984, Icarus 60, 56, on a km², D in km.
    "hartmann": _limit([10.0**-1.14 * 1e-6 * 1000.0**1.83], [1.83]),
    # The VIPER rover's environment specification, on a km², D in m (as in synthterrain).
    "viper": _limit([29174e-6, 156228e-6], [1.92, 2.389], border=80.0),
    # Minton et al. 2019, doi:10.1016/j.icarus.2019.02.021, lunar maria.
    "minton": _limit([0.0336], [2.0]),
    # Gault 1970, doi:10.1029/RS005i002p00273: geometric saturation, never reached.
    "gault": _limit([1.54], [2.0]),
}
"""Limits of the number of craters. They were counted on the Moon."""


class SizeTable(NamedTuple):
    """A population at diameters that rise, from the smallest to the largest."""

    diameter: Array
    """Diameters [m]."""
    number: Array
    """N(≥D) on a square metre [1/m²], falling."""
    part: Array
    """Part of all craters that were produced there which is left, 0 to 1: the youngest."""


@dataclass(frozen=True, kw_only=True)
class Population:
    """Craters as min(production, equilibrium).

    Where equilibrium limits them, those are left that came last: as many as there may be of a size.
    """

    production: CraterProduction
    """What has come."""
    body: Body
    """Where it has come."""
    equilibrium: str
    """How many there can be: a name of LIMITS, or `none`."""
    diameters: tuple[float, float]
    """Smallest and largest diameter [m]; others would be there, but are left out."""
    diffusivity: float | None = None
    """How fast all craters wear [m²/10⁶ years], if not by their size."""

    @property
    def chronology(self) -> Chronology:
        """How the number has grown with time."""
        return self.production.chronology(self.body)

    @cached_property
    def produced(self) -> Counted:
        """All craters that have come."""
        return self.production.law(self.body)

    def number(self, diameter: Array) -> Array:
        """Expected N(≥D) on a square metre [1/m²], however large the craters are."""
        number = self.produced.number(diameter)
        if self.equilibrium == "none":
            return number
        return np.minimum(number, LIMITS[self.equilibrium].number(diameter))

    def part(self, diameter: Array) -> Array:
        """Part of the craters of a size that is left, by dN/dD of both laws."""
        if self.production.counted:  # those that are young enough to be seen
            kappa = diffusivity(diameter, constant=self.diffusivity)
            oldest = self.production.age_ga
            with np.errstate(divide="ignore"):
                seen_for = np.minimum(_SEEN * diameter**2 / (1000.0 * kappa), oldest)
            return self.chronology.number(seen_for) / self.chronology.number(oldest)
        if self.equilibrium == "none":
            return np.ones_like(diameter)
        limit, produced = LIMITS[self.equilibrium], self.produced
        most, came = limit.number(diameter), produced.number(diameter)
        left = most * limit.slope(diameter) / (came * produced.slope(diameter))
        return np.where(most < came, np.minimum(left, 1.0), 1.0)

    @cached_property
    def table(self) -> SizeTable:
        """The population from the smallest diameter to the largest, and up to a step beyond.

        Its steps are the same for all limits, so that they do not change a crater's size.
        """
        low, high = _PER_OCTAVE * portable.log2(self.diameters)
        diameter = portable.power(2.0, np.arange(np.floor(low), np.ceil(high) + 1) / _PER_OCTAVE)
        return SizeTable(diameter, self.number(diameter), self.part(diameter))

    def density(self, low: float, high: float) -> float:
        """Expected craters of diameters from `low` to `high` [m] on a square metre [1/m²]."""
        number = self.number(np.array([low, high]))
        return float(number[0] - number[1])

    @property
    def octaves(self) -> list[tuple[int, float, float]]:
        """Size classes, the largest first: exponent of 2, smallest and largest diameter [m].

        They are whole, from one power of 2 to the next, so that no limit changes their craters.
        """
        smallest, largest = portable.log2(self.diameters)
        first, last = int(np.floor(smallest)), int(np.ceil(largest))
        return [(n, 2.0**n, 2.0 ** (n + 1)) for n in reversed(range(first, last))]
