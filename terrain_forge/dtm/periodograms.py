"""Periodograms of a DTM's tiles, and what its quietest parts and directions have."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, portable

_SECTORS = 4
_MOST_TILES = 24  # a side
_MISFIT = 0.1  # of spectra, beside their scatter
_ALIKE = 2.8  # wave numbers of a Hann window, each counted twice, that tell as much as one
_LOWEST = 0.9  # the lower two of four equal sectors over their mean


@dataclass(frozen=True, kw_only=True)
class Tiles:
    """Periodograms of overlapping squares of a DTM, in rings and sectors of wave numbers."""

    number: Array
    """Mean wave number of each ring [1/post]."""
    count: Array
    """Wave numbers in each ring and sector."""
    waves: tuple[Array, Array, NDArray[np.int64], Array]
    """Across and down of each wave number, its ring and sector, how often it counts."""
    power: Array
    """Densities [m² post²], shape [tiles, rings, sectors]."""

    @classmethod
    def of(cls, heights: Array, trusted: Mask, side: int) -> Tiles:
        """Those of a DTM's tiles of so many posts a side, of trusted posts for the most part."""
        window = np.hanning(side + 2)[1:-1]
        window = window[:, None] * window[None, :]
        window /= math.sqrt(float(np.mean(window**2)))
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
        power = []
        for row, column in _corners(heights.shape, side):
            part = np.s_[row : row + side, column : column + side]
            if trusted[part].mean() < 0.9:
                continue
            waves = np.fft.rfft2(_levelled(heights[part]) * window)
            density = (waves.real**2 + waves.imag**2)[inside] / side**2
            power.append(np.bincount(index, weight * density, rings * _SECTORS) / count)
        return cls(
            number=sums.reshape(rings, _SECTORS).sum(1) / count.reshape(rings, _SECTORS).sum(1),
            count=count.reshape(rings, _SECTORS),
            waves=(grids[0][inside], grids[1][inside], index, weight),
            power=np.array(power).reshape(-1, rings, _SECTORS),
        )

    def quiet(self) -> Array:
        """Density of the quietest quarter of the tiles in the two quietest sectors.

        Corrected so that it is that of a surface that is everywhere alike.
        """
        free = np.maximum(self.count / _ALIKE, 1.0)
        # Wilson & Hilferty's lower quartile of a mean of as many exponential variables.
        quartile = (1.0 - 1.0 / (9.0 * free) - 0.6745 / (3.0 * np.sqrt(free))) ** 3
        lowest = np.sort(np.quantile(self.power, 0.25, axis=0) / quartile, axis=1)
        return np.asarray(0.5 * (lowest[:, 0] + lowest[:, 1]) / _LOWEST)

    def mean(self) -> Array:
        """Density of all tiles in all directions."""
        total = (self.power.mean(axis=0) * self.count).sum(axis=1)
        return np.asarray(total / self.count.sum(axis=1))

    def binned(self, density: Array) -> Array:
        """Mean in each ring and sector of a density at each wave number."""
        index, weight = self.waves[2:]
        total = np.bincount(index, weight * density, self.count.size)
        return np.asarray(total.reshape(self.count.shape) / self.count)

    def error(self) -> Array:
        """Relative standard errors of densities, with what a model cannot know."""
        waves = np.maximum(self.count.sum(axis=1) / _ALIKE, 1.0) * max(len(self.power) / 4.0, 1.0)
        return np.asarray(np.sqrt(1.0 / waves + _MISFIT**2))


def _corners(shape: tuple[int, ...], side: int) -> list[tuple[int, int]]:
    """First rows and columns of squares that overlap by half, or lie evenly over a large DTM."""
    starts = []
    for length in shape:
        count = min(-(-2 * (length - side) // side) + 1, _MOST_TILES)
        starts.append(np.linspace(0, length - side, count).astype(int).tolist())
    return [(row, column) for row in starts[0] for column in starts[1]]


def _levelled(part: Array) -> Array:
    """Heights without their best plane."""
    y = np.linspace(-1.0, 1.0, part.shape[0])[:, None]
    x = np.linspace(-1.0, 1.0, part.shape[1])[None, :]
    part = part - part.mean()
    result: Array = part - np.mean(part * x) / np.mean(x**2) * x
    return result - np.mean(part * y) / np.mean(y**2) * y
