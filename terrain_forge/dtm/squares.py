"""Large grids of posts square by square, so that work on them needs little memory beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

SIDE = 2048
"""Posts a side of the squares that are worked on one by one."""
WHOLE = 2**20
"""Posts up to which all tell what a grid is like."""
SAMPLES, SAMPLE = 8, 128
"""Squares each way that tell it of a larger one, and posts a side of them."""

Square = tuple[slice, slice]


def in_squares(
    work: Callable[..., NDArray[Any]], *grids: NDArray[Any], margin: int, step: int = 1
) -> NDArray[Any]:
    """What `work` makes of grids of one shape; of large ones square by square.

    Args:
        work: Makes an array of pieces of the grids, whose last two axes are theirs.
        grids: Shape [rows, columns].
        margin: From how far away what it makes at a post depends on others [posts].
        step: Pieces begin at multiples of so many posts.
    """
    shape = grids[0].shape
    if grids[0].size <= SIDE**2:
        return work(*grids)
    margin, side = -(-margin // step) * step, max(SIDE // step, 1) * step
    made: NDArray[Any] = np.empty(0)
    for row, column in product(*(range(0, length, side) for length in shape)):
        inner = _square(row, side, shape[0]), _square(column, side, shape[1])
        outer = tuple(slice(max(part.start - margin, 0), part.stop + margin) for part in inner)
        found = work(*(grid[outer] for grid in grids))
        if not made.size:
            made = np.empty((*found.shape[:-2], *shape), found.dtype)
        down, across = (
            slice(a.start - b.start, a.stop - b.start) for a, b in zip(inner, outer, strict=True)
        )
        made[..., inner[0], inner[1]] = found[..., down, across]
    return made


def _square(start: int, side: int, length: int) -> slice:
    return slice(start, min(start + side, length))


def samples(shape: tuple[int, ...]) -> Iterator[Square]:
    """Squares that tell what a grid is like: all of it, or some evenly over a large one."""
    if shape[0] * shape[1] <= WHOLE:
        yield np.s_[:, :]
        return
    starts = [
        np.linspace(0, max(length - SAMPLE, 0), SAMPLES if length > SAMPLE else 1).astype(int)
        for length in shape
    ]
    for row, column in product(*(start.tolist() for start in starts)):
        yield np.s_[row : row + SAMPLE, column : column + SAMPLE]
