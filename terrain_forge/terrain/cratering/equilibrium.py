"""Equilibrium: the number of craters at which a surface loses as many as it gains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable

Equilibrium = Literal["trask", "hartmann", "viper", "minton", "gault", "none"]
"""The laws by name."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """N(≥D) = number · D^-exponent, in up to two ranges of diameters."""

    numbers: tuple[float, ...]
    """N(≥1 m) of each range, continued to it [1/m²]."""
    exponents: tuple[float, ...]
    """Exponent of each range."""
    border: float = np.inf
    """Largest diameter [m] of the first range."""

    def number(self, diameter: Array) -> Array:
        """N(≥D) on a square metre [1/m²]."""
        row = self._row(diameter)
        found: Array = np.array(self.numbers)[row] * portable.power(
            diameter, -np.array(self.exponents)[row]
        )
        return found

    def slope(self, diameter: Array) -> Array:
        """-d ln N / d ln D."""
        return np.asarray(np.array(self.exponents)[self._row(diameter)])

    def _row(self, diameter: Array) -> NDArray[np.intp]:
        return (np.asarray(diameter) > self.border).astype(np.intp)


LIMITS: dict[str, Limit] = {
    # Trask 1966 (JPL TR 32-800); as an upper limit also in NASA's SLS-SPEC-159 (DSNE).
    "trask": Limit(numbers=(10.0**-1.1,), exponents=(2.0,)),
    # Hartmann 1984, Icarus 60, 56, on a km², D in km.
    "hartmann": Limit(numbers=(10.0**-1.14 * 1e-6 * 1000.0**1.83,), exponents=(1.83,)),
    # The VIPER rover's environment specification, on a km², D in m (as in synthterrain).
    "viper": Limit(numbers=(29174e-6, 156228e-6), exponents=(1.92, 2.389), border=80.0),
    # Minton et al. 2019, doi:10.1016/j.icarus.2019.02.021, lunar maria.
    "minton": Limit(numbers=(0.0336,), exponents=(2.0,)),
    # Gault 1970, doi:10.1029/RS005i002p00273: geometric saturation, never reached.
    "gault": Limit(numbers=(1.54,), exponents=(2.0,)),
}
"""Limits of the number of craters. They were counted on the Moon."""
