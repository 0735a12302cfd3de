"""Statistics that tell a right sample of rocks from a wrong one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from terrain_forge.base import Array

CONFIDENCE = 0.95
"""Probability that a correct sampler's curve lies within the band at any one diameter."""
SIGNIFICANCE = 0.05
"""Significance of the critical Kolmogorov–Smirnov distance."""
NORMAL_QUANTILE = 1.959964
"""Half the width of the band in standard deviations, for sums of many rocks."""


def deviation(found: float, wanted: float, variance: float) -> float | None:
    """Deviation in standard deviations; None for a population of which no rock is expected."""
    return (found - wanted) / float(np.sqrt(variance)) if variance > 0 else None


def kolmogorov_smirnov(
    diameters: Array, number_above: Callable[[Array], Array], total: float
) -> dict[str, float] | None:
    """Largest distance of the found distribution from that of the laws.

    The p-value is the asymptotic one with Vrbik's correction for small samples (2018, Pioneer
    Journal of Theoretical and Applied Statistics 15); within 0.01 of the exact one from 5 rocks on.

    What was found ascends; `total` is the expected number of all rocks. None where there is none.
    """
    count = len(diameters)
    if count == 0 or total <= 0.0:
        return None
    below = 1.0 - number_above(diameters) / total
    steps = np.arange(count + 1) / count
    return smirnov(float(np.maximum(steps[1:] - below, below - steps[:-1]).max()), count)


def smirnov(distance: float, count: int) -> dict[str, float]:
    """A distance of so many from their law, with its p-value and what is critical."""
    from scipy.special import kolmogi, kolmogorov

    root = np.sqrt(count)
    shift, stretch = 1 / (6 * root) - 1 / (4 * count), 1 + 1 / (4 * count)
    return {
        "distance": distance,
        "p_value": float(kolmogorov(distance * root * stretch + shift)),
        "critical_distance": float((kolmogi(SIGNIFICANCE) - shift) / (root * stretch)),
    }


def clark_evans(points: Array, area: float, perimeter: float) -> dict[str, float] | None:
    """Mean distance to the nearest neighbour over that of random points; above 1 is even.

    Clark & Evans 1954, doi:10.2307/1931034, with the edge correction of Donnelly 1978.

    Points [m] are of the shape [points, 2], in an area [m²]; None for less than two.
    """
    from scipy.spatial import cKDTree

    count = len(points)
    if count < 2:
        return None
    distances, _ = cKDTree(points).query(points, k=2)
    mean = float(distances[:, 1].mean())
    expected = 0.5 * np.sqrt(area / count) + (0.0514 + 0.041 / np.sqrt(count)) * perimeter / count
    variance = 0.0703 * area / count**2 + 0.037 * perimeter * np.sqrt(area / count**5)
    return {
        "ratio": float(mean / expected),
        "z": float((mean - expected) / np.sqrt(variance)),
    }


def count_band(mean: Array, variance: Array) -> tuple[Array, Array]:
    """Lowest and highest numbers between which `CONFIDENCE` of all right counts lie.

    Poisson where the variance is the mean; else negative binomial, which is what a Poisson count
    with a gamma-distributed mean is.
    """
    from scipy.special import nbdtrik, pdtrik

    tail = 0.5 * (1.0 - CONFIDENCE)
    wide = variance > mean * (1.0 + 1e-9)
    share = np.where(wide, mean / np.where(wide, variance, 1.0), 0.5)
    number = mean * share / (1.0 - share)
    # SciPy's inverses interpolate between counts; the quantile is the next whole one.
    low, high = (
        np.ceil(np.where(wide, nbdtrik(level, number, share), pdtrik(level, mean)))
        for level in (tail, 1.0 - tail)
    )
    return np.maximum(low, 0.0), np.maximum(high, 0.0)
