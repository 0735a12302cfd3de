"""Rasters of tiles as one raster: GDAL's virtual format."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from terrain_forge.model import Site, TileGrid, Window

from .geotiff import joined_statistics

_TYPES = {"float32": "Float32", "int32": "Int32", "uint8": "Byte"}
Parts = Sequence[tuple[Window, str, Sequence[dict[str, str]]]]
"""The cells of each tile, its raster relative to the VRT, and the statistics of its bands.

Without them in the VRT, GDAL writes them into it and beside each tile when one looks."""


def write_vrt(
    path: Path,
    parts: Parts,
    site: Site,
    grid: TileGrid,
    *,
    like: Any,
    overview: str | None = None,
) -> None:
    """Write a VRT over the rasters of tiles, each without the nodes that the next tiles have.

    Args:
        path: The file.
        parts: The tiles.
        site: Gives the place.
        grid: How the site is cut.
        like: An open raster that says of itself what the whole does.
        overview: A coarser raster of the whole, relative to the VRT.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(_lines(parts, site, grid, like, overview))


def _lines(
    parts: Parts, site: Site, grid: TileGrid, like: Any, overview: str | None
) -> Iterator[str]:
    half = 0.5 * site.spacing
    yield f'<VRTDataset rasterXSize="{grid.columns + 1}" rasterYSize="{grid.rows + 1}">\n'
    if site.crs:
        yield f"  <SRS>{escape(site.crs)}</SRS>\n"
    yield (
        f"  <GeoTransform>{site.west - half!r}, {site.spacing!r}, 0, "
        f"{half - site.south!r}, 0, {-site.spacing!r}</GeoTransform>\n  <Metadata>\n"
    )
    for key, text in like.tags().items():
        yield f'    <MDI key="{key}">{escape(text)}</MDI>\n'
    yield "  </Metadata>\n"
    for band in like.indexes:
        yield from _band(parts, grid, like, band, overview)
    yield "</VRTDataset>\n"


def _band(
    parts: Parts, grid: TileGrid, like: Any, band: int, overview: str | None
) -> Iterator[str]:
    kind, interpretation = _TYPES[like.dtypes[0]], like.colorinterp[band - 1].name.title()
    yield f'  <VRTRasterBand dataType="{kind}" band="{band}">\n    <Metadata>\n'
    sizes = [math.prod(grid.nodes(window)) for window, _, _ in parts]
    known = [statistics[band - 1] for _, _, statistics in parts]
    for key, text in joined_statistics(list(zip(sizes, known, strict=True))).items():
        yield f'      <MDI key="{key}">{text}</MDI>\n'
    yield "    </Metadata>\n"
    yield f"    <Description>{escape(like.descriptions[band - 1] or '')}</Description>\n"
    if like.nodata is not None:
        yield f"    <NoDataValue>{like.nodata:g}</NoDataValue>\n"
    if like.units[band - 1]:
        yield f"    <UnitType>{escape(like.units[band - 1])}</UnitType>\n"
    yield f"    <ColorInterp>{interpretation}</ColorInterp>\n"
    if interpretation == "Palette":
        yield from _classes(like, band)
    for window, name, _ in parts:
        yield _source(window, grid, name, kind, band)
    if overview:
        yield (
            f'    <Overview><SourceFilename relativeToVRT="1">{overview}'
            f"</SourceFilename><SourceBand>{band}</SourceBand></Overview>\n"
        )
    yield "  </VRTRasterBand>\n"


def _classes(like: Any, band: int) -> Iterator[str]:
    """Names and colours of the classes alone: a GeoTIFF's table has 256 of them."""
    tags = like.tags()
    names = [tags[key] for n in range(256) if (key := f"TERRAIN_FORGE_CLASS_{n}") in tags]
    yield "    <CategoryNames>\n"
    for name in names:
        yield f"      <Category>{escape(name)}</Category>\n"
    yield "    </CategoryNames>\n    <ColorTable>\n"
    for _, colour in sorted(like.colormap(band).items())[: len(names)]:
        told = " ".join(f'c{n}="{part}"' for n, part in enumerate(colour, 1))
        yield f"      <Entry {told}/>\n"
    yield "    </ColorTable>\n"


def _source(window: Window, grid: TileGrid, name: str, kind: str, band: int) -> str:
    columns, rows = grid.nodes(window)
    top = grid.rows + 1 - (window.row + rows)
    return (
        f'    <SimpleSource><SourceFilename relativeToVRT="1">{name}'
        f"</SourceFilename><SourceBand>{band}</SourceBand>"
        f'<SourceProperties RasterXSize="{columns}" RasterYSize="{rows}" DataType="{kind}"/>'
        f'<SrcRect xOff="0" yOff="0" xSize="{columns}" ySize="{rows}"/>'
        f'<DstRect xOff="{window.column}" yOff="{top}" xSize="{columns}" ySize="{rows}"/>'
        "</SimpleSource>\n"
    )
