"""The piece of a raster that a site needs: read with its context, checked, repaired."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, Mask, portable
from terrain_forge.dtm.interpolation import FAR, STENCIL
from terrain_forge.dtm.lattice import patch_pixels, patch_points
from terrain_forge.dtm.projection import meridian_period, pole_distance, wrap_around
from terrain_forge.dtm.quality import (
    FILL_METHOD,
    destair,
    farthest_filled,
    fill_holes,
    planar_posts,
)
from terrain_forge.dtm.raster import Raster, ground_steps
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.model import DtmPatch

CONTEXT_POSTS = 256
"""Posts a side that the roughness fit gets, where the DTM has them."""
FILL_POSTS = 8
"""Width of the widest hole that is filled unless the recipe says otherwise [samples]."""

_SLACK = 0.5 + 1e-6  # samples that a site may reach beyond the outermost ones
_HALVINGS = 30
_MARGIN = FAR + STENCIL + 1  # samples that the ground at the site's edge depends on


def read_patch(
    raster: Raster, spec: RasterDtm, crs: str, to_pixel: tuple[float, ...]
) -> tuple[DtmPatch, Mask]:
    """The samples under the site with context around them, and which of them are measured.

    Raises:
        DataError: if the site reaches beyond the raster, or over holes that are too wide to fill.
    """
    whole, column, row = _located(raster, spec, crs, to_pixel)
    rows, columns = _spans(raster, column, row)
    heights, valid = raster.read(rows, columns)
    a, b, c, d, e, f = to_pixel
    patch = whole.replace(
        heights=heights,
        to_pixel=(a, b, c - columns.start, d, e, f - rows.start),
        posting=_posting(column, row, spec.size_m),
    )
    inside = np.ix_(_within(row, rows), _within(column, columns))
    notes = _require_filled(patch, valid, inside, spec, crs)
    planar = np.zeros(valid.shape, bool) if raster.quantum else planar_posts(heights) & valid
    heights = fill_holes(heights, valid)
    if raster.vertical.scale < 0.0:
        notes += (f"numbers taken as depths, by their scale of {raster.vertical.scale:g}",)
    if spec.destair:
        heights = _destaired(raster, spec, heights)
        notes += (f"stairs of {raster.quantum:.3g} m smoothed within half a step of each sample",)
    return patch.replace(
        heights=heights,
        filled=int((~valid[inside]).sum()),
        repairs=notes,
        planar_fraction=float(planar.sum() / valid.sum()),
    ), valid & ~planar


def samples_needed(
    raster: Raster, spec: RasterDtm, crs: str, to_pixel: tuple[float, ...]
) -> tuple[slice, slice]:
    """Rows and columns that `read_patch` reads; columns may lie beyond the edges of a whole body.

    Raises:
        DataError: if the site reaches beyond the raster.
    """
    return _spans(raster, *_located(raster, spec, crs, to_pixel)[1:])


def _located(
    raster: Raster, spec: RasterDtm, crs: str, to_pixel: tuple[float, ...]
) -> tuple[DtmPatch, Array, Array]:
    """The patch without its samples, and fractional columns and rows of a grid over the site."""
    _require_off_pole(raster, spec, crs)
    whole = placed(raster, crs, to_pixel)
    column, row = patch_pixels(whole, crs, *_outline(spec.size_m))
    _require_inside(raster, spec, column, row)
    return whole, column, row


def _spans(raster: Raster, column: Array, row: Array) -> tuple[slice, slice]:
    columns = _span(column, raster.shape[1], goes_round=raster.goes_round)
    return _span(row, raster.shape[0]), columns


def _require_off_pole(raster: Raster, spec: RasterDtm, crs: str) -> None:
    """Refuse a site whose samples lie around a pole where the raster has no way around it."""
    if not raster.crs or not meridian_period(raster.crs):
        return
    steps, away = ground_steps(raster), pole_distance(crs, spec.size_m)
    needed = _MARGIN * steps[1] if steps else 0.0
    if away < needed:
        raise DataError(
            f"the site lies {away:.3g} m from a pole, where {spec.name}, a map of longitudes, "
            f"needs {needed:.3g} m of ground around: take a polar product",
            key=("dtm", "centre"),
        )


def placed(raster: Raster, crs: str, to_pixel: tuple[float, ...]) -> DtmPatch:
    """A patch without samples: where those of the raster lie."""
    wrap = wrap_around(raster.crs, crs, raster.middle[0]) if raster.crs else (0.0, 0.0)
    return DtmPatch(
        heights=np.zeros((1, 1)),
        to_pixel=to_pixel,
        crs=raster.crs,
        wrap=wrap,
        posting=1.0,
        filled=0,
    )


def _outline(size: tuple[float, float]) -> tuple[Array, Array]:
    """East and north of a 9 × 9 grid over the site [m]; its outer points trace the edge."""
    steps = np.linspace(-0.5, 0.5, 9)
    east, north = np.meshgrid(steps * size[0], steps * size[1])
    return east, north


def _require_inside(raster: Raster, spec: RasterDtm, column: Array, row: Array) -> None:
    rows, columns = raster.shape
    beside = column.min() < -_SLACK or column.max() > columns - 1 + _SLACK
    above = row.min() < -_SLACK or row.max() > rows - 1 + _SLACK
    if above or (beside and not raster.goes_round):
        wide = np.ptp(column) > columns - 1 + 2 * _SLACK and not raster.goes_round
        high = np.ptp(row) > rows - 1 + 2 * _SLACK
        east, north = _largest_size(raster, spec, column, row)
        fits = f"; {east:g} × {north:g} m fit there" if min(east, north) > 0 else ""
        raise DataError(
            f"the site needs columns {column.min():.1f} to {column.max():.1f} and rows "
            f"{row.min():.1f} to {row.max():.1f} of {spec.name}, which has {columns} × {rows}"
            f"{fits}",
            key=("dtm", "size_m" if wide or high else "centre"),
        )


def _largest_size(
    raster: Raster, spec: RasterDtm, column: Array, row: Array
) -> tuple[float, float]:
    """About the largest size that fits around the site's centre [m], rounded down to 3 digits.

    A square, as far as the wanted size has room for one, then each side as long as it may be.
    """
    needed, there = [], []
    axes = [(row, raster.shape[0])] + [(column, raster.shape[1])] * (not raster.goes_round)
    for index, length in axes:
        ends = index[4, ::8], index[::8, 4]
        needed.append([np.abs(end - index[4, 4]).max() for end in ends])
        there.append(min(index[4, 4], length - 1 - index[4, 4]))
    samples, room = np.array(needed) / spec.size_m, np.array(there)

    def fits(east: float, north: float) -> bool:
        return bool((portable.product(samples, np.array([east, north])) <= room).all())

    wide, high = spec.size_m
    side = _longest(max(wide, high), lambda length: fits(min(length, wide), min(length, high)))
    north = min(side, high)
    east = max(min(side, wide), _longest(wide, lambda length: fits(length, north)))
    north = max(north, _longest(high, lambda length: fits(east, length)))
    return _rounded_down(east), _rounded_down(north)


def _longest(most: float, fits: Callable[[float], bool]) -> float:
    """The longest length up to `most` that fits, as well as halving tells."""
    low, high = 0.0, most
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return most if fits(most) else low


def _rounded_down(length: float) -> float:
    """A length with its first 3 digits."""
    step = 10.0 ** (np.floor(np.log10(max(length, 1e-9))) - 2)
    return float(np.floor(length / step) * step)


def _span(index: Array, length: int, *, goes_round: bool = False) -> slice:
    """Samples to read along one axis: under the site, the kernel's stencil, and context.

    Beyond the edges, where the axis goes round.
    """
    low = int(np.floor(index.min())) - _MARGIN
    high = int(np.ceil(index.max())) + _MARGIN + 1
    wanted = max(CONTEXT_POSTS, high - low)
    if goes_round:
        wanted = max(min(wanted, length), high - low)
    start = low - (wanted - (high - low)) // 2
    if not goes_round:
        start = max(min(start, length - wanted), 0)
        wanted = min(wanted, length - start)
    return slice(start, start + wanted)


def _within(index: Array, span: slice) -> NDArray[np.intp]:
    low = max(int(np.floor(index.min())), span.start)
    high = min(int(np.ceil(index.max())), span.stop - 1)
    return np.arange(low - span.start, high - span.start + 1)


def _posting(column: Array, row: Array, size: tuple[float, float]) -> float:
    """Metres on the ground between samples, the coarser of the two directions."""
    across = np.hypot(column[4, -1] - column[4, 0], row[4, -1] - row[4, 0])
    along = np.hypot(column[-1, 4] - column[0, 4], row[-1, 4] - row[0, 4])
    return float(max(size[0] / across, size[1] / along))


def _require_filled(
    patch: DtmPatch,
    valid: Mask,
    inside: tuple[NDArray[np.intp], ...],
    spec: RasterDtm,
    crs: str,
) -> tuple[str, ...]:
    """What is filled within the site, in words; holes that are too wide are refused."""
    if not valid.any():
        raise DataError(f"{spec.name} has no valid height here, only nodata", key=("dtm", "source"))
    if not valid[inside].any():
        raise DataError(f"{spec.name} has only nodata within the site", key=("dtm", "centre"))
    if valid[inside].all():
        return ()
    samples, row, column = farthest_filled(valid, inside)
    width = _told(samples * patch.posting)
    allowed = _told(FILL_POSTS * patch.posting) if spec.fill_holes_m is None else spec.fill_holes_m
    if width > allowed:
        east, north = patch_points(patch, crs, np.array([column]), np.array([row]))
        raise DataError(
            f"{spec.name} has a hole about {width:g} m ({samples} samples) wide around "
            f"{round(east[0])} m east, {round(north[0])} m north of the site's centre; holes of up "
            f"to {allowed:.10g} m are filled: move the site, or give dtm.fill_holes_m",
            key=("dtm", "fill_holes_m"),
        )
    filled = int((~valid[inside]).sum())
    return (f"{filled} samples in holes up to {width:g} m wide filled by {FILL_METHOD}",)


def _told(width: float) -> float:
    """A width as it is told, in 3 digits, so that what is told can be allowed."""
    return float(f"{width:.3g}")


def _destaired(raster: Raster, spec: RasterDtm, heights: Array) -> Array:
    if raster.quantum is None:
        dtype = raster.dataset.dtypes[raster.band - 1]
        raise DataError(
            f"the heights of {spec.name} are {dtype} and not rounded: they have no stairs",
            key=("dtm", "destair"),
        )
    return destair(heights, raster.quantum)
