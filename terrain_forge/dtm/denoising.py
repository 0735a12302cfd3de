"""A DTM without its noise: filtered, and what the noise hides drawn anew.

A Wiener filter leaves of each wave the part that is ground. What it takes of the ground too is
drawn at random with the spectrum that the ground has, so that the whole is as rough as the ground
at every baseline and agrees with the posts within their noise.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, kernel, mix, over_chunks, portable, uniform
from terrain_forge.dtm.noise_floor import NoiseFloor

_STEP = 2.0**-20
"""Heights are whole multiples of it [m], so that the last bits of a transform do not show."""


def denoised(heights: Array, floor: NoiseFloor, key: np.uint64) -> Array:
    """Heights [m] of the ground below a DTM's noise.

    Args:
        heights: the DTM [m].
        floor: its noise.
        key: of what is drawn, from `stage_key`.
    """
    from scipy.fft import dctn, idctn

    waves = dctn(heights - _plane(heights), norm="ortho", workers=1)
    drawn = np.empty(heights.shape)
    over_chunks(_draw, len(drawn), key, drawn)
    squares, kept, missing = _filters(floor)
    down, across = ((np.arange(n) / (2.0 * n)) ** 2 for n in heights.shape)
    for row in range(len(waves)):
        square = down[row] + across
        waves[row] *= np.interp(square, squares, kept)
        waves[row] += np.interp(square, squares, missing) * drawn[row]
    waves[0, 0] = 0.0
    ground = idctn(waves, norm="ortho", workers=1, overwrite_x=True) + _plane(heights)
    return np.asarray(np.rint(ground / _STEP) * _STEP)


def _filters(floor: NoiseFloor) -> tuple[Array, Array, Array]:
    """Squares of wave numbers, factor on each, and RMS amplitude of each that is drawn [m].

    At equal steps of the logarithm.
    """
    lowest = float(portable.log2(floor.number[0]))
    steps = np.arange(lowest - 1.0, 0.0, 1.0 / 64.0)
    at = portable.log2(floor.number)
    kept = np.interp(steps, at, floor.kept, left=1.0)
    density = portable.exp(np.interp(steps, at, portable.log(floor.density)))
    missing = np.sqrt(kept * (1.0 - kept) * density)
    return portable.power(2.0, steps) ** 2, kept, missing


def _plane(heights: Array) -> Array:
    """The plane of least squares through the heights [m]."""
    rows, columns = heights.shape
    y = np.linspace(-1.0, 1.0, rows)[:, None]
    x = np.linspace(-1.0, 1.0, columns)[None, :]
    across, down = np.mean(heights * x) / np.mean(x**2), np.mean(heights * y) / np.mean(y**2)
    result: Array = heights.mean() + across * x + down * y
    return result


@kernel
def _draw(first, last, key, drawn):  # type: ignore[no-untyped-def]
    """Normal variates to four moments: sums of twelve uniform ones."""
    for j in range(first, last):
        row = mix(key, np.uint64(j))
        for i in range(drawn.shape[1]):
            cell = mix(row, np.uint64(i))
            total = -6.0
            for n in range(12):
                total += uniform(mix(cell, np.uint64(n)))
            drawn[j, i] = total
