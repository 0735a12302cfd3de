"""Direction of the ground around each post: where dunes or layers make it rougher one way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask
from terrain_forge.dtm.increments import local_mean, reach_of
from terrain_forge.dtm.squares import in_squares, samples

_WIDTH = 6.0
"""Standard deviation of the Gaussian window [posts]."""
_CHANCE = 0.2
"""Difference over sum of mean square increments that ground alike in all directions has by chance
in such a window."""
_LEAST = 0.15
"""Root mean square of what exceeds it below which the ground is called alike in all directions."""


def find_grain(heights: Array, trusted: Mask) -> NDArray[np.float32] | None:
    """Cosine and sine of twice the angle of the roughest direction, times how much it is rougher.

    Second increments over one post along rows and columns, and over the pixel's diagonal both ways:
    of each pair the difference over the sum.

    Args:
        heights: the DTM around the site [m].
        trusted: posts that are measured, not filled in.

    Returns:
        Shape [2, rows, columns], angles from columns towards rows; None if there is no direction.
    """
    grain = in_squares(_grain, heights, trusted, **reach_of(_WIDTH))
    squares = [np.mean(np.sum(grain[:, *part] ** 2, axis=0)) for part in samples(heights.shape)]
    return grain if float(np.sqrt(np.mean(squares))) >= _LEAST else None


def _grain(heights: Array, trusted: Mask) -> NDArray[np.float32]:
    """Cosine and sine, less of them what chance makes, shape [2, rows, columns]."""
    along, down, rising, falling = (_near(heights, trusted, step) for step in _STEPS)
    pairs = [(a - b) / np.maximum(a + b, 1e-300) for a, b in ((along, down), (rising, falling))]
    grain = np.stack(pairs)
    size = np.sqrt(grain[0] ** 2 + grain[1] ** 2)
    beyond = np.maximum(size - _CHANCE, 0.0) / (1.0 - _CHANCE)
    return np.asarray(grain * (beyond / np.maximum(size, 1e-300)), np.float32)


_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


def _near(heights: Array, trusted: Mask, step: tuple[int, int]) -> Array:
    """Mean square of the second increments along a step around each post."""
    rows, columns = heights.shape
    total, count = np.zeros(heights.shape), np.zeros(heights.shape)
    j, i = step
    inner = np.s_[j : rows - j, abs(i) : columns - abs(i)]

    before, after = (
        np.s_[j + n * j : rows - j + n * j, abs(i) + n * i : columns - abs(i) + n * i]
        for n in (-1, 1)
    )
    known = trusted[before] & trusted[inner] & trusted[after]
    square = (heights[before] - 2.0 * heights[inner] + heights[after]) ** 2
    total[inner], count[inner] = np.where(known, square, 0.0), known
    return local_mean(total, count, _WIDTH)
