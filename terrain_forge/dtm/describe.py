"""What a raster is, in words for `terrain-forge check`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.dtm.projection import geographic_crs, local_crs, transform
from terrain_forge.dtm.raster import Raster
from terrain_forge.dtm.roughness import COARSE_POSTING


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a raster is."""

    facts: tuple[tuple[str, str], ...]
    """Name and value, for a table."""
    warnings: tuple[str, ...]
    """What a user should know before building from it."""


def describe(raster: Raster) -> Description:
    """Say what an open raster is, where it lies, what its numbers mean, what is wrong with it."""
    dataset, band = raster.dataset, raster.band
    rows, columns = raster.shape
    posting = ground_posting(raster)
    values = _Values.read(raster)
    form = f"{dataset.driver}, {columns} × {rows} samples, {dataset.dtypes[band - 1]}"
    if dataset.count > 1:
        form += f", band {band} of {dataset.count}"
    facts = [
        ("format", form),
        ("place", _place(raster)),
        ("posting", f"{_metres(posting)}" if posting else "unknown"),
        ("values", _meaning(raster)),
        ("heights", values.range_text(raster)),
        ("nodata", f"{100 * values.missing:.1f} % of the samples"),
    ]
    return Description(facts=tuple(facts), warnings=tuple(_warnings(raster, posting, values)))


@dataclass(frozen=True, kw_only=True)
class _Values:
    """A look at all samples (thinned out where there are very many)."""

    heights: NDArray[np.float64]
    missing: float

    @classmethod
    def read(cls, raster: Raster) -> _Values:
        rows, columns = raster.shape
        step = max(int(np.ceil(max(rows, columns) / 2048)), 1)
        shape = (max(rows // step, 1), max(columns // step, 1))
        raw = raster.dataset.read(raster.band, out_shape=shape).astype(np.float64)
        valid = raster.dataset.read_masks(raster.band, out_shape=shape) > 0
        valid &= np.isfinite(raw) & (np.abs(raw) < 1e30)
        if raster.nodata is not None:
            valid &= raw != raster.nodata
        heights = raw[valid] * raster.scale + raster.offset - raster.reference_radius
        return cls(heights=heights, missing=float(1.0 - valid.mean()))

    def range_text(self, raster: Raster) -> str:
        if not self.heights.size:
            return "no valid sample"
        low, high = self.heights.min(), self.heights.max()
        unit = "m" if raster.vertical_known else "(no vertical scale: raw numbers)"
        return f"{low:.8g} to {high:.8g} {unit}"


def ground_posting(raster: Raster) -> float | None:
    """Distance of samples on the ground at the raster's middle [m], the coarser direction."""
    if not raster.to_pixel:
        return None
    a, b, _, d, e, _ = raster.to_pixel
    inverse = np.linalg.inv([[a, b], [d, e]])
    if not raster.crs:
        return float(np.linalg.norm(inverse, axis=0).max())
    x, y = raster.middle
    steps = np.array([x, y]) + np.stack([np.zeros(2), inverse[:, 0], inverse[:, 1]])
    geographic = geographic_crs(raster.crs)
    lon, lat = transform(raster.crs, geographic, steps[:, 0], steps[:, 1])
    local = local_crs(raster.crs, float(lon[0]), float(lat[0]))
    east, north = transform(geographic, local, lon, lat)
    return float(np.hypot(east[1:] - east[0], north[1:] - north[0]).max())


def _place(raster: Raster) -> str:
    if not raster.crs:
        known = (
            "its size on the ground comes from the recipe" if raster.to_pixel else "no size known"
        )
        return f"not georeferenced, {known}"
    from rasterio.crs import CRS

    x, y = raster.middle
    lon, lat = transform(raster.crs, geographic_crs(raster.crs), np.array([x]), np.array([y]))
    name = raster.crs.split('"')[1]
    kind = "longitude and latitude" if CRS.from_wkt(raster.crs).is_geographic else name
    return f"{kind}, centre {lon[0]:.4f}° E {lat[0]:.4f}° N"


def _meaning(raster: Raster) -> str:
    dtype = raster.dataset.dtypes[raster.band - 1]
    if raster.reference_radius:
        return (
            f"radius: value × {raster.scale:g} + {raster.offset:.10g} m from the body's centre; "
            f"heights are taken above {raster.reference_radius:.10g} m"
        )
    if not raster.vertical_known:
        return f"unknown: {dtype} without a vertical scale, an image or a stretched height map"
    unit = raster.dataset.units[raster.band - 1]
    stated = f", the file says {unit!r}" if unit else ""
    if (raster.scale, raster.offset) == (1.0, 0.0):
        return f"height above the datum in metres{stated}"
    return f"height: value × {raster.scale:.6g} + {raster.offset:g} m{stated}"


def _warnings(raster: Raster, posting: float | None, values: _Values) -> list[str]:
    found = []
    if not values.heights.size:
        found.append("no valid sample: nothing can be built from it")
    if not raster.to_pixel:
        found.append("without georeference: give its size on the ground as dtm.extent_m")
    if not raster.vertical_known:
        found.append("without vertical scale: give dtm.height_range_m or dtm.height_scale")
    coarse = posting is not None and posting > COARSE_POSTING
    if posting and coarse:
        found.append(
            f"a posting of {_metres(posting)} is too coarse for a rover: the ground between the "
            "samples would be invented"
        )
    quantum = raster.quantum
    dtype = np.dtype(raster.dataset.dtypes[raster.band - 1])
    stairs = quantum is not None and (dtype.itemsize == 1 or quantum >= 0.02)
    if quantum and stairs and raster.vertical_known and not coarse:
        found.append(
            f"{8 * dtype.itemsize} bits: heights come in stairs of {_metres(quantum)}, "
            "which a wheel feels"
        )
    if raster.dataset.count > 1:
        found.append(f"{raster.dataset.count} bands: dtm.band chooses the one with the heights")
    return found


def _metres(length: float) -> str:
    if length >= 1000.0:
        return f"{length / 1000:.4g} km"
    return f"{length:.3g} m" if length >= 0.5 else f"{length * 100:.2g} cm"
