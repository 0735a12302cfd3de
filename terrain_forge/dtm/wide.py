"""All of a DTM around a site, coarsened where it is large, on a grid of the site's metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel, over_chunks
from terrain_forge.dtm.lattice import Georeferenced, PixelFrame, anchors, bilinear, patch_pixels
from terrain_forge.dtm.projection import transform, wrap_around
from terrain_forge.dtm.raster import Raster, ground_steps
from terrain_forge.model import Bounds, Heightfield

_EVERY = 32
_STRIPE = 2**24
"""Samples that are read at a time."""
_BORDER = 33


@dataclass(frozen=True, kw_only=True, eq=False)
class WideSource:
    """A part of a raster, each sample the mean of a square of the file's."""

    heights: Array
    """Heights above the datum [m], NaN where there are none, shape [rows, columns]."""
    to_pixel: tuple[float, ...]
    """As `DtmPatch.to_pixel`."""
    crs: str
    """WKT."""
    wrap: tuple[float, float]
    """As `DtmPatch.wrap`."""


def raster_bounds(raster: Raster, crs: str, reach: float) -> Bounds:
    """West, south, east, north of a raster in a site's metres, at most so far from its centre."""
    west, south, east, north = -reach, -reach, reach, reach
    if raster.goes_round:
        return west, south, east, north
    rows, columns = raster.shape
    a, b, c, d, e, f = raster.to_pixel
    edge = np.linspace(0.0, 1.0, _BORDER)
    column = np.concatenate([edge, edge, 0.0 * edge, 0.0 * edge + 1.0]) * (columns - 1)
    row = np.concatenate([0.0 * edge, 0.0 * edge + 1.0, edge, edge]) * (rows - 1)
    det = a * e - b * d
    x = (e * (column - c) - b * (row - f)) / det
    y = (a * (row - f) - d * (column - c)) / det
    found = np.stack(transform(raster.crs, crs, x, y))
    found = np.clip(found[:, np.isfinite(found).all(axis=0)], -reach, reach)
    (west, south), (east, north) = found.min(axis=1), found.max(axis=1)
    return float(west), float(south), float(east), float(north)


def finest_step(raster: Raster, crs: str) -> float | None:
    """Distance of samples around a site's centre, along columns or rows, the shorter one [m]."""
    if (steps := ground_steps(raster)) is None:
        return None
    most = max(PixelFrame.at(_placed(raster, crs), crs, 0.25 * max(steps)).extent(1.0))
    return 1.0 / most if np.isfinite(most) and most > 0.0 else max(steps)


def _placed(raster: Raster, crs: str) -> WideSource:
    """Where a raster lies, without its samples."""
    wrap = wrap_around(raster.crs, crs, raster.middle[0])
    return WideSource(heights=np.empty((0, 0)), to_pixel=raster.to_pixel, crs=raster.crs, wrap=wrap)


def read_wide(raster: Raster, crs: str, bounds: Bounds, posting: float) -> WideSource:
    """The samples of a raster within bounds [m], coarsened towards a posting [m]."""
    source = _placed(raster, crs)
    west, south, east, north = bounds
    grid = np.meshgrid(np.linspace(west, east, _BORDER), np.linspace(south, north, _BORDER))
    spans = []
    for index, length in zip(patch_pixels(source, crs, *grid), raster.shape[::-1], strict=True):
        index = index[np.isfinite(index)]
        low, high = (float(n) for n in (index.min(), index.max()))
        spans.append((max(int(low) - 2, 0), min(int(high) + 3, length)))
    (left, right), (top, bottom) = spans
    every = max(1, int(posting / max(ground_steps(raster) or (posting,)) + 1e-6))
    heights = _coarsened(raster, (top, bottom), (left, right), every)
    a, b, c, d, e, f = raster.to_pixel
    half = 0.5 * (every - 1)
    to_pixel = (
        *(a / every, b / every, (c - left - half) / every),
        *(d / every, e / every, (f - top - half) / every),
    )
    return WideSource(heights=heights, to_pixel=to_pixel, crs=raster.crs, wrap=source.wrap)


def _coarsened(
    raster: Raster, rows: tuple[int, int], columns: tuple[int, int], every: int
) -> Array:
    """Means of the valid samples in squares; what does not fill a square at the end is left out."""
    across = (columns[1] - columns[0]) // every
    down = (rows[1] - rows[0]) // every
    found = np.full((down, across), np.nan)
    stripe = max(1, _STRIPE // max(across * every**2, 1))
    span = slice(columns[0], columns[0] + across * every)
    for begin in range(0, down, stripe):
        end = min(begin + stripe, down)
        part = slice(rows[0] + begin * every, rows[0] + end * every)
        heights, valid = raster.read(part, span, strict=False)
        shape = end - begin, every, across, every
        count = valid.reshape(shape).sum(axis=(1, 3))
        total = np.where(valid, heights, 0.0).reshape(shape).sum(axis=(1, 3))
        found[begin:end] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return found


def lay_out(
    source: Georeferenced, heights: Array, crs: str, bounds: Bounds, spacing: float
) -> Heightfield:
    """Heights [m] on a grid of a site's metres, linear between samples, NOWHERE where none are."""
    west, south, east, north = bounds
    columns = max(2, int((east - west) / spacing + 1e-6) + 1)
    rows = max(2, int((north - south) / spacing + 1e-6) + 1)
    (x, across), (y, down) = anchors(0, columns, _EVERY), anchors(0, rows, _EVERY)
    places = patch_pixels(source, crs, *np.meshgrid(west + x * spacing, south + y * spacing))
    column, row = (bilinear(values, across, down) for values in places)
    laid = np.empty((rows, columns), np.float32)
    over_chunks(_lay, rows, np.ascontiguousarray(heights), column, row, laid)
    return Heightfield(elevation=laid, spacing=spacing, origin=(west, south))


NOWHERE = np.float32(-1e9)
"""Height where a DTM has none."""


@kernel
def _lay(begin, end, heights, column, row, laid):  # type: ignore[no-untyped-def]
    high, wide = heights.shape
    for j in range(begin, end):
        for i in range(laid.shape[1]):
            x, y = column[j, i], row[j, i]
            laid[j, i] = NOWHERE
            if not (-0.5 <= x <= wide - 0.5 and -0.5 <= y <= high - 0.5):
                continue
            x, y = min(max(x, 0.0), wide - 1.0), min(max(y, 0.0), high - 1.0)
            a, b = min(int(x), wide - 2), min(int(y), high - 2)
            u, v = x - a, y - b
            value = (1.0 - v) * ((1.0 - u) * heights[b, a] + u * heights[b, a + 1])
            value += v * ((1.0 - u) * heights[b + 1, a] + u * heights[b + 1, a + 1])
            if value == value:
                laid[j, i] = value


def holes(heights: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Where a grid has no height."""
    return np.asarray(heights <= 0.5 * NOWHERE)
