"""Fragments of the Moon's landing sites: power laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, Key, Positive, RecipeError, kernel, mix, portable, uniform
from terrain_forge.rocks.laws.law import SizeLaw
from terrain_forge.rocks.laws.sites import FRAGMENTS, FragmentCount, SurveyorSite


@dataclass(frozen=True, kw_only=True)
class PowerLaw(SizeLaw):
    """Power law N(>D) = c D^-m by its two numbers or by `site`.

    The law has ever more rocks the smaller they are: a population needs a smallest diameter.
    """

    kind: Literal["power_law"] = "power_law"
    """Name of the law."""
    number_per_m2: Annotated[float, Interval(gt=0, le=1e3)] | None = None
    """Rocks larger than 1 m on a square metre, c [1/m²]."""
    exponent: Annotated[float, Interval(gt=0, le=10)] | None = None
    """Fall of the cumulative number with diameter, m."""
    site: SurveyorSite | None = None
    """A Surveyor lander whose count to take (Shoemaker & Morris 1970): commonly quoted figures that
    were not checked in the source (docs/science.md)."""

    @property
    def preset(self) -> FragmentCount | None:
        """The landing site's figures, if the law is named by a site."""
        return FRAGMENTS[self.site] if self.site else None

    @property
    def coefficients(self) -> tuple[float, float]:
        """The numbers c [1/m²] and m, however they are given."""
        given = self.preset or self
        if given.number_per_m2 is None or given.exponent is None:
            raise RecipeError("power_law needs number_per_m2 and exponent, or site")
        return given.number_per_m2, given.exponent

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) = c D^-m [1/m²]."""
        number, exponent = self.coefficients
        return number * portable.power(diameter, -exponent)

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D) = (π/4) c m D^(2-m) / (m - 2); up to a constant where m ≤ 2."""
        number, exponent = self.coefficients
        d = np.asarray(diameter, np.float64)
        return 0.25 * np.pi * number * moment_above(d, exponent, 2)

    def log_density(self, diameter: ArrayLike) -> Array:
        """Logarithm of n = -dN/dD [m⁻³]: log n(D) = log(c m) - (m + 1) log D."""
        number, exponent = self.coefficients
        log_d = portable.log(np.asarray(diameter, np.float64))
        return portable.log(number * exponent) - (exponent + 1.0) * log_d

    def cover_variance(self, smallest: float, largest: float, area: Positive) -> float:
        """(π/4)² c m (b^(4-m) - a^(4-m)) / (4 - m) / area."""
        number, exponent = self.coefficients
        moment = moment_above(np.array([smallest, largest]), exponent, 4)
        return float((0.25 * np.pi) ** 2 * number * (moment[0] - moment[1]) / area)

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] by inversion of the truncated law."""
        return np.asarray(_sample(hashes, smallest, largest, self.coefficients[1]))

    def check(self, key: Key) -> None:
        """Refuse a law without its numbers, or with a site besides."""
        wanted = "number_per_m2 and exponent, or site"
        self.require_one(key, wanted, ("number_per_m2", "exponent"), ("site",))

    def report(self) -> dict[str, Any]:
        """c, m and the source of a site's figures."""
        number, exponent = self.coefficients
        plain: dict[str, Any] = {"kind": self.kind, "number_per_m2": number, "exponent": exponent}
        if self.preset:
            plain |= {"site": self.site, **self.preset.about}
        return plain


def moment_above(ratio: Array, exponent: ArrayLike, power: int) -> Array:
    """∫ x^power m x^(-m-1) dx from each ratio on; up to a constant where m ≤ power."""
    m = np.asarray(exponent, np.float64)
    rest = m - power
    log_x = portable.log(ratio)
    near = np.abs(rest) < 1e-6  # where 1 / rest would swallow the digits
    far = np.where(near, 1.0, rest)
    return m * np.where(near, -log_x, portable.exp(-far * log_x) / far)


@kernel
def _sample(hashes, smallest, largest, exponent):  # type: ignore[no-untyped-def]
    diameters = np.empty(len(hashes))
    low, high = smallest**-exponent, largest**-exponent
    for n in range(len(hashes)):
        u = uniform(mix(hashes[n], 0))
        diameters[n] = (low - u * (low - high)) ** (-1.0 / exponent)
    return diameters
