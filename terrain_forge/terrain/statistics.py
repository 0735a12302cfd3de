"""Figures that describe a ground: its slopes, its spectrum beside that of its DTM."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import portable
from terrain_forge.dtm import Nodes, PixelFrame, Pixels, scale_error, site_warnings
from terrain_forge.model import Heightfield, Site
from terrain_forge.terrain.spectra import radial_spectrum, spectral_exponent, structure_function

_PER_DEGREE = 100
_MOST = 2048


@dataclass(frozen=True, kw_only=True)
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
    shares: NDArray[np.float64]
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


@dataclass(frozen=True, kw_only=True)
class Curves:
    """How rough heights are at each scale."""

    spacing: float
    """Distance of the samples [m]."""
    wave_number: NDArray[np.float64]
    """Wave numbers [1/m]."""
    density: NDArray[np.float64]
    """Power spectral density in two dimensions [m⁴]."""
    baseline: NDArray[np.float64]
    """Baselines [m]."""
    deviation: NDArray[np.float64]
    """RMS height difference over each baseline [m]."""
    slope_shares: NDArray[np.float64]
    """Part of the ground in each degree of slope between neighbouring samples, shape [90]."""


@dataclass(frozen=True, kw_only=True)
class DtmState:
    """What was read of the DTM and what it needed."""

    samples: tuple[int, int]
    """Rows and columns of samples, of the site and the context around it."""
    filled: int
    """Samples within the site that were holes."""
    repairs: tuple[str, ...]
    """What was repaired and how."""
    planar_fraction: float
    """Part of the samples that lie in exact planes, as triangles do that fill gaps, 0 to 1."""
    noise: float
    """RMS noise that was taken away [m]; 0 for none."""
    warnings: tuple[str, ...]
    """What a user should know of the ground that it makes."""
    scale_error: float | None
    """How far off lengths are at the site's edge, as a fraction; None where not georeferenced."""

    @classmethod
    def of(cls, site: Site) -> DtmState | None:
        """That of a site's DTM; None for a flat site."""
        if site.dtm is None:
            return None
        rows, columns = site.dtm.heights.shape
        return cls(
            samples=(rows, columns),
            filled=site.dtm.filled,
            repairs=site.dtm.repairs,
            planar_fraction=site.dtm.planar_fraction,
            noise=site.dtm.noise,
            warnings=tuple(site_warnings(site)),
            scale_error=scale_error(site.crs, site.size) if site.georeferenced else None,
        )

    def as_json(self) -> dict[str, Any]:
        """Plain values for a report."""
        return {
            "samples": list(self.samples),
            "filled_samples": self.filled,
            "repairs": list(self.repairs),
            "planar_fraction": self.planar_fraction,
            "noise_m": self.noise,
            "warnings": list(self.warnings),
            "scale_error_at_the_edge": self.scale_error,
        }


@dataclass(frozen=True, kw_only=True)
class TerrainStatistics:
    """The ground beside the DTM that it continues."""

    ground: Curves
    """The ground as built."""
    dtm: Curves | None
    """The DTM's samples over the site and its context; None for a flat site."""
    hurst: float
    """Exponent of the detail."""
    deviation: float
    """RMS deviation of the detail at 1 m [m]."""
    source: str
    """Where exponent and deviation come from."""
    fitted: tuple[float, float] | None
    """Exponent as fitted to the DTM's increments at the joint, and its standard error."""
    spectral: tuple[float, float] | None
    """Exponent of the DTM's spectrum over 1/32 to 1/5 of a cycle per posting, and its standard
    error; None without a DTM or with too few samples."""
    worst_mean: float | None
    """Largest difference of the ground's mean over a pixel from the DTM's post [m]; None where no
    pixel lies wholly in the ground, or the lattice is no finer than half the posting."""
    state: DtmState | None
    """What was read of the DTM and what it needed; None for a flat site."""

    def as_json(self) -> dict[str, Any]:
        """Plain values for a report."""
        return {
            "hurst": self.hurst,
            "deviation_1m_m": self.deviation,
            "source": self.source,
            "exponent_at_the_joint": _with_error(self.fitted),
            "exponent_of_the_spectrum": _with_error(self.spectral),
            "worst_pixel_mean_m": self.worst_mean,
            "ground": _curves_json(self.ground),
            "dtm": _curves_json(self.dtm) if self.dtm else None,
            "dtm_state": self.state.as_json() if self.state else None,
        }


def terrain_statistics(*, site: Site, ground: Heightfield) -> TerrainStatistics:
    """Spectrum, structure function and slopes of a ground and of the DTM below it.

    Args:
        site: the place.
        ground: the whole of it or a window.
    """
    found = site.roughness
    dtm, spectral = None, None
    if site.dtm is not None:
        posting = site.dtm.posting
        dtm = _curves(site.dtm.heights, posting)
        band = (1.0 / (32.0 * posting), 1.0 / (5.0 * posting))
        exponent = spectral_exponent(dtm.wave_number, dtm.density, band)
        spectral = exponent if np.isfinite(exponent[0]) else None
    return TerrainStatistics(
        ground=_curves(_centre(ground.elevation), ground.spacing),
        dtm=dtm,
        hurst=found.hurst,
        deviation=found.deviation,
        source=found.source,
        fitted=found.exponent,
        spectral=spectral,
        worst_mean=worst_mean(site, ground),
        state=DtmState.of(site),
    )


def worst_mean(site: Site, ground: Heightfield) -> float | None:
    """Largest difference of the ground's mean over a pixel from the DTM's post [m]."""
    if site.dtm is None or 2.0 * site.spacing > site.dtm.posting:
        return None
    first = (
        round((ground.origin[0] - site.west) / site.spacing),
        round((ground.origin[1] - site.south) / site.spacing),
    )
    rows, columns = ground.shape
    nodes = Nodes(column=first[0], row=first[1], columns=columns, rows=rows)
    pixels = Pixels.under(site, nodes, 0)
    east, north = pixels.centres(site)
    wide, high = (0.5 * (n - 1) * ground.spacing for n in (columns, rows))
    reach = 0.75 * site.dtm.posting  # more than half a pixel's diagonal
    inside = np.abs(east - ground.origin[0] - wide) < wide - reach
    inside &= np.abs(north - ground.origin[1] - high) < high - reach
    if not inside.any():
        return None
    row, column = np.nonzero(inside)
    means = pixels.means(site, nodes, ground.elevation.astype(np.float64))[inside]
    means += site.datum_height + site.slope[0] * east[inside] + site.slope[1] * north[inside]
    tilt = _tilt(site, pixels, nodes)[inside]
    posts = site.dtm.heights[row + pixels.row, column + pixels.column]
    return float(np.abs(means - tilt - posts).max())


def _tilt(site: Site, pixels: Pixels, nodes: Nodes) -> NDArray[np.float64]:
    """What the ground's slope adds to a mean over cells that a pixel's edge cuts unevenly [m]."""
    assert site.dtm is not None
    per_row, per_column = (np.asarray(g) for g in np.gradient(site.dtm.heights))
    rows, columns = (
        np.clip(first + np.arange(count), 0, length - 1)
        for first, count, length in zip(
            (pixels.row, pixels.column),
            (pixels.rows, pixels.columns),
            site.dtm.heights.shape,
            strict=True,
        )
    )
    across, down = per_column[np.ix_(rows, columns)], per_row[np.ix_(rows, columns)]
    frame = np.array(PixelFrame.of(site).per_metre)
    total = np.zeros((pixels.rows, pixels.columns))
    grids = np.meshgrid(*nodes.axes(site))
    for axis, (grid, centre) in enumerate(zip(grids, pixels.centres(site), strict=True)):
        slope = across * frame[0, axis] + down * frame[1, axis] - site.slope[axis]
        total += slope * (pixels.means(site, nodes, grid) - centre)
    return total


def _slope_shares(gradients: NDArray[Any], per_degree: int) -> NDArray[np.float64]:
    """Parts of the ground with slopes in bins from 0 to 90 degrees, from its rises per metre."""
    count = 90 * per_degree
    edges = portable.tan(np.radians(np.arange(count + 1) / per_degree)).astype(gradients.dtype)
    edges[-1] = np.inf
    near = (np.degrees(np.arctan(gradients)) * per_degree).astype(np.int32)
    # The arctangent's last bit depends on the processor, the edges do not.
    bins = np.minimum(near, count - 1)
    bins -= gradients < edges[bins]
    bins += gradients >= edges[bins + 1]
    shares: NDArray[np.float64] = np.bincount(bins, minlength=count) / gradients.size
    return shares


def _centre(elevation: NDArray[np.float32]) -> NDArray[np.float64]:
    """At most 2048 × 2048 nodes from the middle, so that a large site costs no more."""
    rows, columns = (slice(max(n - _MOST, 0) // 2, (n + _MOST) // 2) for n in elevation.shape)
    return elevation[rows, columns].astype(np.float64)


def _curves(heights: NDArray[np.float64], spacing: float) -> Curves:
    number, density = radial_spectrum(heights, spacing)
    baseline, deviation = structure_function(heights, spacing)
    east, north = (
        np.diff(heights, axis=1)[:-1] / spacing,
        np.diff(heights, axis=0)[:, :-1] / spacing,
    )
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
