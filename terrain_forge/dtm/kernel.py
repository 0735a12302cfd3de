"""Interpolation by our own local kernel: the same bits in every window."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, inner, kernel, over_chunks


@inner
def _weights(t):  # type: ignore[no-untyped-def]
    """Cubic convolution with a = -1/2 (Keys 1981, doi:10.1109/TASSP.1981.1163711)."""
    w0 = ((-0.5 * t + 1.0) * t - 0.5) * t
    w1 = (1.5 * t - 2.5) * t * t + 1.0
    w2 = ((-1.5 * t + 2.0) * t + 0.5) * t
    w3 = (0.5 * t - 0.5) * t * t
    return w0, w1, w2, w3


@inner
def _index(n, length, wrap):  # type: ignore[no-untyped-def]
    return n % length if wrap else min(max(n, 0), length - 1)


@kernel
def _cubic(first, last, grid, column, row, wrap, result):  # type: ignore[no-untyped-def]
    rows, columns = grid.shape
    for j in range(first, last):
        for i in range(column.shape[1]):
            left, top = np.floor(column[j, i]), np.floor(row[j, i])
            across = _weights(column[j, i] - left)
            down = _weights(row[j, i] - top)
            total = 0.0
            for n in range(4):
                source = grid[_index(np.int64(top) + n - 1, rows, wrap)]
                line = 0.0
                for m in range(4):
                    line += across[m] * source[_index(np.int64(left) + m - 1, columns, wrap)]
                total += down[n] * line
            result[j, i] = total


def cubic(grid: Array, *, column: Array, row: Array, wrap: bool = False) -> Array:
    """Values between the samples of a grid; beyond its edge the edge goes on (or the grid repeats).

    Args:
        grid: samples, shape [rows, columns].
        column: where, whole numbers are samples, shape [n, m].
        row: the same for rows.
        wrap: whether the grid is one tile of a repeating pattern.
    """
    result = np.empty(column.shape)
    places = np.array(column, order="C"), np.array(row, order="C")
    over_chunks(_cubic, len(result), np.array(grid, order="C"), *places, wrap, result)
    return result
