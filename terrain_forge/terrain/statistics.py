"""Figures that describe a ground: its slopes, its spectrum beside that of its DTM."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable
from terrain_forge.dtm import (
    Nodes,
    PixelFrame,
    Pixels,
    plane_through,
    scale_error,
    site_warnings,
)
from terrain_forge.model import Heightfield, Roughness, Site
from terrain_forge.terrain.layers.fractal import detail_law

_PER_DEGREE = 100
_MOST = 2048


@dataclass(frozen=True, kw_only=True, eq=False)
class SlopeStatistics:
    """Slopes of the ground's triangles, all of which are equally large in plan."""

    median_deg: float
    """Half of the ground is steeper [deg], to 0.01°."""
    percentile_95_deg: float
    """A twentieth of the ground is steeper [deg], to 0.01°."""
    steepest_deg: float
    """Slope of the steepest triangle [deg]."""
    rms_deg: float
    """Root mean square of the gradient, as an angle [deg]."""
    shares: Array
    """Part of the ground in each degree of slope, shape [90]."""


def slope_statistics(ground: Heightfield) -> SlopeStatistics:
    """Slopes at the scale of the grid: those of the triangles of the surface."""
    z = ground.elevation
    east, north = np.diff(z, axis=1) / ground.spacing, np.diff(z, axis=0) / ground.spacing
    # South-eastern triangles have a southern and an eastern edge, north-western ones the others.
    south_eastern = np.hypot(east[:-1], north[:, 1:])
    north_western = np.hypot(east[1:], north[:, :-1])
    gradients = np.stack([south_eastern, north_western]).ravel()
    shares = _slope_shares(gradients, _PER_DEGREE)
    middle, high = np.searchsorted(np.cumsum(shares), [0.5, 0.95]) / _PER_DEGREE
    mean_square = float(np.mean(gradients * gradients, dtype=np.float64))
    return SlopeStatistics(
        median_deg=float(middle),
        percentile_95_deg=float(high),
        steepest_deg=math.degrees(math.atan(gradients.max())),
        rms_deg=math.degrees(math.atan(math.sqrt(mean_square))),
        shares=shares.reshape(90, _PER_DEGREE).sum(axis=1),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Curves:
    """How rough heights are at each scale."""

    spacing: float
    """Distance of the samples [m]."""
    wave_number: Array
    """Wave numbers [1/m]."""
    density: Array
    """Power spectral density in two dimensions [m⁴]."""
    baseline: Array
    """Baselines [m]."""
    deviation: Array
    """RMS height difference over each baseline [m]."""
    slope_shares: Array
    """Part of the ground in each degree of slope between neighbouring samples, shape [90]."""


@dataclass(frozen=True, kw_only=True)
class TerrainStatistics:
    """The ground beside the DTM that it continues."""

    ground: Curves
    """The ground as built."""
    dtm: Curves | None
    """The DTM's samples over the site and its context; None for a flat site."""
    detail: Roughness | None
    """The law of the detail; None where no layer makes any."""
    fitted: tuple[float, float] | None
    """Exponent as fitted to the DTM's increments at the joint, and its standard error."""
    spectral: tuple[float, float] | None
    """Exponent of the DTM's spectrum over 1/32 to 1/5 of a cycle per posting, and its standard
    error; None without a DTM or with too few samples."""
    worst_mean: float | None
    """Largest difference of the ground's mean over a pixel from the DTM's post [m]; None where no
    pixel lies wholly in the ground, or the lattice is no finer than half the posting."""
    dtm_state: dict[str, Any] | None
    """What was read of the DTM and what it needed, as plain values: rows and columns of its
    samples, those within the site that were holes, what was repaired, the part of the samples that
    lie in exact planes, and how far off lengths are at the site's edge, as a fraction (None where
    not georeferenced); None for a flat site."""

    def as_json(self) -> dict[str, Any]:
        """Plain values for a report."""
        return {
            "hurst": self.detail and self.detail.hurst,
            "hurst_rise_per_octave": self.detail and self.detail.rise,
            "deviation_1m_m": self.detail and self.detail.deviation,
            "source": self.detail and self.detail.source,
            "exponent_at_the_joint": _with_error(self.fitted),
            "exponent_of_the_spectrum": _with_error(self.spectral),
            "worst_pixel_mean_m": self.worst_mean,
            "ground": _curves_json(self.ground),
            "dtm": _curves_json(self.dtm) if self.dtm else None,
            "dtm_state": self.dtm_state,
        }


def terrain_statistics(*, site: Site, ground: Heightfield) -> TerrainStatistics:
    """Spectrum, structure function and slopes of a ground and of the DTM below it.

    The ground is the whole of it or a window.
    """
    dtm, spectral, state = None, None, None
    if site.dtm is not None:
        posting = site.dtm.posting
        dtm = _curves(site.dtm.heights, posting)
        band = (1.0 / (32.0 * posting), 1.0 / (5.0 * posting))
        exponent = spectral_exponent(dtm.wave_number, dtm.density, band)
        spectral = exponent if np.isfinite(exponent[0]) else None
        off = scale_error(site.crs, site.size) if site.georeferenced else None
        state = {
            "samples": list(site.dtm.heights.shape),
            "filled_samples": site.dtm.filled,
            "repairs": list(site.dtm.repairs),
            "planar_fraction": site.dtm.planar_fraction,
            "noise_m": site.dtm.noise,
            "warnings": list(site_warnings(site)),
            "scale_error_at_the_edge": off,
        }
    # The middle of a large site tells as much and costs less.
    middle = tuple(slice(max(n - _MOST, 0) // 2, (n + _MOST) // 2) for n in ground.shape)
    return TerrainStatistics(
        ground=_curves(ground.elevation[middle].astype(np.float64), ground.spacing),
        dtm=dtm,
        detail=detail_law(site),
        fitted=site.roughness.exponent,
        spectral=spectral,
        worst_mean=worst_mean(site, ground),
        dtm_state=state,
    )


def worst_mean(site: Site, ground: Heightfield) -> float | None:
    """Largest difference of the ground's mean over a pixel from the DTM's post [m]."""
    if site.dtm is None or 2.0 * site.spacing > site.dtm.posting:
        return None
    (column, row), (rows, columns) = site.first_node(ground), ground.shape
    nodes = Nodes(column=column, row=row, columns=columns, rows=rows)
    pixels = Pixels.under(site, nodes, 0)
    east, north = pixels.centres(site)
    wide, high = (0.5 * (n - 1) * ground.spacing for n in (columns, rows))
    reach = 0.75 * site.dtm.posting  # more than half a pixel's diagonal
    inside = np.abs(east - ground.origin[0] - wide) < wide - reach
    inside &= np.abs(north - ground.origin[1] - high) < high - reach
    if not inside.any():
        return None
    means = pixels.means(site, nodes, ground.elevation.astype(np.float64))[inside]
    means += site.datum_height + site.slope[0] * east[inside] + site.slope[1] * north[inside]
    tilt = _tilt(site, pixels, nodes)[inside]
    down, across = np.nonzero(inside)
    posts = site.dtm.heights[down + pixels.row, across + pixels.column]
    return float(np.abs(means - tilt - posts).max())


def _tilt(site: Site, pixels: Pixels, nodes: Nodes) -> Array:
    """What the ground's slope adds to a mean over cells that a pixel's edge cuts unevenly [m]."""
    assert site.dtm is not None
    per_row, per_column = (np.asarray(g) for g in np.gradient(site.dtm.heights))
    last_row, last_column = np.array(site.dtm.heights.shape) - 1
    rows = np.clip(pixels.row + np.arange(pixels.rows), 0, last_row)
    columns = np.clip(pixels.column + np.arange(pixels.columns), 0, last_column)
    across, down = per_column[np.ix_(rows, columns)], per_row[np.ix_(rows, columns)]
    frame = np.array(PixelFrame.of(site).per_metre)
    total = np.zeros((pixels.rows, pixels.columns))
    grids = np.meshgrid(*nodes.axes(site))
    for axis, (grid, centre) in enumerate(zip(grids, pixels.centres(site), strict=True)):
        slope = across * frame[0, axis] + down * frame[1, axis] - site.slope[axis]
        total += slope * (pixels.means(site, nodes, grid) - centre)
    return total


def _slope_shares(gradients: NDArray[Any], per_degree: int) -> Array:
    """Parts of the ground with slopes in bins from 0 to 90 degrees, from its rises per metre."""
    count = 90 * per_degree
    edges = portable.tan(np.radians(np.arange(count + 1) / per_degree)).astype(gradients.dtype)
    edges[-1] = np.inf
    near = (np.degrees(np.arctan(gradients)) * per_degree).astype(np.int32)
    # The arctangent's last bit depends on the processor, the edges do not.
    bins = np.minimum(near, count - 1)
    bins -= gradients < edges[bins]
    bins += gradients >= edges[bins + 1]
    return np.asarray(np.bincount(bins, minlength=count) / gradients.size)


def _curves(heights: Array, spacing: float) -> Curves:
    number, density = radial_spectrum(heights, spacing)
    baseline, deviation = structure_function(heights, spacing)
    east = np.diff(heights, axis=1)[:-1] / spacing
    north = np.diff(heights, axis=0)[:, :-1] / spacing
    return Curves(
        spacing=spacing,
        wave_number=number,
        density=density,
        baseline=baseline,
        deviation=deviation,
        slope_shares=_slope_shares(np.hypot(east, north).ravel(), 1),
    )


def _curves_json(curves: Curves) -> dict[str, Any]:
    return {
        "spacing_m": curves.spacing,
        "wave_number_per_m": curves.wave_number.tolist(),
        "density_m4": curves.density.tolist(),
        "baseline_m": curves.baseline.tolist(),
        "deviation_m": curves.deviation.tolist(),
        "slope_shares_per_degree": curves.slope_shares.tolist(),
    }


def _with_error(value: tuple[float, float] | None) -> dict[str, float] | None:
    return {"value": value[0], "standard_error": value[1]} if value else None


def radial_spectrum(heights: Array, spacing: float, bins: int = 24) -> tuple[Array, Array]:
    """Wave numbers [1/m] and power spectral density [m⁴] of a grid of heights [m].

    Two-sided, in two dimensions, averaged over directions in rings that are equally wide in the
    logarithm; empty ones are left out, and there are none of 6 samples a side or less. The best
    plane is taken off and a Hann window laid over, normalised so that the density's integral over
    the plane of wave numbers is the variance.
    """
    rows, columns = heights.shape
    low, high = 3.0 / (min(rows, columns) * spacing), 0.5 / spacing
    if low >= high:
        return np.empty(0), np.empty(0)
    window = np.hanning(rows)[:, None] * np.hanning(columns)[None, :]
    window /= np.sqrt(np.mean(window**2))
    power = np.abs(np.fft.rfft2((heights - plane_through(heights)) * window)) ** 2
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
    """Baselines up to a quarter of a grid of heights [m], and RMS deviations ν(L) over them [m].

    Both directions together; Shepard et al. 2001, doi:10.1029/2000JE001429.
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
