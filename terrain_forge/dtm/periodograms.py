"""Periodograms of a DTM's tiles, and what its quietest parts and directions have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, portable

_SECTORS = 4
_MOST_TILES = 24  # a side
_MISFIT = 0.1  # of spectra, beside their scatter
_ALIKE = 2.8  # wave numbers of a Hann window, each counted twice, that tell as much as one
_LOWEST = 0.9  # the lower two of four equal sectors over their mean


@dataclass(frozen=True, kw_only=True, eq=False)
class Rings:
    """Rings and sectors of the wave numbers of a square of posts."""

    side: int
    """Posts a side."""
    taper: Array
    """What heights are multiplied by, a Hann window of mean square 1, shape [side, side]."""
    number: Array
    """Mean wave number of each ring [1/post]."""
    count: Array
    """Wave numbers in each ring and sector."""
    inside: Mask
    """Which waves of a transform are in a ring."""
    across: Array
    """Wave number of each of them along rows [1/post]."""
    down: Array
    """Wave number of each of them along columns [1/post]."""
    index: NDArray[np.int64]
    """Ring and sector of each of them."""
    weight: Array
    """How often each of them counts."""

    def binned(self, density: Array) -> Array:
        """Mean in each ring and sector of a density at each wave number."""
        total = np.bincount(self.index, self.weight * density, self.count.size)
        return np.asarray(total.reshape(self.count.shape) / self.count)

    def power(self, squares: Array) -> Array:
        """Density [m² post²] in each ring and sector of squares of heights [m]."""
        waves = np.fft.rfft2(_levelled(squares) * self.taper)
        densities = (waves.real**2 + waves.imag**2)[:, self.inside] / self.side**2
        return np.array([self.binned(density) for density in densities])


@cache
def rings_of(side: int) -> Rings:
    """Those of a square of so many posts a side."""
    taper = np.hanning(side + 2)[1:-1]
    taper = taper[:, None] * taper[None, :]
    taper /= math.sqrt(float(np.mean(taper**2)))
    down, across = np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None, :]
    number = np.sqrt(down**2 + across**2)
    edges = portable.power(2.0, np.arange(-18, 1) / 3.0 - 1.0) * 1.0001
    edges = edges[edges > 2.4 / side]
    rings = len(edges) - 1
    ring = np.digitize(number, edges) - 1
    # Sectors around the axes and the diagonals: |tan| below or above tan 22.5°.
    steep, flat = np.abs(down) > 2.41421356 * across, np.abs(down) < 0.41421356 * across
    sector = np.where(flat, 0, np.where(steep, 2, np.where(down > 0.0, 1, 3)))
    weight = np.where((across == 0.0) | (across == 0.5), 1.0, 2.0) + 0.0 * down
    inside = (ring >= 0) & (ring < rings)
    index, weight = (ring * _SECTORS + sector)[inside], weight[inside]
    grids = np.broadcast_arrays(across, down)
    count = np.bincount(index, weight, rings * _SECTORS).astype(np.float64)
    sums = np.bincount(index, weight * number[inside], rings * _SECTORS)
    return Rings(
        side=side,
        taper=taper,
        number=sums.reshape(rings, _SECTORS).sum(1) / count.reshape(rings, _SECTORS).sum(1),
        count=count.reshape(rings, _SECTORS),
        inside=inside,
        across=grids[0][inside],
        down=grids[1][inside],
        index=index,
        weight=weight,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Tiles:
    """Periodograms of overlapping squares of a DTM, in rings and sectors of wave numbers."""

    rings: Rings
    """The wave numbers."""
    power: Array
    """Densities [m² post²], shape [tiles, rings, sectors]."""

    @classmethod
    def of(cls, heights: Array, trusted: Mask, side: int) -> Tiles:
        """Those of a DTM's tiles of so many posts a side, of trusted posts for the most part."""
        rings = rings_of(side)
        power = [np.empty((0, *rings.count.shape))]
        for row, columns in _corners(heights.shape, side):
            parts = [np.s_[row : row + side, column : column + side] for column in columns]
            if known := [part for part in parts if trusted[part].mean() >= 0.9]:
                power.append(rings.power(np.stack([heights[part] for part in known])))
        return cls(rings=rings, power=np.concatenate(power))

    def quiet(self) -> Array:
        """Density of the quietest quarter of the tiles in the two quietest sectors.

        Corrected so that it is that of a surface that is everywhere alike.
        """
        free = np.maximum(self.rings.count / _ALIKE, 1.0)
        # Wilson & Hilferty's lower quartile of a mean of as many exponential variables.
        quartile = (1.0 - 1.0 / (9.0 * free) - 0.6745 / (3.0 * np.sqrt(free))) ** 3
        lowest = np.sort(np.quantile(self.power, 0.25, axis=0) / quartile, axis=1)
        return np.asarray(0.5 * (lowest[:, 0] + lowest[:, 1]) / _LOWEST)

    def mean(self) -> Array:
        """Density of all tiles in all directions."""
        count = self.rings.count
        total = (self.power.mean(axis=0) * count).sum(axis=1)
        return np.asarray(total / count.sum(axis=1))

    def error(self) -> Array:
        """Relative standard errors of densities, with what a model cannot know."""
        tiles = max(len(self.power) / 4.0, 1.0)
        waves = np.maximum(self.rings.count.sum(axis=1) / _ALIKE, 1.0) * tiles
        return np.asarray(np.sqrt(1.0 / waves + _MISFIT**2))


def _corners(shape: tuple[int, ...], side: int) -> list[tuple[int, list[int]]]:
    """First rows of squares that overlap by half, or lie evenly over a large DTM, and columns."""
    starts = []
    for length in shape:
        count = min(-(-2 * (length - side) // side) + 1, _MOST_TILES)
        starts.append(np.linspace(0, length - side, count).astype(int).tolist())
    return [(row, starts[1]) for row in starts[0]]


def _levelled(squares: Array) -> Array:
    """Heights of squares without the best plane of each."""
    across = np.linspace(-1.0, 1.0, squares.shape[2])
    for x in (np.ones_like(across)[None, :], across[None, :], across[:, None]):
        slope = np.sum(squares * x, axis=(1, 2)) / (squares[0].size * np.mean(x**2))
        squares = squares - slope[:, None, None] * x
    return squares
