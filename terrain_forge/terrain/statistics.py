"""Figures that describe a ground: the slopes of its surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.world import Heightfield

_PER_DEGREE = 100


@dataclass(frozen=True, kw_only=True)
class SlopeStatistics:
    """Slopes of the ground's triangles, all of which are equally large in plan."""

    median_deg: float
    """Half of the ground is steeper [deg], to 0.01°."""
    percentile_95_deg: float
    """A twentieth of the ground is steeper [deg], to 0.01°."""
    steepest_deg: float
    """Slope of the steepest triangle [deg]."""
    rms_deg: float
    """Root mean square of the gradient, as an angle [deg]."""
    shares: NDArray[np.float64]
    """Part of the ground in each degree of slope, shape [90]."""


def slope_statistics(ground: Heightfield) -> SlopeStatistics:
    """Slopes at the scale of the grid: those of the triangles of the surface."""
    z = ground.elevation
    east, north = np.diff(z, axis=1) / ground.spacing, np.diff(z, axis=0) / ground.spacing
    # South-eastern triangles have a southern and an eastern edge, north-western ones the others.
    south_eastern = np.hypot(east[:-1], north[:, 1:])
    north_western = np.hypot(east[1:], north[:, :-1])
    gradients = np.stack([south_eastern, north_western]).ravel()
    slopes = np.degrees(np.arctan(gradients))
    counts = np.bincount((slopes * _PER_DEGREE).astype(np.int32), minlength=90 * _PER_DEGREE)
    shares = counts[: 90 * _PER_DEGREE] / len(slopes)
    middle, high = np.searchsorted(np.cumsum(shares), [0.5, 0.95]) / _PER_DEGREE
    mean_square = float(np.mean(gradients * gradients, dtype=np.float64))
    return SlopeStatistics(
        median_deg=float(middle),
        percentile_95_deg=float(high),
        steepest_deg=float(slopes.max()),
        rms_deg=float(np.degrees(np.arctan(np.sqrt(mean_square)))),
        shares=shares.reshape(90, _PER_DEGREE).sum(axis=1),
    )
