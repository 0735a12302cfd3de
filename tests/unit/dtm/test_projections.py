"""Where a raster lies on its body: projections, their scale, the ellipsoid."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from terrain_forge.dtm import (
    ellipsoid,
    geographic_crs,
    open_raster,
    scale_error,
    site_facts,
    transform,
)
from terrain_forge.dtm.description import ground_steps
from terrain_forge.dtm.projection import datum_radius, local_crs
from terrain_forge.dtm.spec import Centre
from terrain_forge.model import MOON
from terrain_forge.writers import write_geotiff
from tests.helpers.rasters import MOON_LL, SPEC, plan, rough, words, write_raster

PROJECTIONS = {
    "degrees": (MOON_LL, 1.0 / 30323.0, (30.0, 20.0)),
    "polar": ("+proj=stere +lat_0=-90 +lat_ts=-90 +lon_0=0 +R=1737400", 1.0, (40.0, -85.0)),
    "sinusoidal": ("+proj=sinu +lon_0=0 +R=1737400", 1.0, (30.0, 40.0)),
    "equirectangular": ("+proj=eqc +lat_ts=0 +lon_0=0 +R=1737400", 1.0, (12.0, -35.0)),
    "orthographic": ("+proj=ortho +lat_0=10 +lon_0=20 +R=1737400", 1.0, (24.0, 14.0)),
}


@pytest.mark.parametrize(
    ("name", "turn"), [("degrees", 0.0), *((name, 0.5) for name in PROJECTIONS)]
)
def test_known_points_land_where_they_are(tmp_path, name, turn):
    """Peaks at known longitudes and latitudes, found again in the GeoTIFF that we write."""
    proj, step, (lon, lat) = PROJECTIONS[name]
    crs = rasterio.crs.CRS.from_proj4(proj).to_wkt()
    geographic = geographic_crs(crs)
    x0, y0 = (float(v[0]) for v in transform(geographic, crs, np.array([lon]), np.array([lat])))
    to_crs = (
        Affine.translation(x0, y0)
        @ Affine.rotation(np.degrees(turn))
        @ Affine.scale(step, -step)
        @ Affine.translation(-200.0, -200.0)
    )
    row, column = np.mgrid[0:400, 0:400] + 0.5
    x, y = (
        to_crs.a * column + to_crs.b * row + to_crs.c,
        to_crs.d * column + to_crs.e * row + to_crs.f,
    )
    local = local_crs(crs, lon, lat)
    east, north = transform(crs, local, x, y)
    peaks = [(0.0, 0.0), (40.0, 25.0), (-45.0, 30.0), (35.0, -40.0)]
    heights = sum(4.0 * np.exp(-((east - e) ** 2 + (north - n) ** 2) / 18.0) for e, n in peaks)
    write_raster(tmp_path, heights.astype("float32"), crs=crs, transform=to_crs)
    spec = replace(SPEC, size_m=(140.0, 120.0), centre=Centre(lonlat_deg=(lon, lat)))
    site, ground = plan(tmp_path, spec, body=MOON, spacing=0.5)
    write_geotiff(tmp_path / "out.tif", ground.elevation, world_ground=ground, site=site)
    with rasterio.open(tmp_path / "out.tif") as file:
        written, away = file.read(1), file.crs.to_wkt()
        for e, n in peaks:
            at_lon, at_lat = transform(local, geographic, np.array([e]), np.array([n]))
            px, py = transform(geographic, away, at_lon, at_lat)
            r, c = file.index(float(px[0]), float(py[0]))
            piece = written[r - 6 : r + 7, c - 6 : c + 7]
            top = np.unravel_index(np.argmax(piece), piece.shape)
            weight = np.maximum(piece - piece.max() + 1.0, 0.0)
            middle = (weight * np.arange(-6, 7)[:, None]).sum(), (weight * np.arange(-6, 7)).sum()
            assert np.hypot(*middle) * 0.5 / weight.sum() < 0.5 * ground_posting(tmp_path, spec)
            assert abs(top[0] - 6) <= 1
            assert abs(top[1] - 6) <= 1
    assert np.all(np.abs(ground.elevation.max() - 4.0 + site.datum_height) < 0.25)


def ground_posting(folder, spec):
    """Smaller distance of samples on the ground [m]."""
    raster = open_raster(spec, body=MOON, folder=folder)
    with raster.dataset:
        return min(ground_steps(raster))


def test_scale_error_is_that_of_the_projection():
    """Lengths in the local CRS at the edge of 40 km, against the sphere's arc."""
    crs = local_crs(rasterio.crs.CRS.from_proj4(MOON_LL).to_wkt(), 30.0, 20.0)
    error = scale_error(crs, (40_000.0, 10_000.0))
    lon, lat = transform(crs, geographic_crs(crs), np.full(2, 20_000.0), np.array([-50.0, 50.0]))
    lon, lat = np.radians(lon), np.radians(lat)
    arc = 2.0 * np.arcsin(
        np.sqrt(
            np.sin(0.5 * np.ptp(lat)) ** 2
            + np.cos(lat[0]) * np.cos(lat[1]) * np.sin(0.5 * np.ptp(lon)) ** 2
        )
    )
    assert 100.0 / (arc * 1737400.0) - 1.0 == pytest.approx(error, rel=0.02)


def test_facts_of_a_site(tmp_path):
    write_raster(tmp_path, rough((300, 400)).astype("float32"))
    site, _ = plan(tmp_path)
    facts = site_facts(site)
    assert "lengths      true throughout, to 0.1 mm in a kilometre" in facts
    assert "256 × 256 samples" in " ".join(facts)
    (told,) = (line for line in site_facts(site.replace(size=(40e3, 40e3))) if "lengths" in line)
    edge = 0.5 * (20e3 / ellipsoid(site.crs)[0]) ** 2
    found = re.fullmatch(r"lengths +true in the middle, off by (\d+) mm in a kilometre .*", told)
    assert found is not None
    assert float(found[1]) * 1e-6 == pytest.approx(edge, rel=0.5)


def test_radius_is_taken_above_the_ellipsoid_at_its_latitude():
    crs = rasterio.crs.CRS.from_proj4("+proj=longlat +a=3396190 +b=3376200").to_wkt()
    assert datum_radius(crs, 0.0) == pytest.approx(3396190.0)
    assert datum_radius(crs, 90.0) == pytest.approx(3376200.0)
    assert 3376200.0 < datum_radius(crs, 45.0) < 3396190.0


def test_radii_are_taken_above_the_ellipsoid_at_each_post(tmp_path):
    """At 73° N the ellipsoid of Mars falls by 3.3 m on each km north; level ground stays level."""
    crs = "+proj=longlat +a=3396190 +b=3376200"
    step = 10.0 / (3386e3 * np.pi / 180.0)
    rows, columns = 200, 300
    middle = 73.0
    lat = middle + step * (0.5 * rows - 0.5 - np.arange(rows))
    geographic = rasterio.crs.CRS.from_proj4(crs).to_wkt()
    radii = np.array([datum_radius(geographic, value) for value in lat])
    assert (radii[0] - radii[-1]) / (10e-3 * (rows - 1)) == pytest.approx(-3.3, abs=0.1)
    values = np.repeat(radii[:, None] - 4000.0, columns, axis=1)
    wide = step / np.cos(np.radians(middle))
    write_raster(
        tmp_path, values, crs=crs,
        transform=Affine(wide, 0.0, 20.0, 0.0, -step, middle + step * 0.5 * rows),
    )  # fmt: skip
    site, ground = plan(tmp_path, replace(SPEC, size_m=(400.0, 1000.0)), spacing=10.0)
    assert site.datum_height == pytest.approx(-4000.0, abs=1e-3)
    assert np.abs(ground.elevation).max() < 2e-3
    assert "above the ellipsoid elsewhere" in words(tmp_path)
