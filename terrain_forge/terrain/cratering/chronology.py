"""How many craters a surface has gathered by its age: the cratering chronologies of the bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import kernel

OLDEST = 4.4
"""Largest model age [10⁹ years]; the oldest surfaces that calibrate the lunar chronology are a
little younger."""


@dataclass(frozen=True, kw_only=True)
class Chronology:
    """N(1 km) = a (exp(b T) - 1) + c T, craters of 1 km and more on a km² of an age T [10⁹ years].

    Neukum et al. 2001, doi:10.1023/A:1011989004263, and for Mars Hartmann & Neukum 2001,
    doi:10.1023/A:1011945222010; coefficients as in Craterstats (Michael et al.).
    """

    burst: float
    """a [1/km²]."""
    rate: float
    """b [1/10⁹ years]."""
    steady: float
    """c [1/(km² · 10⁹ years)]."""

    def number(self, age: ArrayLike) -> NDArray[np.float64]:
        """N(1 km) [1/km²] of surfaces of ages [10⁹ years]."""
        age = np.asarray(age, np.float64)
        return np.asarray(self.burst * np.expm1(self.rate * age) + self.steady * age)

    def growth(self, age: float) -> float:
        """Craters that a surface of an age [10⁹ years] has, over those after 10⁹ years."""
        return float(self.number(age) / self.number(1.0))


MOON = Chronology(burst=5.44e-14, rate=6.93, steady=8.38e-4)
"""Neukum et al. 2001."""
MARS = Chronology(burst=3.22e-14, rate=6.93, steady=4.875e-4)
"""Hartmann & Neukum 2001, used with Ivanov's production function."""
MARS_HARTMANN = Chronology(burst=3.79e-14, rate=6.93, steady=5.84e-4)
"""Hartmann 2005 as written by Michael 2013, doi:10.1016/j.icarus.2013.07.004."""


@kernel
def age_of(number, oldest, burst, rate, steady):  # type: ignore[no-untyped-def]
    """Ages [10⁹ years] at which a chronology has reached numbers [1/km²]; none above `oldest`.

    Newton's method from above, where a convex rising function never overshoots.
    """
    ages = np.empty(len(number))
    for n in range(len(number)):
        age = min(number[n] / steady, oldest)
        for _ in range(60):
            grown = burst * np.exp(rate * age)
            step = (grown - burst + steady * age - number[n]) / (rate * grown + steady)
            if step <= 1e-13 * age:
                break
            age -= step
        ages[n] = max(age, 0.0)
    return ages
