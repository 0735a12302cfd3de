"""GeoTIFFs of node grids: north-up, PixelIsArea, each node at the centre of its pixel."""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import image_rows
from terrain_forge.model import Heightfield, Site

_ROWS = 256
"""Rows whose statistics are found at a time: all of them at once would want much memory."""


def write_geotiff(
    path: Path,
    grid: NDArray[np.float32] | NDArray[np.int32] | NDArray[np.uint8],
    *,
    world_ground: Heightfield,
    site: Site,
    units: str = "m",
    nodata: float | None = None,
    description: str | Sequence[str] = "",
    cloud_optimized: bool = False,
    classes: Sequence[tuple[str, tuple[float, float, float]]] = (),
    over: tuple[int, int] | None = None,
) -> None:
    """Write a value or a colour per node of the ground as a GeoTIFF in the site's local CRS.

    The image reaches half a cell beyond the outermost nodes, so that pixel centres are the nodes.
    Its tags say how world heights become heights above the body's datum.

    Args:
        path: The file.
        grid: Values, float32, int32 or uint8, shape [rows, columns] of the ground; rows run north.
            Red, green and blue have a third axis, shape [rows, columns, 3], and so have several
            values, of which each is described.
        world_ground: The lattice that the values belong to.
        site: Gives the CRS, the datum height and the levelling plane.
        units: Unit of the values; empty for none.
        nodata: The value that means "nothing here".
        description: What the band holds, in a few words; of values for several bands, each band's.
        cloud_optimized: Write blocks and overviews, of which each holds nodes of the full grid, in
            the order that readers over the network want (COG).
        classes: Name and sRGB colour, 0 to 1, of the values from 0 on, where they are classes: they
            become tags `TERRAIN_FORGE_CLASS_n` and the colour table.
        over: Rows and columns of the nodes that the image lies over, from the ground's south-west
            on, where it shows some of them alone.

    Raises:
        ValueError: if the grid has another shape than the ground.
    """
    from rasterio.enums import ColorInterp
    from rasterio.errors import NotGeoreferencedWarning
    from rasterio.io import MemoryFile
    from rasterio.transform import from_origin

    if grid.shape[:2] != world_ground.shape:
        raise ValueError(f"{path.name}: grid {grid.shape}, ground {world_ground.shape}")
    rise_east, rise_north = map(float, site.slope)
    tags = {
        "TERRAIN_FORGE_SITE": site.name,
        "TERRAIN_FORGE_BODY": site.body.name,
        "TERRAIN_FORGE_DATUM_HEIGHT_M": repr(float(site.datum_height)),
        "TERRAIN_FORGE_LEVEL_SLOPE_EAST": repr(rise_east),
        "TERRAIN_FORGE_LEVEL_SLOPE_NORTH": repr(rise_north),
        "TERRAIN_FORGE_HEIGHT_ABOVE_DATUM": (
            "z + DATUM_HEIGHT_M + LEVEL_SLOPE_EAST * x + LEVEL_SLOPE_NORTH * y"
        ),
    }
    coloured = grid.ndim == 3 and isinstance(description, str)
    tags |= {f"TERRAIN_FORGE_CLASS_{n}": name for n, (name, _) in enumerate(classes)}
    bands, step = np.atleast_3d(image_rows(grid)), world_ground.spacing
    told = [description] * bands.shape[2] if isinstance(description, str) else description
    west, south, _, north = world_ground.bounds
    size = step, step
    if over:
        north = south + (over[0] - 1) * step
        size = over[1] * step / grid.shape[1], over[0] * step / grid.shape[0]
    profile: dict[str, Any] = {
        "width": grid.shape[1],
        "height": grid.shape[0],
        "count": bands.shape[2],
        "dtype": grid.dtype,
        "crs": site.crs or None,
        "transform": from_origin(west - step / 2, north + step / 2, *size),
        "nodata": nodata,
        "compress": "deflate",
        **_layout(grid, coloured=coloured, cloud_optimized=cloud_optimized),
    }
    with warnings.catch_warnings():
        # A window whose corner is the origin, at 1 m, looks like "no transform" to rasterio.
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        # In memory first: on a full disk GDAL prints, and does not always raise.
        with MemoryFile() as memory:
            with memory.open(**profile) as file:
                # Before the values: what comes after them makes GDAL write the CRS once more.
                file.update_tags(AREA_OR_POINT="Area", **tags)
                for band, text in enumerate(told, start=1):
                    file.set_band_description(band, text)
                    file.set_band_unit(band, units)
                    file.update_tags(band, **_statistics(bands[..., band - 1], nodata))
                if coloured:
                    file.colorinterp = (ColorInterp.red, ColorInterp.green, ColorInterp.blue)
                if classes:
                    colours = [tuple(round(255 * part) for part in rgb) for _, rgb in classes]
                    file.write_colormap(1, {n: (*c, 255) for n, c in enumerate(colours)})
                file.write(np.ascontiguousarray(np.moveaxis(bands, -1, 0)))
            path.write_bytes(memory.getbuffer())


def _statistics(values: NDArray[Any], nodata: float | None) -> dict[str, str]:
    """GDAL's tags of a band's statistics, or it writes them beside the file when one looks.

    Sums go down the columns one row after the other, then exactly: alike on every processor.
    """
    known = np.isfinite(values)
    if nodata is not None:
        known &= values != nodata
    count = int(known.sum())
    if not count:
        return {}
    low, high = float(values[known].min()), float(values[known].max())
    middle = 0.5 * (low + high)
    sums: list[float] = []
    squares: list[float] = []
    for first in range(0, len(values), _ROWS):
        rows = np.s_[first : first + _ROWS]
        away = np.where(known[rows], values[rows].astype(np.float64) - middle, 0.0)
        sums += away.sum(axis=0).tolist()
        squares += (away * away).sum(axis=0).tolist()
    shift = math.fsum(sums) / count
    return {
        "STATISTICS_MINIMUM": repr(low),
        "STATISTICS_MAXIMUM": repr(high),
        "STATISTICS_MEAN": repr(middle + shift),
        "STATISTICS_STDDEV": repr(math.sqrt(max(math.fsum(squares) / count - shift**2, 0.0))),
        "STATISTICS_VALID_PERCENT": repr(100.0 * count / values.size),
    }


def band_statistics(path: Path) -> list[dict[str, str]]:
    """GDAL's tags of each band's statistics; those of a band without a value are empty."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path) as file:
            return [
                {key: told for key, told in file.tags(band).items() if key.startswith("STATIS")}
                for band in file.indexes
            ]


def joined_statistics(parts: Sequence[tuple[int, dict[str, str]]]) -> dict[str, str]:
    """GDAL's tags of the statistics of a band, of those of its parts and their pixels."""
    known = [
        (pixels, {key.rpartition("_")[2]: float(text) for key, text in tags.items()})
        for pixels, tags in parts
        if tags
    ]
    if not known:
        return {}
    counts = [pixels * one["PERCENT"] / 100.0 for pixels, one in known]
    count = math.fsum(counts)

    def mean(values: Iterable[float]) -> float:
        return math.fsum(map(operator.mul, counts, values)) / count

    middle = mean(one["MEAN"] for _, one in known)
    square = mean(one["STDDEV"] ** 2 + (one["MEAN"] - middle) ** 2 for _, one in known)
    return {
        "STATISTICS_MINIMUM": repr(min(one["MINIMUM"] for _, one in known)),
        "STATISTICS_MAXIMUM": repr(max(one["MAXIMUM"] for _, one in known)),
        "STATISTICS_MEAN": repr(middle),
        "STATISTICS_STDDEV": repr(math.sqrt(square)),
        "STATISTICS_VALID_PERCENT": repr(100.0 * count / sum(pixels for pixels, _ in parts)),
    }


def _layout(grid: NDArray[Any], *, coloured: bool, cloud_optimized: bool) -> dict[str, Any]:
    """How the file is laid out, as options of GDAL's driver."""
    if cloud_optimized:
        # Averages of ids are no ids, and averages of heights are not on the ground.
        return {"driver": "COG", "level": 1, "predictor": "YES", "overview_resampling": "nearest"}
    colours = {"photometric": "rgb", "interleave": "pixel"} if coloured else {}
    predictor = {"f": 3}.get(grid.dtype.kind, 2 if coloured else 1)
    return {"driver": "GTiff", "zlevel": 1, "predictor": predictor, **colours}
