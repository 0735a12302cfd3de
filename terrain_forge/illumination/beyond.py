"""The land beyond a DTM: what a second, wider one tells, or what a world holds of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, reading
from terrain_forge.dtm import (
    NOWHERE,
    RasterDtm,
    far_heights,
    fill_holes,
    finest_step,
    holes,
    lay_out,
    open_raster,
    raster_bounds,
    read_wide,
)
from terrain_forge.model import Bounds, Heightfield, Site

_FADE = 12
"""Nodes over which the first fades into the second, at least; a posting of the second if more."""
_MOST = 2048
"""Nodes along a side of the second's grid, at most."""
_OVER = 8.0
"""Steps over the site's shorter side at which the two are compared."""


def go_on(
    grids: list[Heightfield], site: Site, *, dtm: str, folder: Path, reach: float
) -> list[Heightfield]:
    """The grids with a second terrain model where the first ends, and one more for all around.

    It is raised or lowered to the site's height, as for the horizon of a world. What the first has
    counts; towards its border it fades into the second, which fills its holes, bent to their rims.

    Args:
        grids: The first, the finest first, of which each lies within the next; heights above the
            body's datum [m].
        site: The site.
        dtm: The second terrain model, as the recipe writes it.
        folder: What its path is relative to.
        reach: How far from the centre is looked [m].

    Raises:
        DataError: if it cannot be read.
    """
    spec, last = RasterDtm(source=dtm, size_m=site.size), grids[-1]
    with reading(dtm, key=("horizon", "dtm")):
        raster = open_raster(spec, body=site.body, folder=folder)
        with raster.dataset:
            bounds = _around(last.bounds, raster_bounds(raster, site.crs, reach))
            posting = finest_step(raster, site.crs) or last.spacing
            step = max(posting, max(bounds[2] - bounds[0], bounds[3] - bounds[1]) / _MOST)
            found = read_wide(raster, site.crs, bounds, step)
    side = min(site.size) / _OVER
    here = lay_out(found, found.heights, site.crs, _box(site), side)
    raised = found.heights + _rise(grids[0], here)
    # At its border the first fades, but not where no farther is looked.
    ends = [abs(end) < reach - last.spacing for end in last.bounds]
    shares = last.replace(elevation=_shares(last, ends, posting))
    mixed = []
    for grid in grids:
        second = lay_out(found, raised, site.crs, grid.bounds, grid.spacing).elevation
        other = ~holes(second)
        first, own = _filled(grid.elevation, second)
        west, south, east, north = last.bounds
        x, y = np.clip(grid.east, west, east), np.clip(grid.north, south, north)
        share = np.where(other, shares.height_at(*np.meshgrid(x, y)), 1.0) * own
        both = share * np.where(own, first, 0.0) + (1.0 - share) * second
        known = np.where(own | other, both, NOWHERE)
        mixed.append(grid.replace(elevation=known.astype(np.float32)))
    if any(abs(wide) > abs(end) + step for wide, end in zip(bounds, last.bounds, strict=True)):
        mixed.append(lay_out(found, raised, site.crs, bounds, step))
    return mixed


def held(grids: list[Heightfield], site: Site, reach: float) -> list[Heightfield]:
    """The grids with those of what a world holds of the heights around it, ever coarser."""
    found = list(grids)
    for level in site.surroundings:
        half = min(level.reach, reach)
        if half <= max(map(abs, found[-1].bounds)):
            continue
        axis = np.linspace(-half, half, 2 * max(round(half / level.posting), 1) + 1)
        east, north = np.meshgrid(axis, axis)
        height, weight = far_heights(site, east.ravel(), north.ravel())
        known = np.where(weight > 0.5, height, NOWHERE).reshape(east.shape)
        spacing = float(axis[1] - axis[0])
        found.append(
            Heightfield(elevation=known.astype(np.float32), spacing=spacing, origin=(-half, -half))
        )
    return found


def near_holes(near: Heightfield, east: Array, north: Array) -> Mask:
    """Which points have a hole beside them."""
    bare = holes(near.elevation)
    i = np.clip(((east - near.origin[0]) / near.spacing).astype(int), 0, near.shape[1] - 2)
    j = np.clip(((north - near.origin[1]) / near.spacing).astype(int), 0, near.shape[0] - 2)
    return np.asarray(bare[j, i] | bare[j, i + 1] | bare[j + 1, i] | bare[j + 1, i + 1])


def _around(first: Bounds, second: Bounds) -> Bounds:
    """The smallest rectangle around two."""
    west, south, east, north = zip(first, second, strict=True)
    return min(west), min(south), max(east), max(north)


def _box(site: Site) -> Bounds:
    """The site itself."""
    east, north = 0.5 * site.size[0], 0.5 * site.size[1]
    return -east, -north, east, north


def _rise(near: Heightfield, second: Heightfield) -> float:
    """How much higher the first lies than the second over the site on average [m]."""
    east, north = (part.ravel() for part in np.meshgrid(second.east, second.north))
    there = second.elevation.ravel()
    known = near.covers(east, north) & ~holes(there)
    known[known] = ~near_holes(near, east[known], north[known])
    if not known.any():
        return 0.0
    return float((near.height_at(east[known], north[known]) - there[known]).mean())


def _filled(first: NDArray[np.float32], second: NDArray[np.float32]) -> tuple[Array, Mask]:
    """The first's heights with the second's in its holes, and where it has any."""
    known, other = ~holes(first), ~holes(second)
    inner = _without_holes(known) & ~known & other
    if not inner.any():
        return np.asarray(first, np.float64), known
    both = known & other
    rise = fill_holes(np.where(both, first - second, 0.0).astype(np.float64), both)
    return np.where(inner, second + rise, first), known | inner


def _without_holes(known: Mask) -> Mask:
    """What is known and what it lies around; what is open towards the border is none of it."""
    from scipy.ndimage import binary_fill_holes

    return np.asarray(binary_fill_holes(known), np.bool_)


def _shares(grid: Heightfield, ends: list[bool], posting: float) -> Array:
    """How far the first counts at the nodes of its last grid, 0 at its border."""
    from scipy.ndimage import distance_transform_edt

    across = min(max(_FADE, posting / grid.spacing), 0.25 * min(grid.shape))
    west, south, east, north = map(int, ends)
    known = np.pad(_without_holes(~holes(grid.elevation)), ((south, north), (west, east)))
    if known.all():
        return np.ones(grid.shape, np.float32)
    rows, columns = known.shape
    away = distance_transform_edt(known)[south : rows - north, west : columns - east]
    part = np.clip(away / across, 0.0, 1.0)
    return np.asarray(part * part * (3.0 - 2.0 * part), np.float32)
