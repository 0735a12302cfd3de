"""Map projections: the site's local CRS, and pointwise transforms between it and the source's."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Array, DataError, portable

_LABELLED = "PDS", "VICAR", "ISIS2"
_WESTWARD = re.compile(rb"POSITIVE_LONGITUDE_DIRECTION\s*=\s*[\"']?WEST", re.IGNORECASE)
_LABEL = 2**18
"""Bytes of a file within which its label is looked for."""
_CYLINDRICAL = "eqc", "merc", "webmerc", "cea", "mill", "gall"
"""PROJ's projections in which meridians are evenly spaced lines of equal x."""


def transform(source: str, target: str, x: Array, y: Array) -> tuple[Array, Array]:
    """Coordinates in the CRS `target` (WKT) of points in the CRS `source`, of any shape."""
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    points = x.ravel().tolist(), y.ravel().tolist()
    few = x.size <= _FEW
    out = _warp_few(source, target, *map(tuple, points)) if few else _warp(source, target, *points)
    return np.reshape(out[0], x.shape), np.reshape(out[1], x.shape)


def _warp(
    source: str, target: str, x: Sequence[float], y: Sequence[float]
) -> tuple[list[float], list[float]]:
    from rasterio.crs import CRS
    from rasterio.warp import transform as warp

    east, north = warp(CRS.from_wkt(source), CRS.from_wkt(target), x, y)
    return east, north


_FEW = 300
_warp_few = lru_cache(maxsize=256)(_warp)
"""Corners and coarse lattices of a site are asked for again and again, in milliseconds a time."""


def ellipsoid(crs: str) -> tuple[float, float]:
    """Semi-major and semi-minor axis [m] of a CRS's body.

    Raises:
        DataError: if the CRS names none.
    """
    match = re.search(r'(?:SPHEROID|ELLIPSOID)\["[^"]*",\s*([\d.eE+]+),\s*([\d.eE+]+)', crs)
    if match is None:
        raise DataError(
            f"the coordinates of the raster lie on no body ({crs[:40]}…): give it a CRS of the "
            "body, or none and its size on the ground as dtm.extent_m",
            key=("dtm", "source"),
        )
    major, inverse_flattening = float(match[1]), float(match[2])
    return major, major * (1.0 - 1.0 / inverse_flattening) if inverse_flattening else major


def datum_radius(crs: str, lat_deg: float = 0.0) -> float:
    """Distance of the CRS's ellipsoid from its centre at a (geodetic) latitude [m]."""
    return float(datum_radii(crs, np.array([lat_deg]))[0])


def datum_radii(crs: str, lat_deg: Array) -> Array:
    """The same at many latitudes [degrees]."""
    major, minor = ellipsoid(crs)
    rise = portable.tan(np.radians(lat_deg)) ** 2
    above, below = major**4 + minor**4 * rise, major**2 + minor**2 * rise
    return np.asarray(np.sqrt(above / below))


def scale_error(crs: str, size: tuple[float, float]) -> float:
    """How far off a length of 1 m is at the edge of a site in its local CRS, as a fraction.

    The scale of a transverse Mercator grows by half the square of east over the radius.
    """
    return 0.5 * (0.5 * size[0] / ellipsoid(crs)[0]) ** 2


def crs_of(dataset: Any) -> str:
    """WKT of a georeferenced rasterio dataset's CRS, whose longitudes count eastward.

    Labels of PDS3, VICAR and ISIS 2 may count them westward; GDAL takes their central meridian as
    it is.
    """
    from rasterio.crs import CRS

    if dataset.driver in _LABELLED:
        with Path(dataset.name).open("rb") as file:
            westward = _WESTWARD.search(file.read(_LABEL))
        if westward:
            values = dataset.crs.to_dict()
            return str(CRS.from_dict({**values, "lon_0": -values.get("lon_0", 0.0)}).to_wkt())
    return str(dataset.crs.to_wkt())


def meridian_period(crs: str) -> float:
    """How far apart, in x, a CRS repeats a meridian; 0 where x does not repeat."""
    from rasterio.crs import CRS

    parsed = CRS.from_wkt(crs)
    if parsed.is_geographic:
        return 360.0
    if parsed.to_dict().get("proj") not in _CYLINDRICAL:
        return 0.0
    x, _ = transform(geographic_crs(crs), crs, np.array([-120.0, 0.0, 120.0]), np.zeros(3))
    thirds = np.abs(x - np.roll(x, 1))  # but for one across the seam, where there is one
    return 3.0 * float(np.median(thirds))


def wrap_around(crs: str, local: str, middle: float) -> tuple[float, float]:
    """Period of x in a CRS, and the x of a site's centre that is nearest to `middle`.

    Coordinates of the site that are brought within half a period of it have no seam in them, even
    where the CRS has one there.

    Args:
        crs: the source's.
        local: the site's, centred on it.
        middle: x of the source's middle.
    """
    period = meridian_period(crs)
    if not period:
        return 0.0, 0.0
    x = float(transform(local, crs, np.zeros(1), np.zeros(1))[0][0])
    return period, x + period * round((middle - x) / period)


def pole_distance(local: str, size: tuple[float, float]) -> float:
    """Distance of a site from the nearer pole [m]; 0 if it holds it.

    Args:
        local: WKT of the site's CRS.
        size: its extent east and north [m].
    """
    lat = np.array([-90.0, 90.0])
    east, north = transform(geographic_crs(local), local, np.zeros(2), lat)
    beyond = np.abs([east, north]) - 0.5 * np.array(size)[:, None]
    return float(np.hypot(*np.maximum(beyond, 0.0)).min())


def geographic_crs(crs: str) -> str:
    """WKT of longitude and latitude in degrees on the same ellipsoid as `crs`."""
    major, minor = ellipsoid(crs)
    return _wkt(f"+proj=longlat +a={major!r} +b={minor!r} +no_defs")


def local_crs(crs: str, lon_deg: float, lat_deg: float) -> str:
    """WKT of the transverse Mercator centred on a point, on the same ellipsoid as `crs`.

    True to scale at the centre; 5 km away lengths are off by less than 2 parts in a million.
    """
    major, minor = ellipsoid(crs)
    return _wkt(
        f"+proj=tmerc +lat_0={float(lat_deg)!r} +lon_0={float(lon_deg)!r} +k=1 +x_0=0 +y_0=0 "
        f"+a={major!r} +b={minor!r} +units=m +no_defs"
    )


def body_crs(radius: float) -> str:
    """WKT of longitude and latitude in degrees on a sphere of that radius [m]."""
    return _wkt(f"+proj=longlat +a={float(radius)!r} +b={float(radius)!r} +no_defs")


@cache
def _wkt(proj: str) -> str:
    from rasterio.crs import CRS

    wkt: str = CRS.from_proj4(proj).to_wkt()
    return wkt


@cache
def put_units_at_hand() -> None:
    """Put PROJ's data into the environment: libgeotiff seeks units there, and complains aloud.

    So is what lets GDAL tell of a PNG that is cut off.

    Once: a thread that reads the environment while another changes it may crash. Programs that we
    start are not told of it, since `os.environ` is left as it is.
    """
    from rasterio.env import PROJDataFinder

    place = None if "PROJ_DATA" in os.environ else PROJDataFinder().search()
    if place:
        os.putenv("PROJ_DATA", str(place))
    # Else of a PNG of 8 bits that is cut off GDAL returns what memory held, and tells of no error.
    os.putenv("GDAL_PNG_WHOLE_IMAGE_OPTIM", "NO")
