"""Noise of a DTM: how much of its spectrum no ground has, and what ground there is below it.

A matcher of stereo images adds errors that are alike over its window: white up to a few posts'
wavelength, nothing beyond. Ground falls off as k^-β, β = 2H + 2 of 3 to 4, everywhere. The errors
lie over all of the DTM alike and have no direction, so that they are sought in the spectrum of its
quietest parts and directions: relief that is craters here and there, or dunes one way, is not taken
for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from terrain_forge.base import Array, Mask, portable
from terrain_forge.dtm.increments import mean_square_increment
from terrain_forge.dtm.matcher_windows import (
    CLEAR,
    CLEAR_OF_FEW,
    CLEAR_OF_POINTS,
    CLEAR_OF_WIDE,
    DOUBT,
    DOUBT_OF_POINTS,
    DOUBT_OF_WIDE,
    EACH,
    NARROW,
    WIDE,
    WINDOWS,
    Bar,
    Window,
    clear_of_narrow,
)
from terrain_forge.dtm.noise_spectra import (
    BETA_PRIOR,
    BETAS,
    NATURAL,
    UNLIKELY,
    Fit,
    fit_levels,
    fit_noise,
    fit_rounded,
    ground_spectrum,
    grounds_alone,
    grounds_of_points,
    misfit_of,
    noise_spectrum,
)
from terrain_forge.dtm.periodograms import Rings, Tiles
from terrain_forge.dtm.point_posts import are_points

FEWEST_POSTS = 96
"""Posts a side below which no noise is looked for."""
LARGEST = 0.6
"""RMS noise, in postings, beyond which relief is no matcher's error."""
_BETA_LIMITS = (3.0, 3.9)  # exponents 0.5 to 0.95
_RISE = 0.05
"""Of the exponent in an octave below the waves seen: the mean of what clean DTMs show there."""
_OTHER_WINDOW = 0.5
"""χ² of another window in all of a DTM, over that of the one found, at which it is taken."""
_MOST_UNEVEN = 4.0
"""Mean square of noise in all of a DTM over that in its quietest parts, at most."""
_WHOLE = 1.1
"""Part of the mean square increments that noise may have, all of them and what a fit is off by."""
_GIVEN = 0.01, 2.0
"""Part of them that noise which is given has: less changes nothing that counts, more is no noise of
this DTM."""
_SHORTEST = 0.35  # cycles per post, which increments over one and two posts look at
_LARGE, _SMALL = 64, 32  # sides of tiles [posts]
_STEEP, _LEAK = 5.0, 0.15  # exponent of a spectrum, misfit for each one beyond


@dataclass(frozen=True, kw_only=True, eq=False)
class NoiseFloor:
    """Noise of a DTM and its ground's spectrum; all lengths in posts."""

    deviation: float
    """RMS noise [m]."""
    correlation: float
    """Distance over which the noise's correlation falls to 1/e [posts]."""
    exponent: tuple[float, float]
    """Hurst exponent of the ground above the noise, and its standard error."""
    longest: float
    """Longest wavelength at which the noise hides the ground [posts]."""
    number: Array
    """Wave numbers [1/post]."""
    density: Array
    """Spectral density of the DTM there [m² post²]."""
    kept: Array
    """Part of that density that is ground, 0 to 1."""


@dataclass(frozen=True, kw_only=True)
class FoundNoise:
    """What was found of noise in a DTM."""

    floor: NoiseFloor | None = None
    """The noise that is to be taken away; None where there is none to speak of."""
    doubt: float = 0.0
    """RMS of noise that there may be instead [m], not clearly enough to take it away; 0 if none."""


@dataclass(frozen=True, kw_only=True)
class _Alone:
    """χ² of ground without noise, but for that of known steps."""

    any: float
    """Of any exponent."""
    natural: float
    """Of exponents that ground has."""
    points: Callable[[], float]
    """Of folded ground, whose posts are heights of points; infinite where they are not. It is asked
    for where the others do not decide."""
    few: bool
    """Whether the DTM is a small one."""

    def is_clear(self, fit: Fit, share: float) -> bool:
        """Whether noise of a fit, which has this part of increments, is to be taken away."""
        if fit.window in NARROW:
            return self._below(fit, share, clear_of_narrow(fit.window), CLEAR_OF_POINTS)
        if fit.window in WIDE:
            return self._below(fit, share, CLEAR_OF_WIDE, CLEAR_OF_POINTS)
        bar = CLEAR_OF_FEW if self.few else CLEAR
        return bar.passed(fit.misfit, self.any, share)

    def is_in_doubt(self, fit: Fit, share: float) -> bool:
        """Whether that noise may be there."""
        if fit.window in NARROW:
            return self._below(fit, share, DOUBT, DOUBT_OF_POINTS)
        if fit.window in WIDE:
            return self._below(fit, share, DOUBT_OF_WIDE, DOUBT_OF_POINTS)
        return CLEAR.passed(fit.misfit, self.any, share)

    def _below(self, fit: Fit, share: float, ground: Bar, points: Bar) -> bool:
        alone = self.any if fit.window in WIDE else self.natural
        return ground.passed(fit.misfit, alone, share) and points.passed(
            fit.misfit, self.points(), share
        )


def find_noise(
    heights: Array, posting: float, trusted: Mask, given: float | None = None, *, step: float = 0.0
) -> FoundNoise:
    """The noise of a DTM.

    Args:
        heights: the DTM around the site [m].
        posting: distance of its posts [m].
        trusted: posts that are measured, not filled in.
        given: RMS noise that the user knows [m]; its correlation is fitted.
        step: what the heights are rounded to [m]: known noise, of which no more is made.
    """
    if min(heights.shape) < (FEWEST_POSTS if given is None else 2 * _SMALL):
        return FoundNoise()
    side = _LARGE if min(heights.shape) >= 2.5 * _LARGE else _SMALL
    tiles = Tiles.of(heights, trusted, side)
    if len(tiles.power) < 6:
        return FoundNoise()
    quiet = tiles.quiet()
    if not quiet.min() > 0.0:
        return FoundNoise()
    # Where a spectrum falls steeply, what leaks from its neighbours counts.
    fall = -np.gradient(portable.log(quiet), portable.log(tiles.rings.number))
    error = np.hypot(tiles.error(), _LEAK * np.maximum(fall - _STEEP, 0.0))

    @cache
    def square(lag: int) -> float:
        return mean_square_increment(heights, lag, trusted)

    families = (NARROW, WINDOWS, WIDE) if side == _LARGE else (NARROW, WINDOWS)
    every = [fit_noise(side, quiet, error, given, of) for of in families]
    fits = sorted(every, key=lambda fit: fit.misfit)
    if given is not None:
        best = fits[0]
        share = _share(square, given, best.window)
        if not _GIVEN[0] < share < _GIVEN[1]:
            return FoundNoise()
        floor = _floor(heights, trusted, best.deviation, best.window, best.level, given=True)
        return FoundNoise(floor=floor)
    grounds = grounds_alone(side)
    bare, rounded = misfit_of(grounds, quiet, error), fit_rounded(grounds, quiet, error, step)

    @cache
    def points() -> float:
        folded = are_points(heights, trusted)
        return misfit_of(grounds_of_points(side), quiet, error) if folded else math.inf

    alone = _Alone(
        any=min(bare, rounded),
        natural=min(misfit_of(grounds[:, NATURAL:], quiet, error), rounded),
        points=points,
        few=side == _SMALL,
    )
    found = FoundNoise()
    for fit in fits:
        small = fit.deviation <= LARGEST * posting
        share = _share(square, fit.deviation, fit.window)
        if small and share < _WHOLE and alone.is_clear(fit, share):
            floor = _floor(heights, trusted, fit.deviation, fit.window, fit.level)
            return FoundNoise(floor=floor)
        if not found.doubt and alone.is_in_doubt(fit, share):
            found = FoundNoise(doubt=fit.deviation)
    by_steps = step / math.sqrt(12.0)
    if rounded < 0.55 * bare and _share(square, by_steps, EACH) > 0.5:
        floor = _floor(heights, trusted, by_steps, EACH, by_steps**2, given=True)
        return FoundNoise(floor=floor)
    return found


def _share(square: Callable[[int], float], deviation: float, window: Window) -> float:
    """Largest part that noise has in the mean square increments over 1, 2 and 4 posts."""
    found = []
    for lag in (1, 2, 4):
        near, far = (window.correlation(n * lag) for n in (1.0, 2.0))
        expected = deviation**2 * (6.0 - 8.0 * near + 2.0 * far)
        found.append(expected / square(lag) if square(lag) > 0.0 else 0.0)
    return max(found)


def _floor(
    heights: Array,
    trusted: Mask,
    deviation: float,
    window: Window,
    level: float,
    *,
    given: bool = False,
) -> NoiseFloor | None:
    """The ground's law from the waves that stand above the noise, and how much of each is it.

    Where the noise hides none, None, or the shortest are taken for hidden if it is given.
    """
    side = 2 ** int(math.log2(min(*heights.shape, 512) / 2))
    tiles = Tiles.of(heights, trusted, side)
    if not len(tiles.power):
        return None
    number, density = tiles.rings.number, tiles.mean()
    if given:
        shape = _all_ways(tiles.rings, window)
    else:
        window, level, shape = _in_all(tiles, density, window, level)
        deviation = math.sqrt(level * window.white)
    noise = level * shape
    ground = density - noise
    seen = ground > noise
    seen[-1] &= not given
    hidden = np.flatnonzero(~seen)
    if not len(hidden):
        return None
    first = int(hidden[0])
    # A window that is off by a twentieth tells the more the farther its noise has fallen.
    unsure = noise * np.hypot(0.15, 0.1 * (2.0 * math.pi * window.smoothing * number) ** 2)
    errors = np.hypot(tiles.error() * ground, unsure)
    beta, error, scale, middle = _law(number, ground, errors, seen)
    octaves = np.maximum(portable.log2(number / middle), 0.0)
    law = scale * ground_spectrum(number, beta) * portable.power(2.0, -_RISE * octaves**2)
    beta += 2.0 * _RISE * max(math.log2(_SHORTEST / middle), 0.0)
    beta = min(beta, _BETA_LIMITS[1])
    kept = np.where(np.arange(len(number)) < first, ground, np.minimum(law, density)) / density
    kept = np.where(kept > 0.95, 1.0, kept)
    return NoiseFloor(
        deviation=deviation,
        correlation=window.width * (0.632 if window.square else 2.0),
        exponent=(0.5 * beta - 1.0, 0.5 * error),
        longest=1.0 / float(number[first]),
        number=number,
        density=density,
        kept=kept,
    )


def _all_ways(rings: Rings, window: Window) -> Array:
    """Spectrum of noise after a window in all directions, 1 at long waves, shape [rings]."""
    parts = noise_spectrum(rings, window) * rings.count
    return np.asarray(parts.sum(axis=1) / rings.count.sum(axis=1))


def _in_all(
    tiles: Tiles, density: Array, window: Window, level: float
) -> tuple[Window, float, Array]:
    """Window, level and shape of the noise in all of a DTM, of which the quietest parts told.

    Its larger tiles tell windows apart that small ones mix up; noise may be higher elsewhere.
    """
    grounds, errors = ground_spectrum(tiles.rings.number, BETAS), tiles.error()
    fits: dict[Window, tuple[float, float, Array]] = {}
    for one in next(family for family in (NARROW, WINDOWS, WIDE) if window in family):
        shape = _all_ways(tiles.rings, one)
        misfits, levels = fit_levels(grounds, shape, density, errors, None)
        least = int(np.argmin(misfits + UNLIKELY))
        fits[one] = float((misfits + UNLIKELY)[least]), float(levels[least]), shape
    best = min(fits, key=lambda one: fits[one][0])
    if fits[best][0] < _OTHER_WINDOW * fits[window][0]:
        level *= window.white / best.white
        window = best
    _, whole, shape = fits[window]
    return window, min(max(whole, level), _MOST_UNEVEN * level), shape


def _law(
    number: Array, ground: Array, error: Array, seen: Mask
) -> tuple[float, float, float, float]:
    """β, its standard error, scale and middle of the spectrum that passes through the waves seen.

    Of the long waves those within two octaves of the hidden ones count.
    """
    used = seen & (number > 0.25 * number[~seen][0])
    if used.sum() < 2:
        used = seen | (np.arange(len(number)) < 2)
    n, g = number[used], np.maximum(ground[used], 0.1 * error[used])
    weight = (g / error[used]) ** 2
    x, y = portable.log(n), portable.log(g / ground_spectrum(n, 0.0))
    mean_x = float(np.sum(weight * x) / np.sum(weight))
    mean_y = float(np.sum(weight * y) / np.sum(weight))
    mean, scatter = BETA_PRIOR
    known = float(np.sum(weight * (x - mean_x) ** 2)) + scatter**-2.0
    slope = float(np.sum(weight * (x - mean_x) * (y - mean_y)))
    beta = float(np.clip((mean / scatter**2 - slope) / known, *_BETA_LIMITS))
    return beta, known**-0.5, math.exp(mean_y + beta * mean_x), math.exp(mean_x)
