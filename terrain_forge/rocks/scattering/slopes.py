"""Slope limits: how steep the ground is where rocks may lie."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Heightfield, Site, Window
from terrain_forge.rocks.scattering.cells import Rectangle
from terrain_forge.rocks.scattering.intensity import Intensity
from terrain_forge.terrain import shape_ground


def with_slopes(
    intensity: Intensity, *, site: Site, area: Rectangle, ground: Heightfield | None
) -> Intensity:
    """The same with the ground's slope over an area [m].

    What counts is the strictest measure: the rise per metre of a triangle of the surface is its
    own, or that of its cell's steepest node by central differences (over two cells; one-sided at
    the site's border) where that is more.

    Args:
        intensity: The weights.
        site: The site, whose layers shape the ground where it is not given.
        area: Where slopes are needed.
        ground: Ground that is known already; used where it holds the area and a node around.
    """
    if not intensity.limits_slope:
        return intensity
    inside = _window(site, area)
    around = site.padded(inside, site.spacing)
    land = _cut(ground, site, around) or shape_ground(
        site=site, window=around, layers=site.recipe.terrain.layers
    )
    elevation = land.elevation.astype(np.float64)
    north, east = (np.gradient(elevation, site.spacing, axis=axis) for axis in (0, 1))
    row, column = inside.row - around.row, inside.column - around.column
    nodes = np.s_[row : row + inside.rows + 1, column : column + inside.columns + 1]
    of_cells = _largest_corner(np.hypot(east[nodes], north[nodes]))
    of_triangles = _rise_of_triangles(elevation[nodes], site.spacing)
    return intensity._replace(
        steepness=np.maximum(of_triangles, of_cells[:, :, None]),
        steepness_window=np.array([inside.column, inside.row]),
    )


def flat_area(intensity: Intensity, population: int, window: Window) -> float:
    """Area [m²] of a window's ground that is not too steep for a population, by its triangles."""
    column, row = np.array([window.column, window.row]) - intensity.steepness_window
    cells = intensity.steepness[row : row + window.rows, column : column + window.columns]
    flat = np.count_nonzero(cells <= intensity.steepest[population])
    return 0.5 * intensity.spacing**2 * float(flat)


def _largest_corner(values: Array) -> Array:
    """Largest of the values at each cell's four nodes, shape [rows, columns]."""
    pairs = np.maximum(values[1:], values[:-1])
    return np.maximum(pairs[:, 1:], pairs[:, :-1])


def _rise_of_triangles(elevation: Array, spacing: float) -> Array:
    """Rise per metre of the surface's triangles, as `Intensity.steepness` has them."""
    east, north = np.diff(elevation, axis=1) / spacing, np.diff(elevation, axis=0) / spacing
    southern = np.hypot(east[:-1], north[:, 1:])
    northern = np.hypot(east[1:], north[:, :-1])
    return np.stack([southern, northern], axis=-1)


def _window(site: Site, area: Rectangle) -> Window:
    """The smallest window that holds an area, as far as the site goes."""
    whole = site.window
    west, south, east, north = np.subtract(area, (site.west, site.south) * 2) / site.spacing
    first = np.floor([west, south]).astype(int)
    last = np.ceil([east, north]).astype(int)
    column, row = np.clip(first, 0, (whole.columns - 1, whole.rows - 1)).tolist()
    right, top = np.clip(last, (column + 1, row + 1), (whole.columns, whole.rows)).tolist()
    return Window(column=column, row=row, columns=right - column, rows=top - row)


def _cut(ground: Heightfield | None, site: Site, window: Window) -> Heightfield | None:
    """A window's part of the ground, where it holds the window."""
    if ground is None:
        return None
    column = window.column - round((ground.origin[0] - site.west) / site.spacing)
    row = window.row - round((ground.origin[1] - site.south) / site.spacing)
    rows, columns = ground.shape
    if min(column, row) < 0 or column + window.columns >= columns or row + window.rows >= rows:
        return None
    return ground.cut(column=column, row=row, columns=window.columns, rows=window.rows)
