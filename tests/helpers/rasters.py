"""Small rasters, and the sites and words that are made of them."""

from __future__ import annotations

import numpy as np
import rasterio
from rasterio.transform import Affine

from terrain_forge.dtm import (
    RasterDtm,
    describe,
    open_raster,
    survey,
)
from terrain_forge.model import MARS
from terrain_forge.terrain import shape_ground
from tests.helpers import worlds

MOON_LL = "+proj=longlat +R=1737400"
MOON_EQC = "+proj=eqc +lat_ts=0 +lon_0=0 +R=1737400"
EQC = "+proj=eqc +lat_ts=0 +lon_0=137.4 +R=3396190"
SPEC = RasterDtm(source="dtm.tif", size_m=(100.0, 60.0), noise="keep")
"""A recipe's DTM part for the rasters of this file; most of planning would be to look for noise."""


def write_raster(folder, values, *, crs=EQC, transform=None, **profile):
    """dtm.tif; by default 1 m pixels on Mars."""
    units = profile.pop("units", None)
    scale, offset = profile.pop("scale", 1.0), profile.pop("offset", 0.0)
    with rasterio.open(
        folder / "dtm.tif", "w", driver="GTiff", count=1, dtype=values.dtype, crs=crs,
        height=values.shape[0], width=values.shape[1],
        transform=transform or Affine(1.0, 0.0, 5000.0, 0.0, -1.0, -272000.0), **profile,
    ) as file:  # fmt: skip
        file.write(values, 1)
        file.scales, file.offsets = (scale,), (offset,)
        if units:
            file.units = (units,)


def plan(folder, spec=SPEC, *, body=MARS, spacing=1.0, heights=None):
    """The site of a DTM and its ground."""
    found = survey(spec, body=body, folder=folder, heights=heights)
    site = worlds.site().replace(size=spec.size_m, spacing=spacing, body=body, **vars(found))
    return site, shape_ground(site=site, window=site.window, layers=())


def words(folder, spec=SPEC, *, body=MARS):
    """All that `check` says of a raster."""
    raster = open_raster(spec, body=body, folder=folder)
    with raster.dataset:
        found = describe(raster)
    return " ".join([*(value for _, value in found.facts), *found.warnings])


def rough(shape=(150, 200), seed=1):
    """Rough ground of some metres [m]."""
    return np.random.default_rng(seed).normal(0.0, 0.05, shape).cumsum(0).cumsum(1) / 40.0
