"""Posts that are heights of points rather than means of their pixels, and the means instead.

A DTM thinned out, or interpolated to its posts, has waves shorter than two postings folded into
longer ones; pixel means hardly do. Continued as if its posts were means it is far too rough. A
filter gives it the spectrum that means of the same ground have.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from terrain_forge.base import Array, Mask, portable
from terrain_forge.dtm.increments import mixed_share

FEWEST_POSTS = 32
"""Posts a side below which posts are taken for means."""
_POINTS = 0.78
"""Ratio of shares beyond which posts are called points."""
_EXPONENT = 0.75  # of the ground that the filter is for; 0.5 or 0.95 change it by 4 %
_REACH = 6
_STEP = 2.0**-20
"""Heights are whole multiples of it [m], as those of a DTM without its noise."""


def are_points(heights: Array, trusted: Mask) -> bool:
    """Whether the posts are rather heights of points.

    The mixed fourth difference, second increments of second increments the other way, lies at the
    highest wave numbers of both directions, where means over pixels have least. Its share over one
    post, beside that over two, is 1 on points of self-affine ground and 0.64 to 0.71 on means of
    any exponent; where the exponent rises towards short baselines both are less.
    """
    if min(heights.shape) < FEWEST_POSTS:
        return False
    near, far = (mixed_share(heights, lag, trusted) for lag in (1, 2))
    return bool(near > _POINTS * far)


def means_of_points(heights: Array) -> Array:
    """Heights with the spectrum that means over the pixels have [m]."""
    from scipy.ndimage import correlate

    middle = np.median(heights)
    means = correlate(heights - middle, _filter(), mode="nearest") + middle
    return np.asarray(np.rint(means / _STEP) * _STEP)


@cache
def _filter() -> Array:
    """Root of the spectrum of means over that of points, both with what is folded, as weights."""
    size = 4 * _REACH
    number = np.fft.fftfreq(size)
    number[0] = 1e-3
    folded = np.arange(-_REACH, _REACH + 1)
    waves = (number[:, None] + folded[None, :]).ravel()
    left = np.array([math.sin(math.pi * k) / (math.pi * k) for k in waves.tolist()]) ** 2
    squares = waves[:, None] ** 2 + waves[None, :] ** 2
    density = portable.power(squares, -1.0 - _EXPONENT)
    points, means = (
        d.reshape(size, len(folded), size, len(folded)).sum(axis=(1, 3))
        for d in (density, density * left[:, None] * left[None, :])
    )
    weights = np.fft.fftshift(np.fft.ifft2(np.sqrt(means / points)).real)
    weights = weights[_REACH : 3 * _REACH + 1, _REACH : 3 * _REACH + 1]
    return np.asarray(weights / weights.sum())
