"""What a right sampler puts onto a window: numbers and cover of rocks above each diameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array
from terrain_forge.model import World
from terrain_forge.rocks import Expectation, SizeLaw, expected

if TYPE_CHECKING:
    from terrain_forge.rocks import PopulationSpec


@dataclass(frozen=True, kw_only=True)
class ExpectedCounts:
    """The rocks of one population that a window should have."""

    law: SizeLaw
    """The law without limits."""
    smallest: float
    """Least diameter [m]."""
    expectation: Expectation
    """Where the law holds, up to which diameter, and how sure that is."""

    @staticmethod
    def of(spec: PopulationSpec, world: World) -> ExpectedCounts:
        """What a population of a world should have."""
        smallest, _ = spec.diameters
        expectation = expected(spec, site=world.site, window=world.window, ground=world.ground)
        return ExpectedCounts(law=spec.size_frequency, smallest=smallest, expectation=expectation)

    @property
    def largest(self) -> float:
        """Largest diameter anywhere [m]."""
        return max((largest for _, largest in self.expectation.parts), default=self.smallest)

    def number_above(self, diameter: ArrayLike) -> Array:
        """Expected number of rocks above each diameter [m]."""
        number = np.zeros(np.shape(diameter))
        for area, largest in self.expectation.parts:
            at = self._clipped(diameter, largest)
            number += area * (self.law.cumulative_number(at) - self.law.cumulative_number(largest))
        return number

    def area_above(self, diameter: ArrayLike) -> Array:
        """Expected sum of πD²/4 of rocks above each diameter [m²]."""
        covered = np.zeros(np.shape(diameter))
        for area, largest in self.expectation.parts:
            at = self._clipped(diameter, largest)
            covered += area * (self.law.cumulative_area(at) - self.law.cumulative_area(largest))
        return covered

    def number_variance_above(self, diameter: ArrayLike) -> Array:
        """Variance of the number of rocks above each diameter: more than Poisson's in clusters."""
        number = self.number_above(diameter)
        return number + self._excess * number**2

    def area_variance_above(self, diameter: ArrayLike) -> Array:
        """Variance of the sum of πD²/4 of rocks above each diameter [m⁴]."""
        at = np.asarray(diameter, np.float64)
        variance = self._excess * self.area_above(at) ** 2
        for area, largest in self.expectation.parts:
            limits = self._clipped(at, largest).ravel().tolist()
            single = [self.law.cover_variance(low, largest, 1.0) for low in limits]
            variance = variance + area * np.reshape(single, at.shape)
        return np.asarray(variance)

    @property
    def _excess(self) -> float:
        """Relative variance of the effective area, which all diameters share."""
        area = self.expectation.area
        return self.expectation.area_variance / area**2 if area > 0.0 else 0.0

    def _clipped(self, diameter: ArrayLike, largest: float) -> Array:
        return np.clip(np.asarray(diameter, np.float64), min(self.smallest, largest), largest)
