"""Spectra of ground with and without noise, and which of them fit a DTM's best."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array, portable
from terrain_forge.dtm.matcher_windows import Window, gaussian, sinc
from terrain_forge.dtm.periodograms import Rings, rings_of

BETAS = np.arange(30, 41) / 10.0
"""Exponents β of ground beside noise."""
BETA_PRIOR = (3.5, 0.3)
"""Their mean and scatter on natural ground: 2H + 2 of HURST_PRIOR."""
UNLIKELY = ((BETAS - BETA_PRIOR[0]) / BETA_PRIOR[1]) ** 2
"""χ² of each of them by that."""
_BETAS_ALONE = np.arange(24, 47) / 10.0
NATURAL = 6
"""The first of the exponents of ground alone that ground beside noise has: from 0.5."""
_SMOOTHED = (0.0, 0.35, 0.5, 0.65, 0.8, 1.0, 1.25, 1.5, 2.0, 2.5)
_FOLDS = 2  # cycles per post, either way, that are folded into a spectrum of points


@dataclass(frozen=True, kw_only=True)
class Fit:
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


def ground_spectrum(number: Array, beta: ArrayLike, smoothed: float = 0.0) -> Array:
    """Shape of the spectrum of pixel means of self-affine ground, for each of some exponents."""
    # A pixel's mean, beside what is folded over at half a cycle per post.
    pixel = np.array([sinc(0.8 * n) ** 2 for n in number.tolist()])
    falling = portable.power(number, -np.asarray(beta)[..., None])
    shape: Array = falling * pixel * gaussian(number, smoothed)
    return shape


@cache
def grounds_alone(side: int) -> Array:
    """Spectra of ground alone, smoothed or not, of some exponents, shape [..., ..., rings]."""
    number = rings_of(side).number
    return np.stack([ground_spectrum(number, _BETAS_ALONE, smoothed) for smoothed in _SMOOTHED])


@cache
def grounds_of_points(side: int) -> Array:
    """Spectra of ground whose posts are heights of points, folded or without what folds."""
    rings = rings_of(side)
    folds = np.arange(-_FOLDS, _FOLDS + 1)
    across, down = rings.across[:, None, None], rings.down[:, None, None]
    squares = (across + folds[:, None]) ** 2 + (down + folds) ** 2
    logs, number = portable.log(squares), portable.log(rings.number)
    found = []
    for beta in BETAS[::2]:
        found.append(_quietest(rings.binned(portable.exp(-0.5 * beta * logs).sum(axis=(1, 2)))))
        found.append(portable.exp(-beta * number))
    return np.array(found)


def fit_rounded(grounds: Array, density: Array, error: Array, step: float) -> float:
    """χ² of ground alone whose heights are rounded to steps, white noise of a known level [m]."""
    if not step > 0.0:
        return math.inf
    white, level = np.ones_like(density), step**2 / 12.0
    return float(fit_levels(grounds, white, density, error, level)[0].min())


def _quietest(density: Array) -> Array:
    """Mean over the two quietest sectors of each ring."""
    return np.asarray(np.sort(density, axis=1)[:, :2].mean(axis=1))


def misfit_of(grounds: Array, density: Array, error: Array) -> float:
    """χ² of the best of some shapes of spectra."""
    weight = 1.0 / error**2
    rest = portable.log(density) - portable.log(grounds)
    rest -= np.sum(weight * rest, axis=-1, keepdims=True) / np.sum(weight)
    return float(np.sum(weight * rest**2, axis=-1).min())


def fit_noise(
    side: int,
    density: Array,
    error: Array,
    given: float | None,
    windows: tuple[Window, ...],
) -> Fit:
    """The best of some windows."""
    grounds, noise = _after_windows(windows, side)
    fixed = None if given is None else given**2 / np.array([[[one.white]] for one in windows])
    misfits, levels = fit_levels(grounds, noise, density, error, fixed)
    misfits = misfits + UNLIKELY
    least = np.unravel_index(np.argmin(misfits), misfits.shape)
    return Fit(window=windows[least[0]], level=float(levels[least]), misfit=float(misfits[least]))


@cache
def _after_windows(windows: tuple[Window, ...], side: int) -> tuple[Array, Array]:
    """Spectra of ground, as it is and smoothed by each window, and of the noise after it.

    Shapes [windows, 2, exponents, rings] and [windows, 1, 1, rings].
    """
    rings = rings_of(side)
    grounds = [
        [ground_spectrum(rings.number, BETAS, smoothed) for smoothed in (0.0, window.smoothing)]
        for window in windows
    ]
    noise = [_quietest(noise_spectrum(rings, window)) for window in windows]
    return np.array(grounds), np.array(noise)[:, None, None]


def noise_spectrum(rings: Rings, window: Window) -> Array:
    """Spectrum of noise after a window, 1 at long waves, shape [rings, sectors]."""
    return rings.binned(window.spectrum(rings.across, rings.down))


def fit_levels(
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
