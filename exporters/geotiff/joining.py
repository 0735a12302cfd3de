"""The rasters of a site in tiles as one: a VRT of each product, with one overview of the whole."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import read_arrays, reading
from terrain_forge.dtm import open_dataset
from terrain_forge.model import Heightfield, TiledSite, TileGrid
from terrain_forge.writers import write_geotiff, write_vrt

from .products import told_of

OVERVIEW = "overview.npz"
"""What a tile shows of the whole site's overview, rows run north."""
OVERVIEW_PIXELS = 2048
"""Pixels of an overview along its longer side at most."""


def overview_step(grid: TileGrid) -> int:
    """Nodes for each pixel of the overview, a power of two."""
    step = 1
    while step * OVERVIEW_PIXELS <= max(grid.columns, grid.rows):
        step *= 2
    return step


def overview_nodes(cells: int, grid: TileGrid, *, first: int, count: int) -> NDArray[np.int64]:
    """Which of a tile's nodes along one side the overview shows: those amid its pixels.

    Args:
        cells: Cells of the site along that side.
        grid: The site's tiles.
        first: The tile's first node.
        count: Its number of nodes.
    """
    nodes = _shown(cells, overview_step(grid)) - first
    return nodes[(nodes >= 0) & (nodes < count)]


def _shown(cells: int, step: int) -> NDArray[np.int64]:
    """The site's nodes that an overview shows along one side: GDAL lays it over all of them."""
    nodes = cells + 1
    pixels = -(-nodes // step)
    return (2 * np.arange(pixels) + 1) * nodes // (2 * pixels)


def join_tiles(tiled: TiledSite, directory: Path, *, options: Any) -> tuple[str, ...]:
    """Write PRODUCT.vrt over the tiles' rasters and PRODUCT_overview.tif; returns what is lost."""
    for product in options.products:
        overview = _overview(tiled, directory, product)
        told = told_of(product, options.heights)
        nodes = tiled.grid.rows + 1, tiled.grid.columns + 1
        lattice = Heightfield(
            elevation=np.zeros(overview.shape[:2], np.float32),
            spacing=tiled.site.spacing,
            origin=(tiled.site.west, tiled.site.south),
        )
        path = directory / f"{product}_overview.tif"
        write_geotiff(path, overview, world_ground=lattice, over=nodes, site=tiled.site, **told)
        with open_dataset(path) as raster:
            name = f"{product}.tif"
            parts = [
                (tile.window, f"{tile.folder}/{name}", tile.statistics[name])
                for tile in tiled.tiles
            ]
            vrt = directory / f"{product}.vrt"
            write_vrt(vrt, parts, tiled.site, tiled.grid, like=raster, overview=path.name)
    return (
        "Each tile's raster is without the nodes of its northern and eastern border, which are "
        "the next tiles'.",
        "The overview of the whole shows single nodes, no means.",
    )


def _overview(tiled: TiledSite, directory: Path, product: str) -> NDArray[Any]:
    step, whole = overview_step(tiled.grid), None
    rows, columns = (_shown(cells, step) for cells in (tiled.grid.rows, tiled.grid.columns))
    for tile in tiled.tiles:
        row, column = (
            np.searchsorted(rows, tile.window.row),
            np.searchsorted(columns, tile.window.column),
        )
        place = directory / tile.folder / OVERVIEW
        with reading(str(place)):
            part = read_arrays(place, str(place))[product]
            if whole is None:
                whole = np.zeros((len(rows), len(columns), *part.shape[2:]), part.dtype)
            whole[row : row + part.shape[0], column : column + part.shape[1]] = part
    assert whole is not None
    return whole
