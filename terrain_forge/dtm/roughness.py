"""The self-affine roughness of a DTM near the end of what it resolves, and how it varies."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from terrain_forge.base import Array, Mask, portable
from terrain_forge.dtm.grain import find_grain
from terrain_forge.dtm.increments import (
    expected_increment,
    local_square_increments,
    mean_square_increment,
)
from terrain_forge.dtm.noise_floor import NoiseFloor
from terrain_forge.model import HIGHEST_EXPONENT, Body, Roughness

COARSE_POSTING = 50.0
"""Posting [m] beyond which a DTM says nothing about a rover's site."""
FEWEST_POSTS = 48
"""Posts a side below which the exponent is called a preset that the DTM has moved."""
FEWEST_FOR_AMPLITUDE = 24
"""Posts a side below which nothing is taken from the DTM."""
HURST_LIMITS = (0.45, HIGHEST_EXPONENT)
"""Exponents between which a fit is kept: ground rough at the posting is less so below it."""
HURST_PRIOR = (0.75, 0.15)
"""Mean and scatter of the exponents that are published of sites (0.57, 0.65 and 0.8 at Pathfinder,
Viking 1 and 2, 0.76 and 0.95 on the lunar maria and highlands), which a fit is weighed against."""
BASELINES = (1, 2)
"""Baselines of the fit, in multiples of the shortest one that the DTM resolves: the exponent is
that of the joint. Natural ground bends: longer baselines tell it too small there."""

_SMOOTHED = 1.3
"""Exponent from one post to two beyond which a DTM was smoothed: mantled ground and crater walls
reach 1.26, a Gaussian of one post makes 1.36 and more."""
_ROUGH = 1.1
"""Exponent below which smoothing shows no more."""
_LOCAL_WIDTH = 1.0
_MIDDLE = 0.5
"""Octaves from the shortest baseline up to the middle of those that the exponent is fitted to."""
_MOST_RISE = 0.25
_RISE_PRIOR = 0.1
"""Scatter of the rise of exponents towards shorter baselines in an octave."""


def fit_roughness(
    heights: Array,
    posting: float,
    body: Body,
    trusted: Mask | None = None,
    floor: NoiseFloor | None = None,
) -> Roughness:
    """Exponent and local RMS deviation of the ground at the shortest baselines that the DTM tells.

    The exponent is that of the second increments over one and two of the shortest resolved
    baselines. That is one posting, unless the exponent from there to twice as far exceeds what
    rough ground can have: then the DTM is smoothed, and the next baseline is tried. It is weighed
    against the exponents that ground has elsewhere by its standard error, so that a small DTM says
    as much as it knows. The RMS deviation is that of the increments at the same end, around each
    post.

    Args:
        heights: the DTM around the site [m].
        posting: distance of its posts [m].
        body: whose figures are taken where the DTM is too coarse or too small.
        trusted: posts that are measured, not filled in; all, if not given.
        floor: noise that the heights had: the exponent is that of the ground above it.
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
    resolved = 1 if floor else _shortest_resolved(squares)
    exponent = floor.exponent if floor else _fitted(heights, trusted, resolved)
    rise = 0.0 if floor else _likely_rise(heights, trusted, resolved)
    weighed = _weighed(exponent) + _MIDDLE * rise
    hurst = float(np.clip(weighed, *HURST_LIMITS))
    source = _source(heights.shape, exponent, hurst)
    if rise > 0.005:
        source += f", {rise:.2f} more in each octave below as it rises towards the posting"
    if floor:
        source += f" above its noise, baselines from {0.5 * floor.longest * posting:.3g} m"
    local = _local_deviation(heights, trusted, hurst, resolved)
    local /= posting**hurst
    # Ground that is smoother than the limit stays so for another octave: its power ends sooner.
    local *= 0.5 ** max(weighed - hurst, 0.0)
    grain = find_grain(heights, trusted)
    joint, longest = resolved * posting, resolved * BASELINES[-1] * posting
    bent = Roughness(hurst=hurst, deviation=1.0, source="", rise=rise, joint=joint)
    local *= joint**hurst / bent.deviation_over(joint)
    return Roughness(
        hurst=hurst,
        deviation=float(np.sqrt(np.mean(local**2))),
        source=f"{source}, amplitude of the DTM around each post, baselines "
        f"{joint:.3g} to {longest:.3g} m",
        exponent=exponent,
        rise=rise,
        joint=joint,
        resolved=resolved,
        local=local.astype(np.float32),
        grain=grain,
    )


def body_roughness(body: Body, why: str) -> Roughness:
    """The body's fallback figures."""
    hurst, deviation = body.roughness
    return Roughness(hurst=hurst, deviation=deviation, source=f"default of {body.name} ({why})")


def _fitted(heights: Array, trusted: Mask, resolved: int) -> tuple[float, float] | None:
    """Exponent of the DTM and its standard error; None where it is too small for the baselines."""
    if not _long_enough(heights, resolved):
        return None
    found = _fit_exponent(heights, trusted, resolved)
    return found, _standard_error(heights, trusted, resolved, _fit_exponent)


def _likely_rise(heights: Array, trusted: Mask, resolved: int) -> float:
    """Rise of the exponent in an octave, weighed against none; 0 if it falls."""
    rise = _rise(heights, trusted, resolved)
    error = _standard_error(heights, trusted, resolved, _rise)
    weight = _RISE_PRIOR**2 / (_RISE_PRIOR**2 + error**2)
    return float(np.clip(weight * rise, 0.0, _MOST_RISE))


def _weighed(exponent: tuple[float, float] | None) -> float:
    """Mean of a fit and of what ground has elsewhere, by the inverse of their variances."""
    mean, scatter = HURST_PRIOR
    if exponent is None:
        return mean
    fitted, error = exponent
    weight = scatter**2 / (scatter**2 + error**2)
    return weight * fitted + (1.0 - weight) * mean


def _source(shape: tuple[int, ...], exponent: tuple[float, float] | None, hurst: float) -> str:
    """Where an exponent comes from, in words."""
    size = f"DTM of {shape[1]} × {shape[0]} posts"
    if exponent is None:
        return f"exponent preset ({size} too small for a fit)"
    found = f"{exponent[0]:.2f} ± {exponent[1]:.2f}"
    if min(shape) < FEWEST_POSTS:
        return f"exponent preset of {HURST_PRIOR[0]:g}, moved to {hurst:.2f} by {found} of a {size}"
    return f"exponent {found} fitted to the DTM"


def _shortest_resolved(squares: list[float]) -> int:
    """Shortest baseline [posts] that is not smoothed, of 1, 2 and 4 posts.

    Args:
        squares: mean square increments over 1, 2, 4 and 8 posts.
    """
    limit = _SMOOTHED
    for n, lag in enumerate((1, 2)):
        point = squares[n + 1] / squares[n]
        # What averaging over pixels alone takes away, for an exponent in the middle.
        pixel = expected_increment(0.75, 2 * lag) / expected_increment(0.75, lag) / 4.0**0.75
        if 0.5 * math.log2(point / pixel) <= limit:
            return lag
        limit = _ROUGH
    return 4


def _long_enough(heights: Array, resolved: int) -> bool:
    """Whether the fit's baselines go often enough into the shorter side."""
    return bool(4 * BASELINES[-1] * resolved <= min(heights.shape))


def _fit_exponent(heights: Array, trusted: Mask, resolved: int) -> float:
    """Exponent of the second increments over one and two of a baseline [posts].

    What pixels average away depends on it in turn.
    """
    lags = [n * resolved for n in BASELINES]
    logs = portable.log([mean_square_increment(heights, lag, trusted) for lag in lags])
    baselines, hurst = portable.log(lags), 0.75
    for _ in range(6):
        pixel = portable.log([expected_increment(hurst, n) / n ** (2 * hurst) for n in lags])
        slope = portable.fit_line(baselines, logs - pixel)[0]
        former, hurst = hurst, round(float(np.clip(0.5 * slope, 0.05, 0.98)), 6)
        if hurst == former:
            break
    return 0.5 * slope


def _rise(heights: Array, trusted: Mask, resolved: int) -> float:
    """Rise of the exponent in each octave towards the shortest baseline."""
    baselines = [
        lag for lag in (resolved, 2 * resolved, 4 * resolved) if _long_enough(heights, lag)
    ]
    if len(baselines) < 2:
        return 0.0
    found = np.array([_fit_exponent(heights, trusted, lag) for lag in baselines])
    weight = np.array([4.0, 2.0, 1.0])[: len(found)]
    octave = np.arange(len(found)) - np.sum(weight * np.arange(len(found))) / np.sum(weight)
    return float(-np.sum(weight * octave * found) / np.sum(weight * octave**2))


def _standard_error(
    heights: Array, trusted: Mask, resolved: int, estimate: Callable[[Array, Mask, int], float]
) -> float:
    """Standard error of an estimate, from its scatter between the DTM's quarters."""
    rows, columns = (length // 2 for length in heights.shape)
    halves = [(np.s_[:rows], np.s_[rows:]), (np.s_[:columns], np.s_[columns:])]
    quarters = [(r, c) for r in halves[0] for c in halves[1]]
    found = [
        estimate(heights[q], trusted[q], resolved)
        for q in quarters
        if trusted[q].mean() > 0.5
        and np.ptp(heights[q][trusted[q]]) > 0.0
        and _long_enough(heights[q], resolved)
    ]
    return float(np.std(found, ddof=1) / np.sqrt(len(found))) if len(found) > 1 else 0.5


def _local_deviation(heights: Array, trusted: Mask, hurst: float, resolved: int) -> Array:
    """RMS deviation at one posting around each post [m], from the shortest baseline."""
    squares = local_square_increments(heights, resolved, trusted, _LOCAL_WIDTH * resolved)
    squares /= expected_increment(hurst, resolved)
    return np.sqrt(squares, out=squares)
