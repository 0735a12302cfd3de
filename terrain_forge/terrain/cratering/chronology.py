"""How old craters are by how many a surface has gathered."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import kernel

OLDEST = 4.4
"""Largest model age [10⁹ years]; the oldest surfaces that calibrate the lunar chronology are a
little younger."""


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
