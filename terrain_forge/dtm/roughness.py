"""The self-affine roughness of a DTM near the end of what it resolves, and how it varies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.bodies import Body
from terrain_forge.dtm.increments import (
    expected_increment,
    local_square_increments,
    mean_square_increment,
)
from terrain_forge.site import Roughness

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COARSE_POSTING = 50.0
"""Posting [m] beyond which a DTM says nothing about a rover's site."""
FEWEST_POSTS = 48
"""Posts a side below which a fitted exponent would mean nothing."""
FEWEST_FOR_AMPLITUDE = 24
"""Posts a side below which not even the amplitude is taken from the DTM."""
HURST_LIMITS = (0.5, 0.95)
"""Exponents of natural planetary ground between which a fit is kept."""
BASELINES = (1, 2, 3, 4)
"""Baselines of the fit, in multiples of the shortest one that the DTM resolves."""

_SMOOTH = 1.1  # no rough ground has a larger exponent: what has is smoothed
_LOCAL_WIDTH = 4.0


def fit_roughness(
    heights: Array, posting: float, body: Body, trusted: Mask | None = None
) -> Roughness:
    """Exponent and local RMS deviation of the ground at the shortest baselines that the DTM tells.

    The exponent is that of the second increments over one to four of the shortest resolved
    baselines. That is one posting, unless the exponent from there to twice as far exceeds what
    rough ground can have: then the DTM is smoothed, and the next baseline is tried. The RMS
    deviation is that of the increments at the same end, around each post.

    Args:
        heights: the DTM around the site [m].
        posting: distance of its posts [m].
        body: whose figures are taken where the DTM is too coarse or too small.
        trusted: posts that are measured, not filled in; all, if not given.
    """
    if posting > COARSE_POSTING:
        return body_roughness(body, f"a DTM of {posting:.3g} m posting says nothing of 1 m")
    size = f"DTM of {heights.shape[1]} × {heights.shape[0]} posts"
    if min(heights.shape) < FEWEST_FOR_AMPLITUDE:
        return body_roughness(body, f"{size} too small")
    trusted = np.ones(heights.shape, bool) if trusted is None else trusted
    squares = [mean_square_increment(heights, lag, trusted) for lag in (1, 2, 4, 8)]
    if not np.min(squares) > 0.0:  # nor where nothing is trusted, which is NaN
        return body_roughness(body, "DTM without relief")
    resolved = _shortest_resolved(squares)
    if min(heights.shape) < FEWEST_POSTS:
        hurst, exponent = _limited(body.roughness[0]), None
        source = f"exponent preset of {body.name} ({size} too small for a fit)"
    else:
        fitted = _fit_exponent(heights, trusted, resolved)
        exponent, hurst = (fitted, _standard_error(heights, trusted, resolved)), _limited(fitted)
        source = f"exponent {fitted:.2f} ± {exponent[1]:.2f} fitted to the DTM"
    local = _local_deviation(heights, trusted, hurst, resolved) / posting**hurst
    longest = resolved * BASELINES[-1] * posting
    return Roughness(
        hurst=hurst,
        deviation=float(np.sqrt(np.mean(local**2))),
        source=f"{source}, amplitude of the DTM around each post, baselines "
        f"{resolved * posting:.3g} to {longest:.3g} m",
        exponent=exponent,
        resolved=resolved,
        local=local.astype(np.float32),
    )


def body_roughness(body: Body, why: str) -> Roughness:
    """The body's fallback figures."""
    hurst, deviation = body.roughness
    return Roughness(hurst=hurst, deviation=deviation, source=f"preset of {body.name} ({why})")


def _limited(hurst: float) -> float:
    return float(np.clip(hurst, *HURST_LIMITS))


def _shortest_resolved(squares: list[float]) -> int:
    """Shortest baseline [posts] that is not smoothed, of 1, 2 and 4 posts."""
    for n, lag in enumerate((1, 2)):
        point = squares[n + 1] / squares[n]
        # What averaging over pixels alone takes away, for an exponent in the middle.
        pixel = expected_increment(0.75, 2 * lag) / expected_increment(0.75, lag) / 4.0**0.75
        if 0.5 * np.log2(point / pixel) <= _SMOOTH:
            return lag
    return 4


def _fit_exponent(heights: Array, trusted: Mask, resolved: int) -> float:
    """Exponent of the second increments; what pixels average away depends on it in turn."""
    lags = [n * resolved for n in BASELINES if 4 * n * resolved < min(heights.shape)]
    logs = np.log([mean_square_increment(heights, lag, trusted) for lag in lags])
    hurst = 0.75
    for _ in range(6):
        pixel = np.log([expected_increment(hurst, n) / n ** (2 * hurst) for n in lags])
        slope = float(np.polyfit(np.log(lags), logs - pixel, 1)[0])
        hurst = round(float(np.clip(0.5 * slope, 0.05, 0.98)), 6)
    return 0.5 * slope


def _standard_error(heights: Array, trusted: Mask, resolved: int) -> float:
    """Standard error of the exponent, from the scatter between the DTM's quarters."""
    rows, columns = (length // 2 for length in heights.shape)
    halves = [(np.s_[:rows], np.s_[rows:]), (np.s_[:columns], np.s_[columns:])]
    quarters = [(r, c) for r in halves[0] for c in halves[1]]
    found = [
        _fit_exponent(heights[q], trusted[q], resolved)
        for q in quarters
        if trusted[q].mean() > 0.5 and np.ptp(heights[q][trusted[q]]) > 0.0
    ]
    return float(np.std(found, ddof=1) / np.sqrt(len(found))) if len(found) > 1 else 0.5


def _local_deviation(heights: Array, trusted: Mask, hurst: float, resolved: int) -> Array:
    """RMS deviation at one posting around each post [m]."""
    lags = (resolved, 2 * resolved)
    width = _LOCAL_WIDTH * resolved
    squares = [
        local_square_increments(heights, lag, trusted, width) / expected_increment(hurst, lag)
        for lag in lags
    ]
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))
