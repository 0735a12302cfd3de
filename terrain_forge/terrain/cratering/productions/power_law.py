"""A power law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Positive, PowerPieces
from terrain_forge.model import Body
from terrain_forge.terrain.cratering.production import Age, Counted, CraterProduction


@dataclass(frozen=True, kw_only=True)
class CraterPowerLaw(CraterProduction):
    """N(≥D) = number · (D / 1 m)^-exponent: craters that can be seen on the surface.

    They are as old as they can be seen, at most.
    """

    kind: Literal["power_law"] = "power_law"
    number_per_m2: Positive
    """Craters of 1 m and more on a square metre [1/m²]."""
    exponent: Annotated[float, Interval(gt=0, le=8)]
    """How steeply the number falls."""
    age_ga: Age
    """Age of the surface [10⁹ years]; it tells how worn the craters are."""

    def law(self, body: Body) -> Counted:  # noqa: ARG002
        """The law itself."""
        one, number, exponent = (np.array([v]) for v in (1.0, self.number_per_m2, self.exponent))
        return PowerPieces(diameters=one, numbers=number, exponents=exponent)
