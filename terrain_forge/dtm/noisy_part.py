"""Noise that only a part of a DTM has, such as one of several stereo pairs: sought in squares."""

from __future__ import annotations

from itertools import product

import numpy as np

from terrain_forge.base import Array, Mask
from terrain_forge.dtm.noise_floor import FEWEST_POSTS, find_noise

_SQUARES = 5
"""Squares each way, at most, in which noise is looked for that only a part has."""
_FEWEST = 3, 0.2
"""Squares with noise, and part of all of them, at least: one in fifty has some by chance, and its
neighbours share half of its posts."""


def find_noisy_part(
    heights: Array, posting: float, trusted: Mask, *, step: float = 0.0
) -> tuple[float, float]:
    """Noise that only a part of a DTM has, whose quietest parts have none.

    Args:
        heights: the DTM around the site [m].
        posting: distance of its posts [m].
        trusted: posts that are measured, not filled in.
        step: what the heights are rounded to [m], as `find_noise` has it.

    Returns:
        RMS noise [m] and the part of the DTM that has it, 0 to 1; 0 and 0 without any.
    """
    counts = [min(2 * n // FEWEST_POSTS - 1, _SQUARES) for n in heights.shape]
    if max(counts) < 2 or min(counts) < 1:
        return 0.0, 0.0
    rows, columns = (
        np.arange(count) * (n - FEWEST_POSTS) // max(count - 1, 1)
        for n, count in zip(heights.shape, counts, strict=True)
    )
    places = [*product(rows.tolist(), columns.tolist())]
    fewest, noisy = max(_FEWEST[0], _FEWEST[1] * len(places)), list[float]()
    for number, (row, column) in enumerate(places):
        if len(noisy) + len(places) - number < fewest:
            return 0.0, 0.0
        square = np.s_[row : row + FEWEST_POSTS, column : column + FEWEST_POSTS]
        floor = find_noise(heights[square], posting, trusted[square], step=step).floor
        noisy += [floor.deviation] if floor and floor.deviation > 0.0 else []
    if len(noisy) < fewest:
        return 0.0, 0.0
    return float(np.median(noisy)), len(noisy) / len(places)
