"""Fractal relief that continues the DTM below its posting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from terrain_forge.seeds import stage_key
from terrain_forge.site import Site, Window
from terrain_forge.terrain.layer import Layer
from terrain_forge.terrain.noise import octaves

Array = NDArray[np.float64]

# Mean square difference of the unit-lattice noise at distances 2^(n/2), n = -12 … 8, over 4 million
# pairs each (measured again by tests/test_terrain.py).
_STRUCTURE = np.array(
    [9.52e-05, 1.903e-04, 3.803e-04, 7.595e-04, 1.514e-03, 3.010e-03, 5.946e-03, 1.160e-02]
    + [2.211e-02, 4.025e-02, 6.721e-02, 9.614e-02, 1.075e-01, 9.651e-02, 9.301e-02, 9.316e-02]
    + [9.316e-02] * 5
)


@dataclass(frozen=True, kw_only=True)
class Fractal(Layer):
    """Self-affine relief of the RMS deviation ν(L) = ν(1 m)·L^H.

    Shepard et al. 2001, doi:10.1029/2000JE001429. Without figures of its own it takes those that
    were fitted to the DTM.
    """

    kind: Literal["fractal"] = "fractal"
    hurst: Annotated[float, Interval(ge=0.05, le=0.98)] | None = None
    """Hurst exponent H; without it the one fitted to the DTM."""
    deviation_1m_m: Annotated[float, Interval(ge=0, le=10)] | None = None
    """RMS height difference of points 1 m apart [m]; without it the one fitted to the DTM."""
    longest_wavelength_m: Annotated[float, Interval(gt=0, le=1e6)] | None = None
    """Longest wavelength [m]; without it twice the DTM's posting, or 32 m on a flat site."""
    gain: Annotated[float, Interval(ge=0, le=100)] = 1.0
    """Factor on the heights."""

    def relief(self, *, site: Site, window: Window, elevation: Array) -> Array:  # noqa: ARG002
        """Noise octaves from the longest wavelength down to twice the spacing."""
        hurst = site.roughness.hurst if self.hurst is None else self.hurst
        deviation = site.roughness.deviation if self.deviation_1m_m is None else self.deviation_1m_m
        posting = 16.0 if site.dtm is None else site.dtm.posting
        longest = self.longest_wavelength_m or 2.0 * posting
        count = max(int(np.floor(np.log2(longest / (2.0 * site.spacing)) + 1e-9)) + 1, 0)
        wavelengths = longest * 0.5 ** np.arange(count, dtype=np.float64)
        amplitudes = self.gain * octave_amplitudes(hurst, deviation, wavelengths)
        east, north = site.axes(window)
        key = stage_key(site.seed, "terrain/fractal")
        return octaves(key, east=east, north=north, wavelengths=wavelengths, amplitudes=amplitudes)


def octave_amplitudes(hurst: float, deviation: float, wavelengths: Array) -> Array:
    """Factors of noise octaves, halving in wavelength, whose sum is self-affine.

    An endless sum of octaves λ with factors a·λ^H has the mean square difference a²·K(H)·L^2H,
    where K is the sum over all octaves of 2^(2Hn)·D(2^-n), averaged over a factor 2 of L.
    """
    octave = np.arange(-60, 61)
    phases = np.arange(8) / 8.0
    sums = [
        np.sum(2.0 ** (2 * hurst * (octave - p)) * _structure(2.0 ** (p - octave))) for p in phases
    ]
    amplitudes: Array = deviation / np.sqrt(np.mean(sums)) * wavelengths**hurst
    return amplitudes


def _structure(distance: Array) -> Array:
    """Mean square difference of the unit noise; r² below the table, constant above it."""
    table = np.log2(_STRUCTURE)
    steps = 2.0 * np.log2(distance)
    inside = np.interp(steps, np.arange(-12, 9), table)
    return np.asarray(2.0 ** np.where(steps < -12, table[0] + (steps + 12), inside))
