"""Counts in bins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Len

from terrain_forge.base import Array, NotNegative, PositivePair, PowerPieces, Spec, portable
from terrain_forge.model import Body
from terrain_forge.terrain.cratering.production import Age, Counted, CraterProduction

_STEPS = 16
_NOTHING = 1e-9
"""Part of all craters that are taken to lie beyond the last bin, where logarithms need some."""


@dataclass(frozen=True, kw_only=True)
class CraterBin(Spec):
    """Craters that were counted in a range of diameters."""

    diameter_m: PositivePair
    """Smallest and largest diameter [m]."""
    number_per_km2: NotNegative
    """Craters of these diameters on a square kilometre [1/km²]."""
    age_ga: Age | None = None
    """Age of the surface for craters of this size [10⁹ years]; the law's without it."""


@dataclass(frozen=True, kw_only=True)
class CraterCounts(CraterProduction):
    """Incremental counts: craters that can be seen, as many in each bin as were counted there.

    Within a bin they follow D⁻²; between bins, below and above them there are none. They are as old
    as they can be seen, at most.
    """

    kind: Literal["counts"] = "counts"
    bins: Annotated[tuple[CraterBin, ...], Len(1, 200)]
    """The counts, by rising diameter."""
    age_ga: Age
    """Age of the surface [10⁹ years]; it tells how worn the craters are."""

    complete: ClassVar[bool] = True

    def __post_init__(self) -> None:
        ends = np.array([one.diameter_m for one in self.bins])
        if np.any(ends[:, 0] >= ends[:, 1]) or np.any(ends[1:, 0] < ends[:-1, 1]):
            raise ValueError("bins: diameters must rise, in a bin and from bin to bin")
        if not any(one.number_per_km2 > 0.0 for one in self.bins):
            raise ValueError("bins: no craters in any bin")
        if any((one.age_ga or 0.0) > self.age_ga for one in self.bins):
            raise ValueError("bins: none may be older than age_ga")

    def oldest(self, diameter: Array) -> Array:
        """Age [10⁹ years] of the surface for craters of diameters [m]."""
        ages = np.array([one.age_ga or self.age_ga for one in self.bins])
        first = [one.diameter_m[0] for one in self.bins]
        return ages[np.maximum(np.searchsorted(first, diameter, side="right") - 1, 0)]

    def law(self, body: Body) -> Counted:  # noqa: ARG002
        """Pieces of a power law so short that they do not show."""
        ends = np.array([one.diameter_m for one in self.bins])
        numbers = 1e-6 * np.array([one.number_per_km2 for one in self.bins])
        steps = np.unique([portable.geomspace(low, high, _STEPS) for low, high in ends])
        low, high = 1.0 / ends.T**2
        above = np.clip((1.0 / steps[:, None] ** 2 - high) / (low - high), 0.0, 1.0)
        nothing = _NOTHING * sum(numbers.tolist())
        number = portable.product(above, numbers) + nothing
        return PowerPieces.through(
            [0.5 * steps[0], *steps, 2.0 * steps[-1]], [number[0], *number, 0.25 * nothing]
        )
