"""Size-frequency laws: how many rocks of which exposed diameter lie on a square metre.

A law is one class: its closed forms and its exact sampler. `SizeFrequency` lists them all; adding a
law is adding a class here and its name there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike, NDArray

from terrain_forge.kernels import kernel
from terrain_forge.seeds import mix, uniform
from terrain_forge.specs import BY_KIND, Spec

Array = NDArray[np.float64]


class SizeLaw(Protocol):
    """What scattering and the proof of the sizes need of a law; diameters D in metres."""

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) [1/m²], rocks larger than each diameter on a square metre."""

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D), part of the ground that rocks larger than each diameter cover.

        Where that diverges it is given up to a constant, so that differences still hold.
        """

    def cover_variance(self, smallest: float, largest: float, area: float) -> float:
        """Variance of the cover that rocks between two diameters [m] have on an area [m²].

        The rocks are scattered as a Poisson process: (π/4)² ∫ D⁴ n(D) dD / area.
        """

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] drawn between two diameters [m], one by each hashed address."""


@dataclass(frozen=True, kw_only=True)
class Golombek(Spec):
    """Exponential cover F(>D) = k exp(-q D), with q = 1.79 + 0.152 / k on Mars.

    Golombek & Rapp 1997, doi:10.1029/96JE03319; q(k) of Golombek et al. 2003, LPSC XXXIV.
    """

    kind: Literal["golombek"] = "golombek"
    """Name of the law."""
    k: Annotated[float, Interval(gt=0, le=0.4)]
    """Part of the ground that rocks of all sizes cover, 0 to 0.4."""
    q_per_m: Annotated[float, Interval(gt=0, le=1000)] | None = None
    """Decay of the cover with diameter [1/m]; by default Mars' 1.79 + 0.152 / k."""

    @property
    def q(self) -> float:
        """Decay of the cover with diameter [1/m]."""
        return self.q_per_m or 1.79 + 0.152 / self.k

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) = (4 k q / π) (exp(-q D) / D - q E1(q D)) [1/m²]."""
        from scipy.special import exp1

        d, q = np.asarray(diameter, np.float64), self.q
        number: Array = 4.0 * self.k * q / np.pi * (np.exp(-q * d) / d - q * exp1(q * d))
        return number

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D) = k exp(-q D)."""
        area: Array = self.k * np.exp(-self.q * np.asarray(diameter, np.float64))
        return area

    def cover_variance(self, smallest: float, largest: float, area: float) -> float:
        """(π k q / 4 area) (G(a) - G(b)), G(D) = exp(-q D) (D² / q + 2 D / q² + 2 / q³)."""
        q = self.q
        d = np.array([smallest, largest])
        moment = np.exp(-q * d) * (d * d / q + 2 * d / q**2 + 2 / q**3)
        return float(np.pi * self.k * q / (4.0 * area) * (moment[0] - moment[1]))

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] of density exp(-q D) / D², exactly: proposed by 1 / D², thinned by exp."""
        diameters: Array = _sample_golombek(hashes, smallest, largest, self.q)
        return diameters


@dataclass(frozen=True, kw_only=True)
class PowerLaw(Spec):
    """Power law N(>D) = c D^-m, as the Surveyor landers counted fragments on the Moon."""

    kind: Literal["power_law"] = "power_law"
    """Name of the law."""
    number_per_m2: Annotated[float, Interval(gt=0, le=1e3)]
    """Rocks larger than 1 m on a square metre, c [1/m²]."""
    exponent: Annotated[float, Interval(gt=0, le=10)]
    """Fall of the cumulative number with diameter, m."""

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) = c D^-m [1/m²]."""
        number: Array = self.number_per_m2 * np.asarray(diameter, np.float64) ** -self.exponent
        return number

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D) = (π/4) c m D^(2-m) / (m - 2); up to a constant where m ≤ 2."""
        return 0.25 * np.pi * self._moment(np.asarray(diameter, np.float64), 2)

    def cover_variance(self, smallest: float, largest: float, area: float) -> float:
        """(π/4)² c m (b^(4-m) - a^(4-m)) / (4 - m) / area."""
        moment = self._moment(np.array([smallest, largest]), 4)
        return float((0.25 * np.pi) ** 2 * (moment[0] - moment[1]) / area)

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] by inversion of the truncated law."""
        diameters: Array = _sample_power(hashes, smallest, largest, self.exponent)
        return diameters

    def _moment(self, diameter: Array, power: int) -> Array:
        """∫ D^power n(D) dD from each diameter on, up to a constant."""
        rest = self.exponent - power
        scale = self.number_per_m2 * self.exponent
        return scale * (diameter**-rest / rest if rest else -np.log(diameter))


SizeFrequency = Annotated[Golombek | PowerLaw, BY_KIND]
"""The laws that a recipe can name by their `kind`."""


def largest_diameter(law: SizeLaw, area: float) -> float:
    """The diameter D [m] that one rock of an area [m²] is expected to exceed: N(>D) · area = 1."""
    from scipy.optimize import brentq

    def surplus(log_diameter: float) -> Any:
        return law.cumulative_number(np.exp(log_diameter)) * area - 1.0

    return float(np.exp(brentq(surplus, np.log(1e-9), np.log(1e6), xtol=1e-14)))


@kernel
def _sample_golombek(hashes, smallest, largest, q):  # type: ignore[no-untyped-def]
    diameters = np.empty(len(hashes))
    inverse, width = 1.0 / smallest, 1.0 / smallest - 1.0 / largest
    for n in range(len(hashes)):
        trial = 0
        while True:
            diameter = 1.0 / (inverse - uniform(mix(hashes[n], trial)) * width)
            trial += 2
            if uniform(mix(hashes[n], trial - 1)) < np.exp(-q * (diameter - smallest)):
                break
        diameters[n] = diameter
    return diameters


@kernel
def _sample_power(hashes, smallest, largest, exponent):  # type: ignore[no-untyped-def]
    diameters = np.empty(len(hashes))
    low, high = smallest**-exponent, largest**-exponent
    for n in range(len(hashes)):
        u = uniform(mix(hashes[n], 0))
        diameters[n] = (low - u * (low - high)) ** (-1.0 / exponent)
    return diameters
