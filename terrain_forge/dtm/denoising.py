"""A DTM without its noise: filtered, and what the noise hides drawn anew.

A Wiener filter leaves of each wave the part that is ground. What it takes of the ground too is
drawn at random with the spectrum that the ground has, so that the whole is as rough as the ground
at every baseline and agrees with the posts within their noise. Noise is everywhere alike, ground is
not: where it is smoother than on the whole, less of a wave is ground and less is drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array, Mask, kernel, mix, over_chunks, portable, uniform
from terrain_forge.dtm.noise_floor import NoiseFloor

_STEP = 2.0**-20
"""Heights are whole multiples of it [m], so that the last bits of a transform do not show."""
_WIDTH = 0.8
"""Standard deviation of the window in which a band of waves is looked at [its wavelengths]."""
_FREE = 4.0 * math.pi * _WIDTH**2 * 1.5 * math.pi
"""Degrees of freedom of a band in it."""
_BANDS = (-1, 0, 1, 2)
"""Octaves that tell where ground is rough, counted from the longest wave that noise hides."""
_LEAST = 0.3
"""Ground in a band, over its noise, below which the band says nothing."""
_UNSURE = 0.15, 0.3
"""What a band's noise and its ground, as told by other bands, are off by."""
_FOLLOWED = 0.9
"""Exponent on what bands tell of power: shorter waves vary less from place to place."""
_MOST = 32.0
"""Factor by which ground is rougher or smoother than on the whole, at most."""


def denoised(
    heights: Array, floor: NoiseFloor, key: np.uint64, trusted: Mask | None = None
) -> Array:
    """Heights [m] of the ground below a DTM's noise.

    Args:
        heights: the DTM [m].
        floor: its noise.
        key: of what is drawn, from `stage_key`.
        trusted: posts that are measured, not filled in; all, if not given.
    """
    plane = plane_through(heights)
    waves = _Waves.of(heights - plane)
    spectra = _Spectra.of(floor)
    rough = _unevenness(waves, spectra, floor, np.s_[:] if trusted is None else trusted)
    drawn = np.empty(heights.shape)
    over_chunks(_draw, len(drawn), key, drawn)
    steps = 2.0 * portable.log2([rough.min(), rough.max()])
    levels = portable.power(2.0, 0.5 * np.arange(math.floor(steps[0]), math.ceil(steps[1]) + 1))
    ground = plane
    for n, level in enumerate(levels):
        kept, missing = spectra.filters(level)
        part = waves.passed(spectra.squares, kept, (missing, drawn))
        ground = ground + part * np.interp(rough, levels, np.arange(len(levels)) == n)
    return np.asarray(np.rint(ground / _STEP) * _STEP)


@dataclass(frozen=True, eq=False)
class _Waves:
    """Heights as a sum of cosines, without their mean."""

    amplitudes: Array

    @classmethod
    def of(cls, heights: Array) -> _Waves:
        """Those of heights."""
        from scipy.fft import dctn

        waves = dctn(heights, norm="ortho", workers=1)
        waves[0, 0] = 0.0
        return cls(waves)

    def squares(self) -> tuple[Array, Array]:
        """Squares of wave numbers down, as a column, and across [1/post²]."""
        down, across = ((np.arange(n) / (2.0 * n)) ** 2 for n in self.amplitudes.shape)
        return down[:, None], across

    def passed(
        self, squares: Array, factors: Array, more: tuple[Array, Array] | None = None
    ) -> Array:
        """Heights of the waves after a filter, given at squares of wave numbers.

        Args:
            squares: where the filter is given [1/post²].
            factors: of the filter there.
            more: another filter, and waves of which it lets what it lets be added.
        """
        from scipy.fft import idctn

        waves = np.empty_like(self.amplitudes)
        down, across = self.squares()
        for row, own in enumerate(down):
            square = own + across
            waves[row] = self.amplitudes[row] * np.interp(square, squares, factors)
            if more is not None:
                waves[row] += more[1][row] * np.interp(square, squares, more[0])
        waves[0, 0] = 0.0
        return np.asarray(idctn(waves, norm="ortho", workers=1, overwrite_x=True))

    def mean(self, squares: Array, density: Array) -> float:
        """Mean square height of waves of a spectral density, given at squares of wave numbers."""
        down, across = self.squares()
        rows = [np.interp(own + across, squares, density).sum() for own in down]
        return math.fsum(rows) / self.amplitudes.size


@dataclass(frozen=True, eq=False)
class _Spectra:
    """Spectral densities at equal steps of the wave number's logarithm [m² post²]."""

    steps: Array
    """Logarithms of wave numbers, to the base of 2."""
    ground: Array
    noise: Array

    @classmethod
    def of(cls, floor: NoiseFloor) -> _Spectra:
        """Those of a DTM; beyond its longest waves all is ground."""
        at = portable.log2(floor.number)
        steps = np.arange(float(at[0]) - 1.0, 0.0, 1.0 / 64.0)
        kept = np.interp(steps, at, floor.kept, left=1.0)
        density = portable.exp(np.interp(steps, at, portable.log(floor.density)))
        return cls(steps, kept * density, (1.0 - kept) * density)

    @property
    def squares(self) -> Array:
        """Squares of the wave numbers [1/post²]."""
        return np.asarray(portable.power(4.0, self.steps))

    def filters(self, level: float) -> tuple[Array, Array]:
        """Factor on each wave, and RMS amplitude of each that is drawn [m], of rougher ground."""
        ground = level**2 * self.ground
        kept = ground / (ground + self.noise)
        kept = np.where(kept > 0.95, 1.0, kept)
        return kept, np.sqrt(kept * (1.0 - kept) * (ground + self.noise))

    def band(self, number: float) -> Array:
        """Part of the power that a band around a wave number has of each."""
        return np.asarray(np.maximum(1.0 - np.abs(self.steps - math.log2(number)), 0.0))


def _unevenness(
    waves: _Waves, spectra: _Spectra, floor: NoiseFloor, trusted: Mask | slice
) -> Array:
    """How rough the ground is around each post, over all of it: a factor on its heights.

    Told by the bands of waves that stand out of the noise, by how much each does.
    """
    shape = waves.amplitudes.shape
    bands = []
    for octave in _BANDS:
        number = 2.0**octave / floor.longest
        if not floor.number[0] < math.sqrt(2.0) * number < math.sqrt(0.5):
            continue
        band = spectra.band(number)
        squared = waves.passed(spectra.squares, np.sqrt(band)) ** 2
        noise = waves.mean(spectra.squares, band * spectra.noise)
        ground = float(squared[trusted].mean()) - noise
        if ground > _LEAST * noise:
            bands.append((_smoothed(squared, _WIDTH / number), ground, noise))
    if not bands:
        return np.ones(shape)
    power = np.ones(shape)
    for _ in range(4):
        total, weight = np.zeros(shape), np.zeros(shape)
        for squared, ground, noise in bands:
            square_error = _square_error(power, ground, noise)
            total += (squared - noise) * ground / square_error
            weight += ground**2 / square_error
        power = np.clip(total / weight, _MOST**-2.0, _MOST**2.0)
    # Ground that is alike everywhere seems to vary too, by what bands, which overlap, are off by.
    parts = [
        (
            ground**2,
            ground * math.sqrt(2.0 / _FREE) * (ground + noise),
            _square_error(1.0, ground, noise),
        )
        for _, ground, noise in bands
    ]
    by_chance = float((sum(b / c for _, b, c in parts) / sum(a / c for a, _, c in parts)) ** 2)
    real = max(1.0 - by_chance / max(float(power[trusted].var()), 1e-12), 0.0)
    rough = portable.power(power, 0.5 * _FOLLOWED * real)
    rough = rough / math.sqrt(float(np.mean(rough[trusted] ** 2)))
    return np.asarray(np.clip(rough, 1.0 / _MOST, _MOST))


def _square_error(power: float | Array, ground: float, noise: float) -> Array:
    """Mean square error of a band's mean square in its window, where ground has a power."""
    chance = 2.0 / _FREE * (power * ground + noise) ** 2
    return np.asarray(chance + (_UNSURE[0] * noise) ** 2 + (_UNSURE[1] * power * ground) ** 2)


def _smoothed(values: Array, width: float) -> Array:
    """Means over a Gaussian window of a width [posts], mirrored at the border.

    By cosines, which cost the same for windows of tens of posts.
    """
    from scipy.fft import dctn, idctn

    waves = dctn(values, norm="ortho", workers=1)
    for axis, n in enumerate(values.shape):
        falls = portable.exp(-2.0 * (math.pi * width * np.arange(n) / (2.0 * n)) ** 2)
        waves *= falls[:, None] if axis == 0 else falls
    return np.asarray(idctn(waves, norm="ortho", workers=1, overwrite_x=True))


def plane_through(heights: Array) -> Array:
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
