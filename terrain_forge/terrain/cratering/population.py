"""A population of craters: production limited by equilibrium, and how old its craters are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, PowerPieces, portable
from terrain_forge.model import MOON, Body, Chronology, ProductionFunction
from terrain_forge.terrain.cratering.degradation import vanishing_wear
from terrain_forge.terrain.cratering.production import Counted, CraterProduction, gathered

_ASIDE = 1.0905077326652577
"""An eighth of an octave: how far on both sides of a diameter craters are counted for a rate."""
_HELD = 125.0
"""Diameter [m] up to which equilibrium tells how craters wear, where 1 km was measured too."""
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


@dataclass(frozen=True, kw_only=True)
class Wear:
    """How fast craters wear: so that equilibrium holds.

    A crater becomes too shallow to be counted in the time in which as many come as there can be of
    its size. Then those at equilibrium are of all depths in the same shares, whatever the
    production. Wear goes on as impacts come, so that ages are counted in years of today's rate.
    """

    body: Body
    """Where they wear."""
    kind: str | None = None
    """Production function that says how often they come; the body's first if it has none such, and
    the Moon's if it has none at all."""
    equilibrium: str = "none"
    """How many there can be: a name of LIMITS; the body's for `none`."""
    constant: float | None = None
    """Diffusivity of all craters instead [m²/10⁶ years]."""

    @cached_property
    def function(self) -> ProductionFunction:
        """The production function."""
        own = self.body.craters.productions or MOON.craters.productions
        return next((one for one in own if one.kind == self.kind), own[0])

    def lifetime(self, diameter: Array) -> Array:
        """Time in which as many craters of diameters [m] come as there can be [10⁹ years]."""
        limit = LIMITS[
            self.body.craters.equilibrium if self.equilibrium == "none" else self.equilibrium
        ]
        most, came = (
            law.number(diameter / _ASIDE) - law.number(diameter * _ASIDE)
            for law in (limit, gathered(self.function, 1.0))
        )
        chronology = self.function.chronology
        return most / came * (chronology.number(1.0) / chronology.steady)

    def diffusivity(self, diameter: Array) -> Array:
        """Diffusivity κ [m²/10⁶ years] by which craters of diameters [m] wear today."""
        diameter = np.asarray(diameter, np.float64)
        if self.constant is not None:
            return np.full(diameter.shape, self.constant)
        large = self.body.craters.diffusivity_1_km
        held = diameter if large is None else np.minimum(diameter, _HELD)
        kappa = vanishing_wear(held, body=self.body) * held**2 / (1000.0 * self.lifetime(held))
        if large is None:
            return kappa
        beyond = portable.log(np.clip(diameter, _HELD, 1000.0) / _HELD)
        return kappa * portable.power(large / kappa, beyond / portable.log(1000.0 / _HELD))

    def of(self, diameter: Array, age: Array) -> Array:
        """τ = κ t / D² of craters of diameters [m] and ages [10⁹ years]."""
        chronology = self.function.chronology
        years = age if self.constant is not None else chronology.number(age) / chronology.steady
        return np.asarray(self.diffusivity(diameter) * 1000.0 * years / diameter**2)


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
    wear: Wear
    """How fast they wear."""

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
        """Part of the whole age's craters of a size that the oldest ones left have seen, 0 to 1."""
        chronology, production = self.chronology, self.production
        oldest: Array = chronology.number(production.oldest(diameter))
        whole: Array = chronology.number(production.age_ga)
        if production.counted:  # those that are young enough to be seen
            vanishing = vanishing_wear(diameter, body=self.body) * diameter**2
            with np.errstate(divide="ignore"):
                seen_for = vanishing / (1000.0 * self.wear.diffusivity(diameter))
            return np.minimum(seen_for * chronology.steady, oldest) / whole
        if self.equilibrium == "none":
            return oldest / whole
        limit, produced = LIMITS[self.equilibrium], self.produced
        most, came = limit.number(diameter), produced.number(diameter)
        left = most * limit.slope(diameter) / (came * produced.slope(diameter))
        return np.where(most < came, np.minimum(left, 1.0), 1.0) * oldest / whole

    @cached_property
    def table(self) -> SizeTable:
        """The population from the smallest diameter to the largest, and up to a step beyond.

        Its steps are the same for all limits, so that they do not change a crater's size.
        """
        low, high = _PER_OCTAVE * portable.log2(self.diameters)
        diameter = portable.power(2.0, np.arange(np.floor(low), np.ceil(high) + 1) / _PER_OCTAVE)
        return SizeTable(diameter, self.number(diameter))

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
