"""The GeoTIFF export from first to last."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from terrain_forge.model import ExportReport, World
from terrain_forge.writers import write_geotiff

from .options import Options
from .products import Products


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write each product as PRODUCT.tif, on the ground's nodes and in the site's local CRS."""
    products = Products(world, above_datum=options.heights == "datum")
    largest = 0.0
    for product in options.products:
        raster = products.raster(product)
        write_geotiff(
            directory / f"{product}.tif",
            raster.grid,
            world_ground=world.ground,
            site=world.site,
            units=raster.units,
            nodata=raster.nodata,
            description=raster.description,
            cloud_optimized=options.cloud_optimized,
        )
        if raster.units == "m":
            largest = max(largest, float(np.abs(raster.grid).max()))
    files = tuple(Path(f"{product}.tif") for product in sorted(options.products))
    return ExportReport(files=files, losses=_losses(world, options, largest))


def _losses(world: World, options: Options, largest: float) -> tuple[str, ...]:
    """What rasters do not say."""
    losses = [
        "Rasters hold one height per place: overhangs, masses, and which rocks are dynamic or "
        "cannot "
        "be touched are lost; programs that interpolate between nodes otherwise than by the two "
        "triangles of a cell read other heights there."
    ]
    if options.heights == "datum":
        losses.append(
            "Heights above the datum are float32: rounded by up to "
            f"{500 * np.spacing(np.float32(largest)):.2g} mm."
        )
    if not world.site.georeferenced:
        losses.append("The site has no place on its body: the files have no CRS.")
    return tuple(losses)
