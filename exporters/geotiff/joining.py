"""The rasters of a site in tiles as one: a VRT of each product, with one overview of the whole."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import read_arrays, reading
from terrain_forge.dtm import open_dataset
from terrain_forge.model import BuiltTile, Heightfield, TiledSite, TileGrid
from terrain_forge.writers import write_geotiff

from .products import told_of

OVERVIEW = "overview.npz"
"""What a tile shows of the whole site's overview, rows run north."""
_PIXELS = 2048
"""Pixels of an overview along its longer side at most."""
_TYPES = {"float32": "Float32", "int32": "Int32", "uint8": "Byte"}


def overview_step(grid: TileGrid) -> int:
    """Nodes for each pixel of the overview, a power of two."""
    step = 1
    while step * _PIXELS <= max(grid.columns, grid.rows):
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
    """The site's nodes that an overview shows along one side."""
    return np.minimum(np.arange(-(-(cells + 1) // step)) * step + step // 2, cells)


def join_tiles(tiled: TiledSite, directory: Path, *, options: Any) -> tuple[str, ...]:
    """Write PRODUCT.vrt over the tiles' rasters and PRODUCT_overview.tif; returns what is lost."""
    for product in options.products:
        overview = _overview(tiled, directory, product)
        told = told_of(product, options.heights)
        step = overview_step(tiled.grid)
        size = step * tiled.site.spacing
        corner = 0.5 * (size - tiled.site.spacing)
        lattice = Heightfield(
            elevation=np.zeros(overview.shape[:2], np.float32),
            spacing=size,
            origin=(tiled.site.west + corner, tiled.site.south + corner),
        )
        path = directory / f"{product}_overview.tif"
        write_geotiff(path, overview, world_ground=lattice, site=tiled.site, **told)
        with (directory / f"{product}.vrt").open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(_vrt(tiled, product, path))
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


def _vrt(tiled: TiledSite, product: str, overview: Path) -> Iterator[str]:
    """The lines of a VRT, which says of itself what the overview does."""
    site, grid = tiled.site, tiled.grid
    half = 0.5 * site.spacing
    with open_dataset(overview) as raster:
        yield f'<VRTDataset rasterXSize="{grid.columns + 1}" rasterYSize="{grid.rows + 1}">\n'
        if site.crs:
            yield f"  <SRS>{escape(site.crs)}</SRS>\n"
        yield (
            f"  <GeoTransform>{site.west - half!r}, {site.spacing!r}, 0, "
            f"{half - site.south!r}, 0, {-site.spacing!r}</GeoTransform>\n  <Metadata>\n"
        )
        for key, text in raster.tags().items():
            yield f'    <MDI key="{key}">{escape(text)}</MDI>\n'
        yield "  </Metadata>\n"
        for band in raster.indexes:
            yield from _band(tiled, product, raster, band)
    yield "</VRTDataset>\n"


def _band(tiled: TiledSite, product: str, raster: Any, band: int) -> Iterator[str]:
    kind = _TYPES[raster.dtypes[0]]
    yield f'  <VRTRasterBand dataType="{kind}" band="{band}">\n'
    yield f"    <Description>{escape(raster.descriptions[band - 1])}</Description>\n"
    if raster.nodata is not None:
        yield f"    <NoDataValue>{raster.nodata:g}</NoDataValue>\n"
    if raster.units[band - 1]:
        yield f"    <UnitType>{escape(raster.units[band - 1])}</UnitType>\n"
    yield f"    <ColorInterp>{raster.colorinterp[band - 1].name.title()}</ColorInterp>\n"
    for tile in tiled.tiles:
        yield _source(tile, tiled.grid, product, kind, band)
    yield (
        f'    <Overview><SourceFilename relativeToVRT="1">{product}_overview.tif'
        f"</SourceFilename><SourceBand>{band}</SourceBand></Overview>\n"
    )
    yield "  </VRTRasterBand>\n"


def _source(tile: BuiltTile, grid: TileGrid, product: str, kind: str, band: int) -> str:
    window = tile.window
    columns = window.columns + (window.column + window.columns == grid.columns)
    rows = window.rows + (window.row + window.rows == grid.rows)
    top = grid.rows + 1 - (window.row + rows)
    return (
        f'    <SimpleSource><SourceFilename relativeToVRT="1">{tile.folder}/{product}.tif'
        f"</SourceFilename><SourceBand>{band}</SourceBand>"
        f'<SourceProperties RasterXSize="{columns}" RasterYSize="{rows}" DataType="{kind}"/>'
        f'<SrcRect xOff="0" yOff="0" xSize="{columns}" ySize="{rows}"/>'
        f'<DstRect xOff="{window.column}" yOff="{top}" xSize="{columns}" ySize="{rows}"/>'
        "</SimpleSource>\n"
    )
