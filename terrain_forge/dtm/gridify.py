"""From the DTM's own grid to the site's: pointwise projection, then our own kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.dtm.kernel import cubic
from terrain_forge.dtm.patch import DtmPatch
from terrain_forge.dtm.projection import transform
from terrain_forge.site import Site, Window

Array = NDArray[np.float64]

ANCHOR_CELLS = 32
"""Nodes between the anchors at which the projection is computed exactly. Between them it is
linear: at 0.25 m, off by less than (8 m)²/(8 R), a hundred-thousandth of a millimetre of ground."""


def dtm_heights(*, site: Site, window: Window) -> Array:
    """Heights of the DTM above the site's datum at the window's nodes [m], shape [rows, columns].

    Levelling is applied; a flat site is zero everywhere.
    """
    east, north = site.axes(window)
    if site.dtm is None:
        return np.zeros((north.size, east.size))
    column, row = _source_positions(site, window)
    heights = cubic(site.dtm.heights, column=column, row=row)
    plane = site.slope[0] * east[None, :] + site.slope[1] * north[:, None]
    return heights - site.datum_height - plane


def patch_pixels(patch: DtmPatch, local_crs: str, east: Array, north: Array) -> tuple[Array, Array]:
    """Fractional column and row of the patch under points of the site [m]."""
    a, b, c, d, e, f = patch.to_pixel
    if patch.crs:
        x, y = transform(local_crs, patch.crs, east, north)
    else:
        x, y = east, north
    period, middle = patch.wrap
    if period:
        x = x + period * np.round((middle - x) / period)
    return a * x + b * y + c, d * x + e * y + f


def _source_positions(site: Site, window: Window) -> tuple[Array, Array]:
    """Where the window's nodes lie in the patch, linear between anchors of the lattice."""
    assert site.dtm is not None
    columns, rows = (_Anchors(n, m) for n, m in _extents(window))
    east = site.west + columns.nodes * site.spacing
    north = site.south + rows.nodes * site.spacing
    grid_east, grid_north = np.meshgrid(east, north)
    exact = patch_pixels(site.dtm, site.crs, grid_east, grid_north)
    column, row = (_between(values, columns, rows) for values in exact)
    return column, row


def _extents(window: Window) -> tuple[tuple[int, int], tuple[int, int]]:
    return (window.column, window.columns), (window.row, window.rows)


class _Anchors:
    """Anchors along one axis: their node numbers, and each node's anchor and fraction."""

    def __init__(self, first: int, cells: int) -> None:
        nodes = first + np.arange(cells + 1)
        start = first // ANCHOR_CELLS
        stop = (first + cells) // ANCHOR_CELLS + 2
        self.nodes = np.arange(start, stop) * float(ANCHOR_CELLS)
        self.index = nodes // ANCHOR_CELLS - start
        self.fraction = (nodes % ANCHOR_CELLS) / ANCHOR_CELLS


def _between(values: Array, columns: _Anchors, rows: _Anchors) -> Array:
    across = values[:, columns.index] * (1.0 - columns.fraction)
    across += values[:, columns.index + 1] * columns.fraction
    result: Array = across[rows.index] * (1.0 - rows.fraction)[:, None]
    return result + across[rows.index + 1] * rows.fraction[:, None]
