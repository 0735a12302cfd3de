"""Places on a terrain model that a world of some size may lie at, and how steep it is there."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np

from terrain_forge.base import Array, DataError, Mask, Record, portable, shaped
from terrain_forge.dtm.raster import Raster, ground_steps, open_raster
from terrain_forge.dtm.site_survey import require_meaning
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.model import Body

MOST_SAMPLES = 1024
"""Samples each way that are looked at of a terrain model."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Terrain(Record):
    """Where on a terrain model a world may lie, row by row."""

    place: Array = field(metadata=shaped("places", 2))
    """Middle of the world: x and y in the terrain model's CRS, or metres east and north of its
    middle where it has none, shape [places, 2]."""
    slope: Array = field(metadata=shaped("places"))
    """RMS slope of the terrain model over the world's area, rise over run, shape [places]."""
    georeferenced: bool
    """Whether the places are in a CRS."""


def places_of(
    spec: RasterDtm, *, body: Body, folder: Path, size: tuple[float, float], levelled: bool
) -> Terrain:
    """All places, on a grid of at most 1024 samples each way, where a world of a size fits.

    Args:
        spec: The terrain model; its `centre` is not looked at.
        body: What it is a part of.
        folder: What its path is relative to.
        size: Of the world, east and north [m].
        levelled: Whether the slope of the whole world does not count.

    Raises:
        DataError: if it cannot be read, or the world fits nowhere.
    """
    raster = open_raster(spec, body=body, folder=folder)
    with raster.dataset:
        require_meaning(raster, spec)
        heights, valid, every = _overview(raster)
        steps = ground_steps(raster)
    if steps is None:
        raise DataError(f"{spec.name} has no georeference: give dtm.extent_m", key=("dtm",))
    steps = (abs(steps[0]) * every, abs(steps[1]) * every)
    slope, inside = _windows(heights, valid, steps, size, levelled=levelled)
    row, column = np.nonzero(inside)
    if not len(row):
        raise DataError(
            f"a world of {size[0]:g} × {size[1]:g} m fits nowhere on the valid part of {spec.name}",
            key=("dtm", "size_m"),
        )
    a, b, c, d, e, f = raster.to_pixel
    (p, q), (r, s) = portable.inverse([[a, b], [d, e]])
    across, down = every * column - c, every * row - f
    return Terrain(
        place=np.stack([p * across + q * down, r * across + s * down], -1),
        slope=slope[row, column],
        georeferenced=bool(raster.crs),
    )


def _overview(raster: Raster) -> tuple[Array, Mask, int]:
    """Every so manieth height, which of them are valid, and how manieth."""
    every = -(-max(raster.shape) // MOST_SAMPLES)
    rows, columns = (-(-n // every) for n in raster.shape)
    if every == 1:
        heights, valid = raster.read(slice(0, rows), slice(0, columns), strict=False)
        return heights, valid, 1
    heights, valid = np.empty((rows, columns)), np.empty((rows, columns), np.bool_)
    for row in range(rows):
        at = slice(row * every, row * every + 1)
        line, known = raster.read(at, slice(0, raster.shape[1]), strict=False)
        heights[row], valid[row] = line[0, ::every], known[0, ::every]
    return heights, valid, every


def _windows(
    heights: Array,
    valid: Mask,
    steps: tuple[float, float],
    size: tuple[float, float],
    *,
    levelled: bool,
) -> tuple[Array, Mask]:
    """RMS slope over the window around each sample, and where the window lies on valid ones."""
    from scipy.ndimage import minimum_filter, uniform_filter

    span = [max(int(np.ceil(size[n] / steps[n])) | 1, 3) for n in (1, 0)]
    margin = [n // 2 + 2 for n in span]  # a little is needed around
    inside = np.zeros(heights.shape, np.bool_)
    if all(2 * m < n for m, n in zip(margin, heights.shape, strict=True)):
        known = minimum_filter(valid, [n + 2 for n in span])
        core = tuple(slice(m, n - m) for m, n in zip(margin, heights.shape, strict=True))
        inside[core] = known[core]
    if not inside.any():  # a filter of a huge window takes hours
        return np.zeros(heights.shape), inside
    north, east = np.gradient(heights, steps[1], steps[0])
    square = uniform_filter(north**2 + east**2, span)
    if levelled:
        square -= uniform_filter(north, span) ** 2 + uniform_filter(east, span) ** 2
    return cast(Array, np.sqrt(np.maximum(square, 0.0))), inside
