"""The land around a site as horizons need it: all of its DTM, and the body's curvature."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, DataError, Mask, OutputError, RecipeError
from terrain_forge.dtm import (
    RasterDtm,
    at_hand,
    holes,
    lay_out,
    open_raster,
    raster_bounds,
    read_wide,
)
from terrain_forge.illumination.beyond import go_on, held, near_holes
from terrain_forge.illumination.horizon import Relief
from terrain_forge.model import Heightfield, Site
from terrain_forge.recipe import machine_memory

Bounds = tuple[float, float, float, float]
"""West, south, east, north [m]."""
_CLOSE = (64, 0.25), (512, 1.0)
"""Posts around the map, and the step of their grid in postings: a DTM's samples lie between the
nodes of a grid that runs east and north, which are finer where that hides what is close."""
_MOST_NEAR, _MOST_FAR = 3072, 2048
"""The most nodes that a grid has along a side, near the map and beyond."""
_LEAST = 16
"""Nodes along a side of a map, at least, where its spacing is not given."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where all of a DTM is."""

    dtm: RasterDtm
    """The recipe's."""
    folder: Path
    """What its paths are relative to."""
    beyond: str | None = None
    """The second DTM that goes on where that one ends, as the recipe's `horizon` names it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Land:
    """The points of a map and what stands around them."""

    grid: Heightfield
    """The map's nodes with their heights above the body's datum [m]."""
    points: Array
    """The nodes: east, north, height above the plane through the site's centre [m], shape
    [nodes, 3]."""
    reliefs: tuple[Relief, ...]
    """What hides the Sun, the nearest and finest first."""
    missing: Mask
    """Nodes where the DTM has no height, shape [rows, columns]."""
    told: str
    """How far and how finely was looked, in words."""


def find_land(
    site: Site,
    *,
    source: Source | None,
    size: tuple[float, float] | None,
    spacing: float | None,
    reach: float,
    height: float,
    bytes_each: float = 0.0,
) -> Land:
    """The land of a site.

    Args:
        site: Where.
        source: The recipe's DTM, to be read as far as it goes; None for what the site holds.
        size: East and north extent of the map [m]; the site's by default.
        spacing: Of the map's nodes [m]; the DTM's posting by default.
        reach: How far from the centre is looked [m].
        height: Of the Sun's observers above the ground [m].
        bytes_each: Memory that a node will take [bytes].

    Raises:
        RecipeError, DataError: where no DTM tells heights, or not for the whole map.
        OutputError: for a map that does not fit into memory, or of less than a cell.
    """
    size = size or site.size
    if site.dtm is None:
        raise RecipeError("a flat site has no relief that could hide the Sun", key=("dtm",))
    posting = site.dtm.posting
    spacing = spacing or min(posting, min(size) / _LEAST)
    if spacing > min(size):
        raise OutputError(f"spacing {spacing:g} m: a side of the map is {min(size):g} m")
    reach = max(reach, 0.5 * max(size))
    _require_within(size, _extent(site, source, reach))
    _require_memory(size, spacing, bytes_each)
    nodes = _map(size, spacing)
    grids = _grids(site, source, size, posting, reach)
    own = grids[0]  # where the site's own DTM has no height nothing is told
    if source is None:
        grids = held(grids, site, reach)
    elif source.beyond is not None:
        grids = go_on(grids, site, dtm=source.beyond, folder=source.folder, reach=reach)
    radius = site.body.mean_radius
    east, north = np.meshgrid(nodes.east, nodes.north)
    near = grids[0]
    if not near.covers(east, north).all():
        raise _beyond(size, near.bounds)
    missing = near_holes(own, east, north)
    if missing.all():
        raise DataError("the DTM has no height anywhere on the map", key=("dtm",))
    heights = np.where(missing, 0.0, near.height_at(east, north))
    level = heights - (east**2 + north**2) / (2.0 * radius) + height
    reliefs = tuple(Relief.of(_curved(grid, radius)) for grid in grids)
    reaches = max(max(map(abs, grid.bounds)) for grid in grids)
    told = f"{reaches / 1e3:.3g} km around, at " + ", then ".join(
        f"{grid.spacing:.3g} m" for grid in grids
    )
    return Land(
        grid=nodes.replace(elevation=heights.astype(np.float32)),
        points=np.stack([east.ravel(), north.ravel(), level.ravel()], axis=-1),
        reliefs=reliefs,
        missing=missing,
        told=told,
    )


def _require_within(size: tuple[float, float], bounds: Bounds) -> None:
    """Refuse a map that is larger than the land."""
    if any(0.5 * side > abs(end) for side, end in zip(2 * size, bounds, strict=True)):
        raise _beyond(size, bounds)


def _beyond(size: tuple[float, float], bounds: Bounds) -> DataError:
    west, south, east, north = bounds
    return DataError(
        f"a map of {size[0]:g} × {size[1]:g} m reaches beyond the DTM, which lies "
        f"{-west:.0f} m west, {east:.0f} m east, {-south:.0f} m south and {north:.0f} m north "
        "of the centre",
        key=("dtm",),
    )


def _require_memory(size: tuple[float, float], spacing: float, bytes_each: float) -> None:
    """Refuse a map whose nodes do not fit into this machine's memory."""
    columns, rows = _nodes(size, spacing)
    needed, there = columns * rows * bytes_each, machine_memory()
    if needed > there:
        raise OutputError(
            f"a map of {columns:,} × {rows:,} points needs about {needed / 1e9:,.3g} GB of memory, "
            f"this machine has {there / 1e9:.3g} GB: choose a smaller one, a larger spacing or "
            "fewer azimuths"
        )


def _nodes(size: tuple[float, float], spacing: float) -> tuple[int, int]:
    """Columns and rows of a map."""
    columns, rows = (max(2, round(side / spacing) + 1) for side in size)
    return columns, rows


def _map(size: tuple[float, float], spacing: float) -> Heightfield:
    """Level nodes over an area around the centre."""
    columns, rows = _nodes(size, spacing)
    origin = -0.5 * (columns - 1) * spacing, -0.5 * (rows - 1) * spacing
    level = np.zeros((rows, columns), np.float32)
    return Heightfield(elevation=level, spacing=spacing, origin=origin)


def _extent(site: Site, source: Source | None, reach: float) -> Bounds:
    """How far the DTM goes around the centre [m]."""
    if source is None:
        return _patch_bounds(site)
    spec = at_hand(source.dtm, body=site.body)
    raster = open_raster(spec, body=site.body, folder=source.folder)
    with raster.dataset:
        return raster_bounds(raster, site.crs, reach)


def _grids(
    site: Site, source: Source | None, size: tuple[float, float], posting: float, reach: float
) -> list[Heightfield]:
    """The DTM as grids, the finest first, of which each lies within the next."""
    assert site.dtm is not None
    if source is None:
        bounds, step = _patch_bounds(site), _CLOSE[0][1] * posting
        step = max(step, _longer(bounds) / _MOST_NEAR)
        return [lay_out(site.dtm, site.dtm.heights, site.crs, bounds, step)]
    spec = at_hand(source.dtm, body=site.body)
    raster = open_raster(spec, body=site.body, folder=source.folder)
    with raster.dataset:
        whole = raster_bounds(raster, site.crs, reach)
        wholes: list[tuple[Bounds, float]] = []
        for posts, part in _CLOSE:
            box = _within(whole, *(0.5 * side + posts * posting for side in size))
            step = max(part * posting, _longer(box) / _MOST_NEAR)
            if not wholes or (box != wholes[-1][0] and step > wholes[-1][1]):
                wholes.append((box, step))
        box, fine = wholes[-1]
        if whole != box:
            wholes.append((whole, max(fine, _longer(whole) / _MOST_FAR)))
        grids = []
        for bounds, step in wholes:
            found = read_wide(raster, site.crs, bounds, step)
            grids.append(lay_out(found, found.heights, site.crs, bounds, step))
    return grids


def _longer(bounds: Bounds) -> float:
    """The longer side of a rectangle [m]."""
    west, south, east, north = bounds
    return max(east - west, north - south)


def _within(bounds: Bounds, wide: float, high: float) -> Bounds:
    """What of a rectangle lies so far around the centre at most [m]."""
    west, south, east, north = bounds
    return max(west, -wide), max(south, -high), min(east, wide), min(north, high)


def _patch_bounds(site: Site) -> Bounds:
    """A rectangle around the centre within the patch of the DTM that a site holds."""
    from terrain_forge.dtm import PixelFrame, patch_pixels

    assert site.dtm is not None
    rows, columns = site.dtm.heights.shape
    column, row = (float(n[0]) for n in patch_pixels(site.dtm, site.crs, np.zeros(1), np.zeros(1)))
    free = min(column, row, columns - 1 - column, rows - 1 - row)
    turn = PixelFrame.of(site).extent(1.0)
    half = free / max(turn) / np.sqrt(2.0)
    east, north = max(half, 0.5 * site.size[0]), max(half, 0.5 * site.size[1])
    return -east, -north, east, north


def _curved(grid: Heightfield, radius: float) -> Heightfield:
    """Heights above the plane through the centre."""
    drop = (grid.east[None, :] ** 2 + grid.north[:, None] ** 2) / (2.0 * radius)
    z = np.where(holes(grid.elevation), grid.elevation, grid.elevation - drop)
    return grid.replace(elevation=z.astype(np.float32))
