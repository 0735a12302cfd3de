"""What a stereo matcher averages over, and how clear the noise must be that it leaves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array, portable


@dataclass(frozen=True, kw_only=True)
class Window:
    """What a matcher averages over; its noise is white noise after it."""

    width: float
    """Standard deviation of a Gaussian, or side of a square [posts]."""
    square: bool
    """Which of the two."""
    each: float = 0.0
    """Part of the noise's variance that each post has for itself beside it, 0 to 1."""

    @property
    def white(self) -> float:
        """Variance of noise over its density at long waves."""
        return 1.0 / ((1.0 - self.each) / self._alike + self.each)

    @property
    def _alike(self) -> float:
        """The same of the noise that posts share."""
        if not self.square:
            return 1.0 / (4.0 * math.pi * self.width**2)
        return 1.0 / (self.width if self.width > 2.0 else 3.0 - 2.0 / self.width) ** 2

    @property
    def smoothing(self) -> float:
        """Standard deviation of the Gaussian that smooths ground as much [posts]."""
        return self.width / math.sqrt(12.0) if self.square else self.width

    def correlation(self, distance: float) -> float:
        """Of noise at posts so far apart along a row, a post or more."""
        if self.square:
            alike = max(1.0 - distance / self.width, 0.0)
        else:
            alike = math.exp(-((0.5 * distance / self.width) ** 2))
        return (1.0 - self.each) * alike

    def spectrum(self, across: Array, down: Array) -> Array:
        """Density of noise over that at long waves."""
        density = _averaged if self.square else _smoothed
        alike = density(across, self.width) * density(down, self.width)
        if self.each == 0.0:
            return alike
        return self.white * ((1.0 - self.each) / self._alike * alike + self.each)


WINDOWS = (
    *(Window(width=w, square=False) for w in (0.8, 0.9, 1.0, 1.15, 1.3, 1.5, 1.75, 2.0)),
    *(Window(width=w, square=True) for w in (2.5, 3.0, 3.5, 4.0, 5.0)),
)
WIDE = (
    *(Window(width=w, square=True) for w in (6.0, 7.0, 8.0)),
    *(
        Window(width=w, square=True, each=each)
        for w in (3.0, 4.0, 5.0, 6.0, 8.0)
        for each in (0.03, 0.1)
    ),
)
"""Noise that lies over more posts, or that each post has some of for itself beside it: landforms of
one size and folded ground are much like it. It is sought where tiles are large."""
NARROW = (
    *(Window(width=w, square=True) for w in (1.0, 1.1, 1.2, 1.35, 1.5, 2.0)),
    *(Window(width=w, square=False) for w in (0.5, 0.55, 0.6, 0.65, 0.7)),
)
"""Noise that is white from post to post, or nearly: folded ground is much like it, and what
interpolation to the posts left of ground."""
EACH = NARROW[0]
"""Noise of each post for itself, as rounding adds it."""


@dataclass(frozen=True, kw_only=True)
class Bar:
    """How much better ground with noise has to fit than ground alone."""

    better: float
    """χ² over that of ground alone, below which it must be."""
    share: float
    """Part of a mean square increment that the noise must have more of."""
    gain: float
    """What the difference of χ², times that part, must exceed."""

    def passed(self, misfit: float, alone: float, share: float) -> bool:
        """Whether a fit is so much better."""
        gain = (alone - misfit) * share
        return misfit < self.better * alone and share > self.share and gain > self.gain


CLEAR = Bar(better=0.55, share=0.32, gain=2.0)
CLEAR_OF_FEW = Bar(better=0.6, share=0.4, gain=4.0)
"""Below 160 posts a side."""
CLEAR_OF_POINTS = Bar(better=0.35, share=0.0, gain=3.5)
CLEAR_OF_WIDE = Bar(better=0.15, share=0.5, gain=7.0)
DOUBT_OF_WIDE = Bar(better=0.2, share=0.5, gain=7.0)
"""χ² of real DTMs without noise, averaged 2 and 4 times, falls to 0.21 of that of ground alone."""
DOUBT = Bar(better=0.35, share=0.45, gain=4.0)
DOUBT_OF_POINTS = Bar(better=0.5, share=0.0, gain=0.0)


def clear_of_narrow(window: Window) -> Bar:
    """What noise of one of `NARROW` has to pass, beside ground alone."""
    if not window.square:
        share = 0.72
    elif window == EACH:
        share = 0.5
    else:
        share = 0.65 if window.width < 2.0 else 0.6
    return Bar(better=0.35, share=share, gain=7.0)


def gaussian(number: Array, width: float) -> Array:
    """Spectrum of white noise after a Gaussian of that standard deviation [posts], 1 at 0."""
    return portable.exp(-((2.0 * math.pi * width * number) ** 2))


def _smoothed(number: Array, width: float) -> Array:
    """Density that a Gaussian leaves of white noise at posts in a row, which fold it, 1 at 0."""
    few, index = np.unique(number, return_inverse=True)
    left = sum(gaussian(few + fold, width) for fold in (-1.0, 0.0, 1.0))
    smoothed: Array = np.asarray(left)[index].reshape(number.shape)
    return smoothed


def _averaged(number: Array, width: float) -> Array:
    """Density that a mean over so many posts in a row leaves of white noise.

    Up to two posts only neighbours are alike.
    """
    few, index = np.unique(number, return_inverse=True)
    if width > 2.0:
        left = [1.0 if n == 0.0 else (sinc(width * n) / sinc(n)) ** 2 for n in few.tolist()]
    else:
        alike = 2.0 * (1.0 - 1.0 / width)
        left = [(1.0 + alike * math.cos(2.0 * math.pi * n)) / (1.0 + alike) for n in few.tolist()]
    averaged: Array = np.array(left)[index].reshape(number.shape)
    return averaged


def sinc(x: float) -> float:
    """Spectrum of a mean over one, at x waves in it."""
    return math.sin(math.pi * x) / (math.pi * x)
