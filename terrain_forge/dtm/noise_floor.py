"""Noise of a DTM: how much of its spectrum no ground has, and what ground there is below it.

A matcher of stereo images adds errors that are alike over its window: white up to a few posts'
wavelength, nothing beyond. Ground falls off as k^-β, β = 2H + 2 of 3 to 4, everywhere. The errors
lie over all of the DTM alike and have no direction, so that they are sought in the spectrum of its
quietest parts and directions: relief that is craters here and there, or dunes one way, is not taken
for them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array, Mask, portable
from terrain_forge.dtm.increments import mean_square_increment
from terrain_forge.dtm.matcher_windows import (
    CLEAR,
    CLEAR_OF_FEW,
    CLEAR_OF_POINTS,
    DOUBT,
    DOUBT_OF_POINTS,
    EACH,
    NARROW,
    WINDOWS,
    Bar,
    Window,
    clear_of_narrow,
    gaussian,
    sinc,
)
from terrain_forge.dtm.periodograms import Rings, Tiles, rings_of
from terrain_forge.dtm.point_posts import are_points

FEWEST_POSTS = 96
"""Posts a side below which no noise is looked for."""
LARGEST = 0.6
"""RMS noise, in postings, beyond which relief is no matcher's error."""
_BETAS = np.arange(30, 41) / 10.0
_BETAS_ALONE = np.arange(24, 47) / 10.0
_NATURAL = 6  # of these, the first as ground beside noise has: exponents from 0.5
_BETA_PRIOR = (3.5, 0.3)  # 2H + 2 of HURST_PRIOR
_SMOOTHED = (0.0, 0.35, 0.5, 0.65, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5)
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
_FOLDS = 2  # cycles per post, either way, that are folded into a spectrum of points
_STEEP, _LEAK = 5.0, 0.15  # exponent of a spectrum, misfit for each one beyond


@dataclass(frozen=True, kw_only=True)
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
class _Fit:
    """Ground with noise after a window, as well as it fits."""

    window: Window
    level: float
    """Density of the noise at long waves [m² post²]."""
    misfit: float
    """χ²."""

    @property
    def deviation(self) -> float:
        """RMS of the noise [m]."""
        return math.sqrt(self.level * self.window.white)


@dataclass(frozen=True, kw_only=True)
class _Alone:
    """χ² of ground without noise, but for that of known steps."""

    any: float
    """Of any exponent."""
    natural: float
    """Of exponents that ground has."""
    points: float
    """Of folded ground, whose posts are heights of points; infinite where they are not."""
    few: bool
    """Whether the DTM is a small one."""

    def is_clear(self, fit: _Fit, share: float) -> bool:
        """Whether noise of a fit, which has this part of increments, is to be taken away."""
        if fit.window in NARROW:
            return self._below(fit, share, clear_of_narrow(fit.window), CLEAR_OF_POINTS)
        bar = CLEAR_OF_FEW if self.few else CLEAR
        return bar.passed(fit.misfit, self.any, share)

    def is_in_doubt(self, fit: _Fit, share: float) -> bool:
        """Whether that noise may be there."""
        if fit.window in NARROW:
            return self._below(fit, share, DOUBT, DOUBT_OF_POINTS)
        return CLEAR.passed(fit.misfit, self.any, share)

    def _below(self, fit: _Fit, share: float, natural: Bar, points: Bar) -> bool:
        return natural.passed(fit.misfit, self.natural, share) and points.passed(
            fit.misfit, self.points, share
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
    both = [_fit_noise(side, quiet, error, given, of) for of in (NARROW, WINDOWS)]
    fits = sorted(both, key=lambda fit: fit.misfit)
    if given is not None:
        best = fits[0]
        share = _share(heights, trusted, given, best.window)
        if not _GIVEN[0] < share < _GIVEN[1]:
            return FoundNoise()
        floor = _floor(heights, trusted, best.deviation, best.window, best.level, given=True)
        return FoundNoise(floor=floor)
    grounds = _grounds_alone(side)
    bare, rounded = _misfit(grounds, quiet, error), _fit_rounded(grounds, quiet, error, step)
    folded = are_points(heights, trusted)
    alone = _Alone(
        any=min(bare, rounded),
        natural=min(_misfit(grounds[:, _NATURAL:], quiet, error), rounded),
        points=_misfit(_grounds_of_points(side), quiet, error) if folded else math.inf,
        few=side == _SMALL,
    )
    found = FoundNoise()
    for fit in fits:
        if fit.deviation > LARGEST * posting:
            continue
        share = _share(heights, trusted, fit.deviation, fit.window)
        if alone.is_clear(fit, share) and share < _WHOLE:
            floor = _floor(heights, trusted, fit.deviation, fit.window, fit.level)
            return FoundNoise(floor=floor)
        if not found.doubt and alone.is_in_doubt(fit, share):
            found = FoundNoise(doubt=fit.deviation)
    by_steps = step / math.sqrt(12.0)
    if rounded < 0.55 * bare and _share(heights, trusted, by_steps, EACH) > 0.5:
        floor = _floor(heights, trusted, by_steps, EACH, by_steps**2, given=True)
        return FoundNoise(floor=floor)
    return found


def _ground(number: Array, beta: ArrayLike, smoothed: float = 0.0) -> Array:
    """Shape of the spectrum of pixel means of self-affine ground, for each of some exponents."""
    # A pixel's mean, beside what is folded over at half a cycle per post.
    pixel = np.array([sinc(0.8 * n) ** 2 for n in number.tolist()])
    falling = portable.power(number, -np.asarray(beta)[..., None])
    shape: Array = falling * pixel * gaussian(number, smoothed)
    return shape


@cache
def _grounds_alone(side: int) -> Array:
    """Spectra of ground alone, smoothed or not, of some exponents, shape [..., ..., rings]."""
    number = rings_of(side).number
    return np.stack([_ground(number, _BETAS_ALONE, smoothed) for smoothed in _SMOOTHED])


@cache
def _grounds_of_points(side: int) -> Array:
    """Spectra of ground whose posts are heights of points, folded or without what folds."""
    rings = rings_of(side)
    folds = np.arange(-_FOLDS, _FOLDS + 1)
    across, down = rings.across[:, None, None], rings.down[:, None, None]
    squares = (across + folds[:, None]) ** 2 + (down + folds) ** 2
    logs, number = portable.log(squares), portable.log(rings.number)
    found = []
    for beta in _BETAS[::2]:
        found.append(_quietest(rings.binned(portable.exp(-0.5 * beta * logs).sum(axis=(1, 2)))))
        found.append(portable.exp(-beta * number))
    return np.array(found)


def _fit_rounded(grounds: Array, density: Array, error: Array, step: float) -> float:
    """χ² of ground alone whose heights are rounded to steps, white noise of a known level [m]."""
    if not step > 0.0:
        return math.inf
    white, level = np.ones_like(density), step**2 / 12.0
    return float(_fit_levels(grounds, white, density, error, level)[0].min())


def _quietest(density: Array) -> Array:
    """Mean over the two quietest sectors of each ring."""
    return np.asarray(np.sort(density, axis=1)[:, :2].mean(axis=1))


def _misfit(grounds: Array, density: Array, error: Array) -> float:
    """χ² of the best of some shapes of spectra."""
    weight = 1.0 / error**2
    rest = portable.log(density) - portable.log(grounds)
    rest -= np.sum(weight * rest, axis=-1, keepdims=True) / np.sum(weight)
    return float(np.sum(weight * rest**2, axis=-1).min())


def _fit_noise(
    side: int,
    density: Array,
    error: Array,
    given: float | None,
    windows: tuple[Window, ...],
) -> _Fit:
    """The best of some windows."""
    unlikely = ((np.asarray(_BETAS) - _BETA_PRIOR[0]) / _BETA_PRIOR[1]) ** 2
    grounds, noise = _after_windows(windows, side)
    fixed = None if given is None else given**2 / np.array([[[one.white]] for one in windows])
    misfits, levels = _fit_levels(grounds, noise, density, error, fixed)
    misfits = misfits + unlikely
    least = np.unravel_index(np.argmin(misfits), misfits.shape)
    return _Fit(window=windows[least[0]], level=float(levels[least]), misfit=float(misfits[least]))


@cache
def _after_windows(windows: tuple[Window, ...], side: int) -> tuple[Array, Array]:
    """Spectra of ground, as it is and smoothed by each window, and of the noise after it.

    Shapes [windows, 2, exponents, rings] and [windows, 1, 1, rings].
    """
    rings = rings_of(side)
    grounds = [
        [_ground(rings.number, _BETAS, smoothed) for smoothed in (0.0, window.smoothing)]
        for window in windows
    ]
    noise = [_quietest(_noise(rings, window)) for window in windows]
    return np.array(grounds), np.array(noise)[:, None, None]


def _noise(rings: Rings, window: Window) -> Array:
    """Spectrum of noise after a window, 1 at long waves, shape [rings, sectors]."""
    return rings.binned(window.spectrum(rings.across, rings.down))


def _fit_levels(
    grounds: Array, noise: Array, density: Array, error: Array, fixed: ArrayLike | None
) -> tuple[Array, Array]:
    """χ² of the best sum of each ground and its noise, and the noise's level in it.

    Args:
        grounds: spectra, shape [..., rings].
        noise: those of the noise beside each, of a shape that fits.
        density: the spectrum that is looked at, shape [rings].
        error: its relative error, shape [rings].
        fixed: the noise's level where it is known.
    """
    model, tiny = density, 1e-6 * density
    level = np.zeros(grounds.shape[:-1])
    for _ in range(6):
        weight = 1.0 / (model * error) ** 2
        gg, gn, nn, gd, nd = (
            np.sum(weight * a * b, axis=-1)
            for a, b in (
                *((grounds, grounds), (grounds, noise), (noise, noise)),
                *((grounds, density), (noise, density)),
            )
        )
        if fixed is None:
            level = np.maximum((nd * gg - gd * gn) / np.maximum(gg * nn - gn * gn, 1e-300), 0.0)
        else:
            level = np.broadcast_to(np.asarray(fixed, np.float64), level.shape)
        share = np.maximum((gd - level * gn) / gg, 0.0)
        model = np.maximum(share[..., None] * grounds + level[..., None] * noise, tiny)
    return np.sum((portable.log(density / model) / error) ** 2, axis=-1), level


def _share(heights: Array, trusted: Mask, deviation: float, window: Window) -> float:
    """Largest part that noise has in the mean square increments over 1, 2 and 4 posts."""
    found = []
    for lag in (1, 2, 4):
        near, far = (window.correlation(n * lag) for n in (1.0, 2.0))
        expected = deviation**2 * (6.0 - 8.0 * near + 2.0 * far)
        square = mean_square_increment(heights, lag, trusted)
        found.append(expected / square if square > 0.0 else 0.0)
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
    law = scale * _ground(number, beta) * portable.power(2.0, -_RISE * octaves**2)
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
    parts = _noise(rings, window) * rings.count
    return np.asarray(parts.sum(axis=1) / rings.count.sum(axis=1))


def _in_all(
    tiles: Tiles, density: Array, window: Window, level: float
) -> tuple[Window, float, Array]:
    """Window, level and shape of the noise in all of a DTM, of which the quietest parts told.

    Its larger tiles tell windows apart that small ones mix up; noise may be higher elsewhere.
    """
    grounds, errors = _ground(tiles.rings.number, _BETAS), tiles.error()
    unlikely = ((_BETAS - _BETA_PRIOR[0]) / _BETA_PRIOR[1]) ** 2
    fits: dict[Window, tuple[float, float, Array]] = {}
    for one in NARROW if window in NARROW else WINDOWS:
        shape = _all_ways(tiles.rings, one)
        misfits, levels = _fit_levels(grounds, shape, density, errors, None)
        least = int(np.argmin(misfits + unlikely))
        fits[one] = float((misfits + unlikely)[least]), float(levels[least]), shape
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
    x, y = portable.log(n), portable.log(g / _ground(n, 0.0))
    mean_x = float(np.sum(weight * x) / np.sum(weight))
    mean_y = float(np.sum(weight * y) / np.sum(weight))
    mean, scatter = _BETA_PRIOR
    known = float(np.sum(weight * (x - mean_x) ** 2)) + scatter**-2.0
    slope = float(np.sum(weight * (x - mean_x) * (y - mean_y)))
    beta = float(np.clip((mean / scatter**2 - slope) / known, *_BETA_LIMITS))
    return beta, known**-0.5, math.exp(mean_y + beta * mean_x), math.exp(mean_x)
