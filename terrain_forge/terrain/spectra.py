"""Power spectra and structure functions of heights on a grid."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable


def radial_spectrum(heights: Array, spacing: float, bins: int = 24) -> tuple[Array, Array]:
    """Two-sided power spectral density in two dimensions, averaged over directions.

    The best plane is taken off and a Hann window laid over, normalised so that the density's
    integral over the plane of wave numbers is the variance.

    Args:
        heights: heights [m], shape [rows, columns].
        spacing: distance of the samples [m].
        bins: rings, equally wide in the logarithm; empty ones are left out.

    Returns:
        Wave numbers [1/m] and densities [m⁴]; none of a grid of 6 samples a side or less.
    """
    rows, columns = heights.shape
    low, high = 3.0 / (min(rows, columns) * spacing), 0.5 / spacing
    if low >= high:
        return np.empty(0), np.empty(0)
    window = np.hanning(rows)[:, None] * np.hanning(columns)[None, :]
    window /= np.sqrt(np.mean(window**2))
    power = np.abs(np.fft.rfft2((heights - best_plane(heights)) * window)) ** 2
    power *= spacing**2 / heights.size
    north, east = np.fft.fftfreq(rows, spacing), np.fft.rfftfreq(columns, spacing)
    number = np.hypot(north[:, None], east[None, :])
    ring = np.digitize(number.ravel(), portable.geomspace(low, high, bins + 1)) - 1
    kept = (ring >= 0) & (ring < bins)
    count = np.bincount(ring[kept], minlength=bins)
    full = count > 0
    sums = [
        np.bincount(ring[kept], values.ravel()[kept], minlength=bins)[full] / count[full]
        for values in (number, power)
    ]
    return sums[0], sums[1]


def structure_function(heights: Array, spacing: float) -> tuple[Array, Array]:
    """RMS deviation ν(L) over baselines up to a quarter of the grid, both directions together.

    Shepard et al. 2001, doi:10.1029/2000JE001429.

    Args:
        heights: heights [m], shape [rows, columns].
        spacing: distance of the samples [m].

    Returns:
        Baselines [m] and RMS deviations [m].
    """
    longest = max(min(heights.shape) // 4, 1)
    lags = np.unique(portable.geomspace(1, longest, 18).round().astype(int))
    return lags * spacing, np.array([rms_deviation(heights, int(lag)) for lag in lags])


def rms_deviation(heights: Array, lag: int) -> float:
    """RMS height difference of samples `lag` apart along rows and along columns [m]."""
    east = heights[:, lag:] - heights[:, :-lag]
    north = heights[lag:] - heights[:-lag]
    return float(np.sqrt(0.5 * (np.mean(east**2) + np.mean(north**2))))


def spectral_exponent(
    number: Array, density: Array, band: tuple[float, float]
) -> tuple[float, float]:
    """Hurst exponent of a spectrum A·k^-(2H+2) over a band of wave numbers, and its standard error.

    NaN where fewer than three rings lie in the band.
    """
    inside = (number >= band[0]) & (number <= band[1]) & (density > 0.0)
    if inside.sum() < 3:
        return float("nan"), float("nan")
    x, y = portable.log(number[inside]), portable.log(density[inside])
    x = x - x.mean()
    slope = float(np.sum(x * y) / np.sum(x**2))
    rest = y - y.mean() - slope * x
    error = np.sqrt(np.sum(rest**2) / max(inside.sum() - 2, 1) / np.sum(x**2))
    return -0.5 * slope - 1.0, float(0.5 * error)


def best_plane(heights: Array) -> Array:
    """The plane of least squares through a grid of heights [m]."""
    rows, columns = heights.shape
    x = np.linspace(-1.0, 1.0, columns)[None, :]
    y = np.linspace(-1.0, 1.0, rows)[:, None]
    across = np.mean(heights * x) / np.mean(x**2)
    along = np.mean(heights * y) / np.mean(y**2)
    result: Array = heights.mean() + across * x + along * y
    return result
