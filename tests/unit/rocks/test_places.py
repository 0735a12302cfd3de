"""Rasters of many grids, units and states of repair: their known points lie where they are.

What a raster should hold is computed here from closed forms on the sphere, without the
transforms of the library under test.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from terrain_forge.base import DataError
from terrain_forge.dtm import RasterDtm, survey
from terrain_forge.dtm.spec import Centre
from terrain_forge.making import plan
from terrain_forge.model import MOON
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.terrain import shape_ground
from terrain_forge.writers import write_geotiff
from tests.helpers import worlds

R = 1737400.0
BUMPS = ((0.0, 0.0, 3.0), (38.0, 22.0, 2.0), (-41.0, 17.0, -2.5), (29.0, -27.0, 2.2))
"""East, north [m] and height [m] of known points of the site."""
WIDTH = 7.0
DEGREE = np.pi * R / 180.0


def mercator(lon, lat, centre):
    """East and north of a transverse Mercator on the sphere; Snyder 1987, eq. 8-1 and 8-3."""
    turn, phi = np.radians(lon - centre[0]), np.radians(lat)
    east = R * np.arctanh(np.cos(phi) * np.sin(turn))
    north = np.arctan2(np.sin(phi), np.cos(phi) * np.cos(turn)) - np.radians(centre[1])
    return east, R * (np.mod(north + np.pi, 2.0 * np.pi) - np.pi)


def unmercator(east, north, centre):
    """Longitude and latitude [degrees]; Snyder 1987, eq. 8-6 and 8-7."""
    d = north / R + np.radians(centre[1])
    lat = np.arcsin(np.sin(d) / np.cosh(east / R))
    lon = np.arctan2(np.sinh(east / R), np.cos(d))
    return centre[0] + np.degrees(lon), np.degrees(lat)


def surface(east, north):
    """Heights [m] that tell east from north and from their mirror images."""
    bumps = sum(
        h * np.exp(-((east - e) ** 2 + (north - n) ** 2) / (2.0 * WIDTH**2)) for e, n, h in BUMPS
    )
    return -1500.0 + 0.03 * east - 0.015 * north + bumps


def degrees(x, y):
    return x, y


def equirectangular(x, y, *, middle=0.0, true_lat=0.0):
    scale = DEGREE * np.cos(np.radians(true_lat))
    return middle + x / scale, y / DEGREE


def upright_mercator(x, y):
    return x / DEGREE, np.degrees(np.arctan(np.sinh(y / R)))


def cylindrical_equal_area(x, y):
    return x / DEGREE, np.degrees(np.arcsin(y / R))


def south_polar(x, y):
    """Stereographic, true at the pole; Snyder 1987, eq. 20-18."""
    away = np.hypot(x, y)
    return np.degrees(np.arctan2(x, y)), -90.0 + np.degrees(2.0 * np.arctan(away / (2.0 * R)))


def sinusoidal(x, y):
    lat = y / DEGREE
    return x / (DEGREE * np.cos(np.radians(lat))), lat


@dataclass(frozen=True)
class Case:
    """A raster: its grid, and what its numbers are."""

    crs: str
    to_lonlat: object
    at: tuple[float, float]
    """Where on the grid the site's centre lies, in the raster's coordinates."""
    step: tuple[float, float]
    """Extent of a pixel along its columns and rows, in the raster's coordinates."""
    turn_deg: float = 0.0
    asked: tuple[float, float] | None = None
    """How the recipe names the place, where not as the raster does."""
    dtype: str = "float64"
    store: object = staticmethod(lambda h: h)
    scale: float = 1.0
    offset: float = 0.0
    units: str | None = None
    spec: dict = field(default_factory=dict)
    bands: int = 1
    mask: bool = False
    tolerance: float = 0.02


M = 1.0 / DEGREE
LL = f"+proj=longlat +R={R}"
EQC = f"+proj=eqc +lat_ts=0 +lon_0=0 +R={R}"
POLE = f"+proj=stere +lat_0=-90 +lat_ts=-90 +lon_0=0 +R={R}"
SINU = f"+proj=sinu +lon_0=0 +R={R}"
NARROW = M / np.cos(np.radians(88.5))
CASES = {
    "degrees": Case(LL, degrees, (30.0, 20.0), (M, -M)),
    "degrees, pixels not square": Case(LL, degrees, (30.0, 20.0), (1.6 * M, -0.8 * M)),
    "degrees, south up": Case(LL, degrees, (30.0, 20.0), (M, M)),
    "degrees near the pole": Case(LL, degrees, (30.0, 88.5), (NARROW, -M)),
    "degrees near the pole, square in degrees": Case(LL, degrees, (30.0, 80.0), (4 * M, -M)),
    "degrees across 180°": Case(LL, degrees, (180.0, 5.0), (M, -M), asked=(-180.0, 5.0)),
    "degrees across -180°": Case(LL, degrees, (-180.0, 5.0), (M, -M), asked=(180.0, 5.0)),
    "degrees across 360°": Case(LL, degrees, (360.0, -5.0), (M, -M), asked=(0.0, -5.0)),
    "degrees 0 to 360, asked west": Case(LL, degrees, (300.0, -5.0), (M, -M), asked=(-60.0, -5.0)),
    "equirectangular at 50° north": Case(EQC, equirectangular, (2e5, 50 * DEGREE), (1.2, -0.9)),
    "equirectangular true at 40°": Case(
        f"+proj=eqc +lat_ts=40 +lon_0=0 +R={R}",
        lambda x, y: equirectangular(x, y, true_lat=40.0), (2e5, 38 * DEGREE), (1.0, -1.0),
    ),
    "equirectangular across the seam": Case(
        EQC, equirectangular, (180.0 * DEGREE, 12 * DEGREE), (1.0, -1.0), asked=(-180.0, 12.0)
    ),
    "equirectangular in kilometres across the seam": Case(
        f"+proj=eqc +lat_ts=0 +lon_0=0 +R={R} +units=km",
        lambda x, y: equirectangular(1e3 * x, 1e3 * y), (0.18 * DEGREE, 0.012 * DEGREE),
        (1e-3, -1e-3), asked=(-180.0, 12.0),
    ),
    "Mercator across the seam": Case(
        f"+proj=merc +lon_0=0 +R={R}", upright_mercator, (-180.0 * DEGREE, 0.0), (1.0, -1.0),
        asked=(180.0, 0.0),
    ),
    "cylindrical equal-area across the seam": Case(
        f"+proj=cea +lat_ts=0 +lon_0=0 +R={R}", cylindrical_equal_area, (180.0 * DEGREE, 0.0),
        (1.0, -1.0), asked=(-180.0, 0.0),
    ),
    "equirectangular around 180°": Case(
        f"+proj=eqc +lat_ts=0 +lon_0=180 +R={R}",
        lambda x, y: equirectangular(x, y, middle=180.0), (300.0, 9e4), (1.0, -1.0),
        asked=(-179.99, 9e4 / DEGREE),
    ),
    "polar": Case(POLE, south_polar, (40_000.0, -90_000.0), (1.0, -1.0)),
    "polar, turned": Case(POLE, south_polar, (40_000.0, -90_000.0), (1.1, -0.9), turn_deg=25.0),
    "at the pole": Case(POLE, south_polar, (0.0, 0.0), (1.0, -1.0), asked=(0.0, -90.0)),
    "sinusoidal": Case(SINU, sinusoidal, (9e5, 9e5), (1.0, -1.0)),
    "sinusoidal, turned": Case(SINU, sinusoidal, (9e5, 9e5), (1.0, 1.0), turn_deg=-70.0),
    "radii in int16": Case(
        EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), dtype="int16",
        store=lambda h: np.round(h / 0.05), scale=0.05, offset=R,
    ),
    "feet": Case(
        EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), units="ft", store=lambda h: h / 0.3048
    ),
    "kilometres": Case(
        EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), units="km", store=lambda h: h / 1e3
    ),
    "scale and offset": Case(
        EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), dtype="uint16",
        store=lambda h: np.round((h + 1600.0) / 0.005), scale=0.005, offset=-1600.0,
    ),
    "no data by value": Case(
        EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), spec={"nodata": -3e4}, tolerance=0.05
    ),
    "no data by range": Case(
        EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), tolerance=0.05,
        spec={"nodata_range": (-1e9, -1e4)},
    ),
    "no data by mask": Case(
        EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), mask=True, tolerance=0.05
    ),
    "second band": Case(EQC, equirectangular, (0.0, 0.0), (1.0, -1.0), spec={"band": 2}, bands=2),
}  # fmt: skip
HOLE = np.s_[118:122, 171:175]


def write_case(case, folder):
    """The raster, 240 × 260 pixels around the site, and longitude and latitude of its centre."""
    to_crs = (
        Affine.translation(*case.at)
        @ Affine.rotation(case.turn_deg)
        @ Affine.scale(*case.step)
        @ Affine.translation(-130.0, -120.0)
    )
    row, column = np.mgrid[0:240, 0:260] + 0.5
    x = to_crs.a * column + to_crs.b * row + to_crs.c
    y = to_crs.d * column + to_crs.e * row + to_crs.f
    centre = case.asked or case.to_lonlat(*case.at)
    heights = surface(*mercator(*case.to_lonlat(x, y), centre))
    values = case.store(heights)
    if "nodata" in case.spec or "nodata_range" in case.spec or case.mask:
        values[HOLE] = -3e4
    with rasterio.open(
        folder / "dtm.tif", "w", driver="GTiff", count=case.bands, dtype=case.dtype, crs=case.crs,
        height=240, width=260, transform=to_crs,
    ) as file:  # fmt: skip
        for band in range(1, case.bands + 1):
            file.write((values if band == case.bands else values * 0).astype(case.dtype), band)
        file.scales, file.offsets = (case.scale,) * case.bands, (case.offset,) * case.bands
        if case.units:
            file.units = (case.units,)
        if case.mask:
            mask = np.full((240, 260), 255, np.uint8)
            mask[HOLE] = 0
            file.write_mask(mask)
    return centre


def shift(found, east, north):
    """How far, east and north [m], heights lie from the surface, and what is left [m].

    Least squares of the heights on the surface's gradient, where it has bumps.
    """
    step = 0.01
    slope_east = (surface(east + step, north) - surface(east - step, north)) / (2 * step)
    slope_north = (surface(east, north + step) - surface(east, north - step)) / (2 * step)
    columns = np.stack([-slope_east.ravel(), -slope_north.ravel(), np.ones(east.size)], axis=1)
    off = (found - surface(east, north)).ravel()
    answer, *_ = np.linalg.lstsq(columns, off, rcond=None)
    return np.hypot(*answer[:2]), answer[2], np.sqrt(np.mean(off**2))


@pytest.mark.parametrize("name", CASES)
def test_known_points_lie_where_they_are(tmp_path, name):
    case = CASES[name]
    centre = write_case(case, tmp_path)
    spec = RasterDtm(
        source="dtm.tif", size_m=(110.0, 80.0), centre=Centre(lonlat_deg=centre), noise="keep",
        **case.spec,
    )  # fmt: skip
    site = worlds.site().replace(
        size=spec.size_m, spacing=1.0, body=MOON,
        **vars(survey(spec, body=MOON, folder=tmp_path, heights=None)),
    )  # fmt: skip
    ground = shape_ground(site=site, window=site.window, layers=())
    east, north = np.meshgrid(ground.east, ground.north)
    heights = ground.elevation + site.datum_height
    # A node is a mean over pixels, which lowers a bump by a few centimetres.
    away, above, rms = shift(heights, east, north)
    assert away < case.tolerance  # of pixels of about 1 m
    assert abs(above) < 0.01
    assert rms < 0.05
    if name != next(iter(CASES)):
        return  # what is written does not depend on where it is from
    write_geotiff(tmp_path / "out.tif", ground.elevation, world_ground=ground, site=site)
    with rasterio.open(tmp_path / "out.tif") as file:
        written, grid = file.read(1) + site.datum_height, file.transform
        assert "Transverse_Mercator" in file.crs.to_wkt()
    row, column = np.mgrid[0 : written.shape[0] : 3, 0 : written.shape[1] : 3]
    x, y = grid.a * (column + 0.5) + grid.c, grid.e * (row + 0.5) + grid.f
    back = mercator(*unmercator(x, y, centre), centre)
    assert shift(written[::3, ::3], *back)[0] < case.tolerance


def write_belt(path, west, columns):
    """Heights around the equator, 0.1° a pixel, the same ground wherever the raster begins."""
    lon, lat = np.meshgrid(west + 0.1 * (np.arange(columns) + 0.5), 2.0 - 0.1 * np.arange(40))
    turn = np.radians(lon)
    values = 500.0 * np.cos(turn) + 90.0 * np.sin(7 * turn + 0.3) + 40.0 * np.sin(60.0 * turn + lat)
    with rasterio.open(
        path, "w", driver="GTiff", count=1, dtype="float32", crs=LL, height=40,
        width=columns, transform=Affine(0.1, 0.0, west, 0.0, -0.1, 2.0),
    ) as file:  # fmt: skip
        file.write(values.astype("float32"), 1)


@pytest.mark.parametrize(("lon", "seam", "whole"), [(180.0, -180.0, 0.0), (0.3, 0.0, -180.0)])
def test_a_site_across_the_edge_of_a_global_grid_has_both(tmp_path, lon, seam, whole):
    """The ground is that of a raster which has its edges elsewhere."""
    found = []
    for west in (seam, whole):
        write_belt(tmp_path / "dtm.tif", west, 3600)
        spec = RasterDtm(
            source="dtm.tif", size_m=(60_000.0, 20_000.0), centre=Centre(lonlat_deg=(lon, 0.0))
        )
        site = worlds.site().replace(
            size=spec.size_m, spacing=1000.0, body=MOON,
            **vars(survey(spec, body=MOON, folder=tmp_path, heights=None)),
        )  # fmt: skip
        ground = shape_ground(site=site, window=site.window, layers=())
        found.append(ground.elevation + site.datum_height)
    assert np.ptp(found[0]) > 50.0
    np.testing.assert_allclose(*found, atol=2e-3)


def test_a_site_across_the_edge_of_a_grid_with_a_gap_is_told(tmp_path):
    write_belt(tmp_path / "dtm.tif", -180.0, 3590)
    spec = RasterDtm(
        source="dtm.tif", size_m=(20_000.0, 10_000.0), centre=Centre(lonlat_deg=(-180.0, 0.0))
    )
    with pytest.raises(DataError, match=r"columns -3\..* to 2\..*which has 3590 × 40"):
        survey(spec, body=MOON, folder=tmp_path, heights=None)


@pytest.mark.parametrize(
    ("lat", "message"), [(90.0, "0 m from a pole"), (-89.9999, "m from a pole"), (89.9999, "pole")]
)
def test_a_map_of_longitudes_is_refused_at_a_pole(tmp_path, lat, message):
    step = 1e-5
    top = 90.0 if lat > 0 else -90.0 + 3e-3
    with rasterio.open(
        tmp_path / "dtm.tif", "w", driver="GTiff", count=1, dtype="float32", crs=LL, height=300,
        width=3600, transform=Affine(0.1, 0.0, 0.0, 0.0, -step, top),
    ) as file:  # fmt: skip
        file.write(np.zeros((300, 3600), np.float32), 1)
    spec = RasterDtm(source="dtm.tif", size_m=(20.0, 10.0), centre=Centre(lonlat_deg=(30.0, lat)))
    with pytest.raises(DataError, match=message) as error:
        survey(spec, body=MOON, folder=tmp_path, heights=None)
    assert "polar product" in str(error.value)


def test_bent_meridians_are_refused(tmp_path):
    """300 m from the pole, nodes between anchors of 80 m would lie half a post off."""
    case = Case(LL, degrees, (30.0, 90.0 - 300.0 * M), (0.12, -5 * M))
    write_case(case, tmp_path)
    centre = Centre(lonlat_deg=(30.0, 90.0 - 300.0 * M))
    spec = RasterDtm(source="dtm.tif", size_m=(100.0, 80.0), centre=centre, noise="keep")
    recipe = Recipe(
        name="bent", body="moon", dtm=spec, terrain=TerrainSpec(spacing_m=2.5), exports=()
    )
    with pytest.raises(DataError, match=r"is bent there: at this spacing it needs 1\.6e\+03 m"):
        plan(recipe, folder=tmp_path)
    finer = TerrainSpec(spacing_m=0.5)
    assert plan(Recipe(**(vars(recipe) | {"terrain": finer})), folder=tmp_path).georeferenced
