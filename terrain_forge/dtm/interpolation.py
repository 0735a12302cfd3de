"""From the DTM's samples to the site's nodes: interpolation that keeps means, and a cubic one.

The first takes care of the ground: a post is the mean of its pixel, a node the mean of its cell.

The ground is the cubic spline whose means over the pixels are the posts, an area-matching spline:
a sum of cubic B-splines with coefficients c, where a post is
(c[-2] + 76 c[-1] + 230 c[0] + 76 c[1] + c[2]) / 384 (Unser 1999, doi:10.1109/79.799930). The
inverse of that filter falls off by 0.36 each pixel; it is cut off, so that the ground of a window
depends on pixels near it only. Slopes and curvatures are continuous: no pixel shows. A node's
height is the mean over the node's own cell, so that averaging nodes over pixels returns the posts,
and a DTM that is finer than the lattice is averaged.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inlined, inner, kernel, over_chunks
from terrain_forge.dtm.lattice import Nodes, PixelFrame, Places, node_places, pixel_of
from terrain_forge.model import Site, Window

FAR = 16
"""Reach of the inverse filter [pixels] for the DTM: means are kept to a ten-millionth of bends."""
NEAR = 10
"""The same for detail, whose means are small: they are kept to a ten-thousandth of themselves."""
STENCIL = 2
"""Pixels beyond its own whose coefficients a node no larger than a pixel depends on."""

_BEYOND = 3
_FEW = 5000  # places, which NumPy does in a few milliseconds


@inner
def _integral(t):  # type: ignore[no-untyped-def]
    """Integrals of the four B-splines around a knot interval from its begin to the fraction t."""
    s = 1.0 - t
    t2 = t * t
    t4 = t2 * t2
    return (
        (1.0 - s * s * s * s) / 24.0,
        (0.75 * t4 - 2.0 * t2 * t + 4.0 * t) / 6.0,
        (t + 1.5 * t2 + t2 * t - 0.75 * t4) / 6.0,
        t4 / 24.0,
    )


@inner
def _mean_weights(centre, length, weights):  # type: ignore[no-untyped-def]
    """Weights of the coefficients in the mean over [centre ± length/2].

    Returns the first coefficient and how many there are; whole numbers are the pixels' centres.
    """
    low, high = centre - 0.5 * length, centre + 0.5 * length
    first, last = np.int64(np.floor(low)), np.int64(np.floor(high))
    span = last - first
    for n in range(span + 4):
        weights[n] = 0.0
    for n in range(span):
        weights[n] += 1.0 / 24.0
        weights[n + 1] += 11.0 / 24.0
        weights[n + 2] += 11.0 / 24.0
        weights[n + 3] += 1.0 / 24.0
    begin, end = _integral(low - first), _integral(high - last)
    weights[0] -= begin[0]
    weights[1] -= begin[1]
    weights[2] -= begin[2]
    weights[3] -= begin[3]
    weights[span] += end[0]
    weights[span + 1] += end[1]
    weights[span + 2] += end[2]
    weights[span + 3] += end[3]
    for n in range(span + 4):
        weights[n] /= length
    return first - 1, span + 4


@inner
def _four_weights(t, bend):  # type: ignore[no-untyped-def]
    """The same where no knot lies in the cell; t is its centre, `bend` a 24th of its length².

    The mean of a cubic over a cell of the length h is q + h²/24 q″ at the cell's centre.
    """
    s = 1.0 - t
    return (
        s * (s * s / 6.0 + bend),
        2.0 / 3.0 - t * t * (1.0 - 0.5 * t) + bend * (3.0 * t - 2.0),
        2.0 / 3.0 - s * s * (1.0 - 0.5 * s) + bend * (3.0 * s - 2.0),
        t * (t * t / 6.0 + bend),
    )


@inlined
def _limited(n, length):  # type: ignore[no-untyped-def]
    return min(max(n, 0), length - 1)


@inner
def _sum(grid, left, width, across, top, height, down):  # type: ignore[no-untyped-def]
    """Weighted sum of a part of a grid; beyond its edge the edge goes on."""
    rows, columns = grid.shape
    value = 0.0
    for n in range(height):
        line = 0.0
        row = _limited(top + n, rows)
        for m in range(width):
            line += across[m] * grid[row, _limited(left + m, columns)]
        value += down[n] * line
    return value


@inner
def _sum_of_16(grid, left, top, across, down):  # type: ignore[no-untyped-def]
    """The same of 4 × 4."""
    rows, columns = grid.shape
    c0, c1 = _limited(left, columns), _limited(left + 1, columns)
    c2, c3 = _limited(left + 2, columns), _limited(left + 3, columns)
    value = 0.0
    for n in range(4):
        r = _limited(top + n, rows)
        line = across[0] * grid[r, c0] + across[1] * grid[r, c1]
        line += across[2] * grid[r, c2] + across[3] * grid[r, c3]
        value += down[n] * line
    return value


@kernel
def _add(first, last, grid, origin, places, cell, factor, total):  # type: ignore[no-untyped-def]
    across, down = np.empty(np.int64(cell[0]) + 6), np.empty(np.int64(cell[1]) + 6)
    half_column, half_row = 0.5 * cell[0], 0.5 * cell[1]
    bend_column, bend_row = cell[0] * cell[0] / 24.0, cell[1] * cell[1] / 24.0
    for j in range(first, last):
        for i in range(total.shape[1]):
            column, row = pixel_of(places, j, i)
            # Parts of a pixel before the origin is taken off, which would round them.
            left, top = np.int64(np.floor(column)), np.int64(np.floor(row))
            x, y = column - left, row - top
            left, top = left - origin[0], top - origin[1]
            smooth = half_column <= x <= 1.0 - half_column and half_row <= y <= 1.0 - half_row
            if smooth:
                a, d = _four_weights(x, bend_column), _four_weights(y, bend_row)
                value = _sum_of_16(grid, left - 1, top - 1, a, d)
            else:
                west, width = _mean_weights(x, cell[0], across)
                south, height = _mean_weights(y, cell[1], down)
                value = _sum(grid, left + west, width, across, top + south, height, down)
            total[j, i] += factor * value


@cache
def _inverse(reach: int) -> Array:
    """The filter that turns means into coefficients, cut off and scaled to keep constants."""
    angle = 2.0 * np.pi * np.arange(64) / 64.0
    response = 384.0 / (230.0 + 152.0 * np.cos(angle) + 2.0 * np.cos(2.0 * angle))
    taps = np.fft.ifft(response).real
    taps = np.concatenate([taps[-reach:], taps[: reach + 1]])
    return np.asarray(taps / taps.sum())


def _coefficients(means: Array, reach: int) -> Array:
    """Coefficients of the pixels and of a few beyond the edge, which goes on."""
    from scipy.ndimage import correlate1d

    wide = np.pad(means, _BEYOND, mode="edge")
    along = correlate1d(wide, _inverse(reach), axis=1, mode="nearest")
    return np.asarray(correlate1d(along, _inverse(reach), axis=0, mode="nearest"))


def _needed(places: Places, cell: tuple[float, float], axis: int, length: int, reach: int) -> slice:
    """The pixels along an axis that the coefficients under some nodes depend on."""
    margin = reach + STENCIL + 1 + int(cell[axis])
    low = int(np.floor(places.anchors[axis].min())) - margin
    high = int(np.ceil(places.anchors[axis].max())) + margin + 1
    return slice(min(max(low, 0), length - 1), max(min(high, length), 1))


def add_cell_means(
    total: Array,
    means: Array,
    *,
    places: Places,
    cell: tuple[float, float],
    reach: int,
    origin: tuple[int, int] = (0, 0),
    factor: float = 1.0,
) -> None:
    """Add to each node the mean over its cell of the ground that has the given pixel means.

    Args:
        total: what is added to, shape [rows, columns] of nodes.
        means: the pixels' means; beyond their edge the edge goes on.
        places: where the nodes lie among the pixels.
        cell: extent of a node's cell along the pixels' columns and rows [pixels].
        reach: pixels around that a coefficient depends on, such as `FAR`.
        origin: column and row of the first of `means`.
        factor: of what is added.
    """
    columns = rows = slice(None)
    if origin == (0, 0):
        columns = _needed(places, cell, 0, means.shape[1], reach)
        rows = _needed(places, cell, 1, means.shape[0], reach)
        origin = (columns.start, rows.start)
    over_chunks(
        _add,
        len(total),
        _coefficients(means[rows, columns], reach),
        np.array(origin, np.int64) - _BEYOND,
        places,
        np.array(cell, np.float64),
        factor,
        total,
    )


def dtm_heights(*, site: Site, window: Window) -> Array:
    """Heights of the DTM above the site's datum at the window's nodes [m], shape [rows, columns].

    Their mean over each pixel of the DTM is its post. Levelling is applied; a flat site is zero
    everywhere.
    """
    east, north = site.axes(window)
    heights = np.zeros((north.size, east.size))
    if site.dtm is None:
        return heights
    add_cell_means(
        heights,
        site.dtm.heights,
        places=node_places(site, Nodes.of(window)),
        cell=PixelFrame.of(site).extent(site.spacing),
        reach=FAR,
    )
    heights -= site.datum_height
    heights -= site.slope[0] * east[None, :]
    heights -= site.slope[1] * north[:, None]
    return heights


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
    if column.size <= _FEW:
        return _cubic_few(grid, column, row, wrap=wrap)
    result = np.empty(column.shape)
    places = np.array(column, order="C"), np.array(row, order="C")
    over_chunks(_cubic, len(result), np.array(grid, order="C"), *places, wrap, result)
    return result


def _cubic_few(grid: Array, column: Array, row: Array, *, wrap: bool) -> Array:
    """The same bits for a few places, without what loading a first kernel takes: 0.2 s."""
    left, top = np.floor(column), np.floor(row)
    across, down = _weights.py_func(column - left), _weights.py_func(row - top)

    def index(first: Array, step: int, length: int) -> NDArray[np.int64]:
        n = first.astype(np.int64) + step - 1
        return n % length if wrap else np.clip(n, 0, length - 1)

    total = np.zeros(column.shape)
    for n in range(4):
        source, line = index(top, n, grid.shape[0]), np.zeros(column.shape)
        for m in range(4):
            line = line + across[m] * grid[source, index(left, m, grid.shape[1])]
        total = total + down[n] * line
    return total
