"""GeoTIFFs in GDAL."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from terrain_forge.dtm import open_dataset
from terrain_forge.model import Heightfield, Opening
from terrain_forge.validation import Consumer, Reading, Sample

_RASTER = "a raster carries heights alone"


def read_geotiff(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """The elevation raster of a GeoTIFF export as GDAL has it, triangulated as the ground is."""
    import rasterio

    del scratch
    site = sample.world.site
    aspects = ("findings", "rock tops", "rock outlines", "masses", "gravity", "path", "balls")
    reasons = dict.fromkeys(aspects, _RASTER)
    consumer = f"GDAL {rasterio.__gdal_version__}"
    if "elevation" not in options.products:
        missing = dict.fromkeys(("ground", "frames"), "elevation is not among its products")
        return Reading(consumer=consumer, reasons={**reasons, **missing})
    with open_dataset(folder / "elevation.tif") as raster:
        heights = raster.read(1)[::-1].astype(np.float64)
        west, south = raster.xy(raster.height - 1, 0)
        spacing = raster.transform.a
    found = Heightfield(elevation=heights, spacing=spacing, origin=(west, south))
    if options.heights == "datum":
        east, north = site.slope
        plane = site.datum_height + east * found.east + (north * found.north)[:, None]
        found = found.replace(elevation=heights - plane)
    x, y = sample.points.T
    found_heights = np.full(len(x), np.nan)
    inside = found.covers(x, y)
    found_heights[inside] = found.height_at(x[inside], y[inside])
    return Reading(
        consumer=consumer,
        heights=found_heights,
        extent=found.bounds,
        quantum=2 * float(np.spacing(np.float32(np.abs(heights).max()))),
        reasons=reasons,
    )


def opening(folder: Path, options: Any) -> Opening:
    """How the folder is opened."""
    return Opening(title="Maps", commands=f"qgis {quote(folder.name)}/{options.products[0]}.tif")


CONSUMERS = (Consumer(name="GDAL", read=read_geotiff),)
"""What reads these exports back."""
