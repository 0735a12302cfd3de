"""The self-affine roughness of a DTM, fitted over the baselines that it resolves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.bodies import Body
from terrain_forge.site import Roughness

Array = NDArray[np.float64]

COARSE_POSTING = 50.0
"""Posting [m] beyond which a DTM says nothing about a rover's site."""
SHORTEST, LONGEST = 4, 32
"""Baselines of the fit, in posts: a stereo DTM resolves 3 to 5 of them."""
HURST_LIMITS = (0.5, 0.95)
"""Exponents of natural planetary ground between which a fit is kept."""


def fit_roughness(heights: Array, posting: float, body: Body) -> Roughness:
    """Hurst exponent and RMS deviation at 1 m from the structure function of a detrended DTM.

    With fewer than 4 × 32 posts a side the fit would mean nothing, and the body's figures are
    taken. Shepard et al. 2001, doi:10.1029/2000JE001429.
    """
    if posting > COARSE_POSTING:
        return body_roughness(body, f"a DTM of {posting:.3g} m posting says nothing of 1 m")
    if min(heights.shape) < 4 * LONGEST:
        return body_roughness(
            body, f"DTM of {heights.shape[1]} × {heights.shape[0]} posts too small"
        )
    flat = heights - _plane(heights)
    lags = np.unique(np.geomspace(SHORTEST, LONGEST, 10).astype(int))
    deviation = np.array([_deviation(flat, lag) for lag in lags])
    if deviation.min() <= 0.0:
        return body_roughness(body, "DTM without relief")
    hurst, _ = np.polyfit(np.log(lags * posting), np.log(deviation), 1)
    clamped = float(np.clip(hurst, *HURST_LIMITS))
    # The amplitude is anchored at the shortest baseline, where the detail has to join the DTM.
    return Roughness(
        hurst=clamped,
        deviation=float(deviation[0] / (lags[0] * posting) ** clamped),
        source=f"structure function of the DTM, {lags[0] * posting:.3g} to "
        f"{lags[-1] * posting:.3g} m, fitted exponent {hurst:.3f}",
    )


def body_roughness(body: Body, why: str) -> Roughness:
    """The body's fallback figures."""
    hurst, deviation = body.roughness
    return Roughness(hurst=hurst, deviation=deviation, source=f"preset of {body.name} ({why})")


def _deviation(heights: Array, lag: int) -> float:
    east = heights[:, lag:] - heights[:, :-lag]
    north = heights[lag:] - heights[:-lag]
    return float(np.sqrt(0.5 * (np.mean(east**2) + np.mean(north**2))))


def _plane(heights: Array) -> Array:
    rows, columns = heights.shape
    x = np.linspace(-1.0, 1.0, columns)[None, :]
    y = np.linspace(-1.0, 1.0, rows)[:, None]
    across = np.mean(heights * x) / np.mean(x**2)
    along = np.mean(heights * y) / np.mean(y**2)
    result: Array = heights.mean() + across * x + along * y
    return result
