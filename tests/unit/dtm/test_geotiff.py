"""GeoTIFFs: every node where it belongs, tags, bytes."""

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.warp import transform

from terrain_forge.writers import write_geotiff
from tests.helpers import worlds

MARS_RADIUS = 3396190.0
LONGITUDE, LATITUDE = 137.4417, -4.5895
LOCAL = CRS.from_string(
    f"+proj=tmerc +lat_0={LATITUDE} +lon_0={LONGITUDE} +R={MARS_RADIUS} +units=m +no_defs"
)


@pytest.fixture
def site():
    return worlds.site().replace(
        crs=LOCAL.to_wkt(), datum_height=-4501.25, slope=(0.011, -0.027), name="Gale, «floor»"
    )


@pytest.fixture
def surface(tmp_path, site):
    path = tmp_path / "surface.tif"
    ground = worlds.ground()
    write_geotiff(path, ground.elevation, world_ground=ground, site=site, description="ground")
    return path


def test_every_node_is_found_at_its_own_coordinates(surface):
    ground = worlds.ground()
    east, north = np.meshgrid(ground.east, ground.north)
    points = np.column_stack([east.ravel(), north.ravel()])
    with rasterio.open(surface) as file:
        assert file.shape == ground.shape
        found = np.array([value[0] for value in file.sample(points)])
        centres = [file.xy(row, column) for row, column in ((0, 0), (64, 96), (10, 3))]
    np.testing.assert_array_equal(found.reshape(ground.shape), ground.elevation)
    np.testing.assert_allclose(centres, [(-12, 8), (12, -8), (-11.25, 5.5)], rtol=0, atol=1e-9)


def test_rows_run_south_and_pixels_reach_half_a_cell_beyond_the_nodes(surface):
    with rasterio.open(surface) as file:
        assert tuple(file.bounds) == (-12.125, -8.125, 12.125, 8.125)
        assert file.transform.e == -0.25
        first = file.read(1)[0]
    np.testing.assert_array_equal(first, worlds.ground().elevation[-1])


def test_a_known_place_on_mars_lands_on_its_node(surface):
    # 10 m east and 6 m north of the origin, small enough for arc lengths on the sphere.
    longitude = LONGITUDE + np.degrees(10 / (MARS_RADIUS * np.cos(np.radians(LATITUDE))))
    latitude = LATITUDE + np.degrees(6 / MARS_RADIUS)
    with rasterio.open(surface) as file:
        sphere = CRS.from_dict({"proj": "longlat", "R": MARS_RADIUS, "no_defs": True})
        east, north = transform(sphere, file.crs, [longitude], [latitude])
        value = next(file.sample([(east[0], north[0])]))[0]
    assert (east[0], north[0]) == pytest.approx((10, 6), abs=1e-4)
    assert value == pytest.approx(worlds.hill(10.0, 6.0), abs=1e-5)


def test_tags_say_how_heights_become_those_above_the_datum(surface):
    with rasterio.open(surface) as file:
        tags = file.tags()
        assert file.crs == LOCAL
        assert (file.units, file.descriptions, file.dtypes) == (("m",), ("ground",), ("float32",))
    assert tags["AREA_OR_POINT"] == "Area"
    assert tags["TERRAIN_FORGE_SITE"] == "Gale, «floor»"
    assert float(tags["TERRAIN_FORGE_DATUM_HEIGHT_M"]) == -4501.25
    assert float(tags["TERRAIN_FORGE_LEVEL_SLOPE_EAST"]) == 0.011
    assert float(tags["TERRAIN_FORGE_LEVEL_SLOPE_NORTH"]) == -0.027


def test_integers_keep_their_nodata_and_no_crs_is_invented(tmp_path):
    ground = worlds.ground()
    ids = np.full(ground.shape, -1, np.int32)
    ids[3, 7] = 2**31 - 5
    path = tmp_path / "ids.tif"
    write_geotiff(path, ids, world_ground=ground, site=worlds.site(), units="", nodata=-1)
    with rasterio.open(path) as file:
        assert (file.crs, file.nodata, file.dtypes) == (None, -1, ("int32",))
        np.testing.assert_array_equal(file.read(1)[::-1], ids)


def test_equal_input_gives_equal_bytes(tmp_path, site):
    ground = worlds.ground()
    for name in ("one.tif", "two.tif"):
        write_geotiff(tmp_path / name, ground.elevation, world_ground=ground, site=site)
    assert (tmp_path / "one.tif").read_bytes() == (tmp_path / "two.tif").read_bytes()


def test_a_window_whose_corner_is_the_origin_is_no_special_case(tmp_path):
    land = worlds.ground().replace(spacing=1.0, origin=(0.5, -64.5))
    path = tmp_path / "corner.tif"
    write_geotiff(path, land.elevation, world_ground=land, site=worlds.site())
    with rasterio.open(path) as file:
        assert file.xy(0, 0) == (0.5, -0.5)


def test_another_shape_is_refused(tmp_path):
    ground = worlds.ground()
    with pytest.raises(ValueError, match=r"x\.tif: grid \(64, 97\), ground \(65, 97\)"):
        write_geotiff(
            tmp_path / "x.tif", ground.elevation[1:], world_ground=ground, site=worlds.site()
        )
