"""Rocks whose number falls exponentially with diameter, as on old surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, Positive, kernel, mix, portable, uniform
from terrain_forge.rocks.laws.law import SizeLaw


@dataclass(frozen=True, kw_only=True)
class Exponential(SizeLaw):
    """Exponential number N(>D) = N0 exp(-λ D)."""

    kind: Literal["exponential"] = "exponential"
    """Name of the law."""
    number_per_m2: Annotated[float, Interval(gt=0, le=1e6)]
    """Rocks of all sizes on a square metre, N0 [1/m²]."""
    decay_per_m: Annotated[float, Interval(ge=0.01, le=1e4)]
    """Fall of the number with diameter, λ [1/m]: the inverse of the mean diameter."""

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) = N0 exp(-λ D) [1/m²]."""
        decay = portable.exp(-self.decay_per_m * np.asarray(diameter, np.float64))
        return self.number_per_m2 * decay

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D) = (π/4) N0 exp(-λ D) (D² + 2 D / λ + 2 / λ²)."""
        d, mean = np.asarray(diameter, np.float64), 1.0 / self.decay_per_m
        return 0.25 * np.pi * self.cumulative_number(d) * (d * d + 2.0 * mean * (d + mean))

    def log_density(self, diameter: ArrayLike) -> Array:
        """Logarithm of n = -dN/dD [m⁻³]: log n(D) = log(N0 λ) - λ D."""
        d = np.asarray(diameter, np.float64)
        return portable.log(self.number_per_m2 * self.decay_per_m) - self.decay_per_m * d

    def cover_variance(self, smallest: float, largest: float, area: Positive) -> float:
        """(π/4)² (N0 / λ⁴) (γ(λ b) - γ(λ a)) / area, γ(x) = ∫ t⁴ exp(-t) dt from 0 to x."""
        below = [_fourth_moment(self.decay_per_m * d) for d in (smallest, largest)]
        scale = (0.25 * np.pi) ** 2 * self.number_per_m2 / self.decay_per_m**4
        return float(scale * (below[1] - below[0]) / area)

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] by inversion of the truncated law."""
        return np.asarray(_sample(hashes, smallest, largest, self.decay_per_m))


def _fourth_moment(x: float) -> float:
    """∫ t⁴ exp(-t) dt from 0 to x, precise where that is next to nothing too."""
    if x < 1.0:
        terms = np.cumprod([x**5 / 5.0, *(x / np.arange(6.0, 24.0))])
        return float(portable.exp(-x) * terms.sum())
    fall = 1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0)))
    return float(24.0 * (1.0 - portable.exp(-x) * fall))


@kernel
def _sample(hashes, smallest, largest, decay):  # type: ignore[no-untyped-def]
    diameters = np.empty(len(hashes))
    part = -np.expm1(-decay * (largest - smallest))
    for n in range(len(hashes)):
        u = uniform(mix(hashes[n], 0))
        diameters[n] = min(smallest - np.log1p(-u * part) / decay, largest)
    return diameters
