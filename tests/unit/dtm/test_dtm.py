"""From a raster to the site's grid: place, orientation, heights, errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from terrain_forge.base import DataError, RecipeError
from terrain_forge.dtm import (
    ArrayDtm,
    FlatDtm,
    RasterDtm,
    cubic,
    describe,
    open_raster,
    survey,
    transform,
)
from terrain_forge.dtm.roughness import fit_roughness
from terrain_forge.dtm.spec import Centre
from terrain_forge.model import MARS, MOON, Site
from terrain_forge.terrain import shape_ground
from tests.helpers import worlds
from tests.helpers.places import DATA
from tests.helpers.rasters import EQC, plan

JEZERO = DATA / "mars" / "jezero_hirise_3p69m_1024.tif"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the real DTMs are not at hand")

POLAR = "+proj=stere +lat_0=90 +lat_ts=90 +lon_0=0 +R=3376200"


def from_origin(west, north, width, height):
    return Affine(width, 0.0, west, 0.0, -height, north)


def at(transform, column, row):
    """Coordinates of a corner-registered column and row."""
    return (
        transform.a * column + transform.b * row + transform.c,
        transform.d * column + transform.e * row + transform.f,
    )


def surface(x, y):
    """Heights [m] that tell east from north and from their mirror images."""
    return 0.03 * x - 0.011 * y + 4.0 * np.exp(-((x - 60) ** 2 + (y + 25) ** 2) / 900)


def write_raster(path, *, crs=EQC, transform=None, dtype="float32", shape=(300, 400), change=None):
    transform = transform or from_origin(5000.0, -272000.0, 1.0, 1.0)
    rows, columns = np.mgrid[0 : shape[0], 0 : shape[1]] + 0.5
    x, y = at(transform, columns, rows)
    middle_x, middle_y = at(transform, shape[1] / 2, shape[0] / 2)
    heights = surface(x - middle_x, y - middle_y)
    if change is not None:
        heights = change(heights)
    with rasterio.open(
        path, "w", driver="GTiff", width=shape[1], height=shape[0], count=1, dtype=dtype,
        crs=crs, transform=transform, nodata=-9999.0 if dtype == "float32" else None,
    ) as file:  # fmt: skip
        file.write(heights.astype(dtype), 1)
    return path


SPEC = RasterDtm(source="dtm.tif", size_m=(120.0, 80.0), noise="keep")
"""Most of planning would be to look for noise."""


def look(spec, folder, *, body=MARS, spacing=0.5, heights=None):
    """The site of a survey, and its ground."""
    return plan(folder, spec, body=body, spacing=spacing, heights=heights)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize(
    "transform_",
    [
        from_origin(5000.0, -272000.0, 1.0, 1.0),
        Affine(1.0, 0.0, 5000.0, 0.0, 1.0, -272300.0),  # south-up
        Affine(0.0, 1.0, 5000.0, 1.0, 0.0, -272400.0),  # rows run east
        Affine(1.0, 0.0, 5000.0, 0.0, -1.25, -272000.0),  # pixels that are not square
    ],
)
def test_ground_lies_where_the_raster_does(tmp_path, transform_):
    write_raster(tmp_path / "dtm.tif", transform=transform_)
    site, ground = look(SPEC, tmp_path)
    east, north = np.meshgrid(ground.east, ground.north)
    x, y = transform(site.crs, rasterio.crs.CRS.from_proj4(EQC).to_wkt(), east, north)
    middle = at(transform_, 200.0, 150.0)
    truth = surface(x - middle[0], y - middle[1]) - site.datum_height
    assert np.abs(ground.elevation - truth).max() < 2e-3
    assert abs(float(ground.height_at(0.0, 0.0))) < 1e-4  # a node is the mean of its cell


def test_site_metres_are_true(tmp_path):
    """An equirectangular map with its true parallel at the equator stretches east at 60° N by
    two."""
    write_raster(tmp_path / "dtm.tif", transform=from_origin(0.0, 3556500.0, 1.0, 1.0))
    site, _ = look(SPEC, tmp_path)
    lon, lat = np.degrees(site.lonlat)
    assert lat == pytest.approx(60.0, abs=0.01)
    ends = transform(
        site.crs, rasterio.crs.CRS.from_proj4(EQC).to_wkt(), np.array([-40, 40.0]), np.zeros(2)
    )
    assert np.ptp(ends[0]) == pytest.approx(160.0, rel=1e-3)
    assert lon == pytest.approx(137.4 + np.degrees(200 / 3396190), abs=1e-6)


def test_kilometres_are_read_without_a_word(tmp_path, capfd):
    where = from_origin(5.0, -272.0, 1e-3, 1e-3)
    write_raster(tmp_path / "dtm.tif", crs=f"{EQC} +units=km", transform=where)
    capfd.readouterr()
    site, ground = look(SPEC, tmp_path)
    assert capfd.readouterr().err == ""
    assert site.dtm.posting == pytest.approx(1.0, rel=1e-3)
    assert ground.spacing == 0.5


def test_north_is_true_on_a_polar_grid(tmp_path):
    write_raster(tmp_path / "dtm.tif", crs=POLAR, transform=from_origin(-200.0, 90150.0, 1.0, 1.0))
    site, _ = look(replace(SPEC, size_m=(60.0, 60.0)), tmp_path)
    geographic = rasterio.crs.CRS.from_proj4("+proj=longlat +R=3376200").to_wkt()
    lon, lat = transform(site.crs, geographic, np.zeros(2), np.array([0.0, 25.0]))
    assert lat[1] > lat[0]
    assert lon[1] == pytest.approx(lon[0], abs=1e-6)


@pytest.mark.parametrize(("west", "asked"), [(199.99, -160.0), (199.99, 200.0), (-160.01, 200.0)])
def test_longitudes_count_either_way(tmp_path, west, asked):
    step = 1.0 / 59274.7  # about a metre
    write_raster(
        tmp_path / "dtm.tif",
        crs="+proj=longlat +R=3396190",
        transform=from_origin(west, -29.99, step * 4, step * 4),
    )
    spec = replace(SPEC, size_m=(60.0, 60.0), centre=Centre(lonlat_deg=(asked, -30.0)))
    site, _ = look(spec, tmp_path)
    assert np.degrees(site.lonlat[1]) == pytest.approx(-30.0)


def test_levelling_takes_the_plane_away(tmp_path):
    write_raster(tmp_path / "dtm.tif")
    site, ground = look(replace(SPEC, level="plane"), tmp_path)
    z, east, north = ground.elevation.astype(float), ground.east, ground.north
    assert abs(np.mean(z * east[None, :])) / np.mean(east**2) < 1e-4
    assert abs(np.mean(z * north[:, None])) / np.mean(north**2) < 1e-4
    assert site.slope[0] != 0.0


def test_holes_are_filled_and_counted(tmp_path):
    def punch(heights):
        heights[140:146, 195:201] = -9999.0
        heights[0, 0] = np.nan
        return heights

    write_raster(tmp_path / "dtm.tif", change=punch)
    site, ground = look(SPEC, tmp_path)
    assert site.dtm.filled == 36
    assert np.abs(np.diff(ground.elevation.astype(float), axis=0)).max() < 1.0


def test_stored_integers_become_metres(tmp_path):
    write_raster(tmp_path / "dtm.tif", dtype="uint16", change=lambda h: 30000 + 1000 * h)
    with pytest.raises(DataError, match="vertical scale"):
        look(SPEC, tmp_path)
    _, ground = look(replace(SPEC, height_scale=1e-3), tmp_path)
    with rasterio.open(tmp_path / "dtm.tif", "r+") as file:
        file.scales, file.offsets = (1e-3,), (-12.0,)
    site, declared = look(SPEC, tmp_path)
    assert np.allclose(ground.elevation, declared.elevation, atol=1e-5)
    assert site.datum_height == pytest.approx(18.0 + surface(0, 0), abs=2e-3)


def test_height_map_without_georeference(tmp_path):
    rows, columns = np.mgrid[0:129, 0:257]
    north, east = 64 - rows, columns - 128.0
    values = np.round(120 + 0.5 * east - 0.25 * north).clip(0, 255).astype(np.uint8)
    from PIL import Image

    Image.fromarray(values).save(tmp_path / "map.png")
    spec = RasterDtm(
        source="map.png", size_m=(100.0, 60.0), extent_m=(256.0, 128.0), pixel_is="point",
        height_range_m=(0.0, 25.5), centre=Centre(offset_m=(20.0, -10.0)), noise="keep",
    )  # fmt: skip
    site, ground = look(spec, tmp_path)
    assert not site.georeferenced
    assert site.dtm.posting == pytest.approx(1.0)
    assert site.datum_height == pytest.approx(0.1 * (120 + 10 + 2.5), abs=0.06)
    slope = np.polyfit(ground.east, ground.elevation.mean(axis=0), 1)[0]
    assert slope == pytest.approx(0.05, abs=1e-3)
    raster = open_raster(spec, body=MARS, folder=tmp_path)
    with raster.dataset:
        warnings = " ".join(describe(raster).warnings)
    assert "uint8: heights come in stairs" in warnings
    assert "10 cm" in warnings


@pytest.mark.parametrize(
    "spec", [FlatDtm(size_m=(4.0, 4.0)), RasterDtm(source="dem.tif", size_m=(4.0, 4.0))]
)
def test_heights_are_taken_by_arrays_alone(spec):
    with pytest.raises(RecipeError, match=f"of kind '{spec.kind}'; only `kind: array` takes them"):
        survey(spec, body=MARS, folder=Path(), heights=np.zeros((5, 5)))


def test_array_is_taken_as_it_is():
    heights = np.random.default_rng(0).normal(size=(41, 61))
    spec = ArrayDtm(posting_m=0.5, size_m=(30.0, 20.0), noise="keep")
    site, ground = look(spec, Path(), heights=heights)
    assert np.abs(ground.elevation + site.datum_height - heights).max() < 1e-6
    with pytest.raises(RecipeError, match="heights"):
        survey(spec, body=MARS, folder=Path(), heights=None)
    with pytest.raises(RecipeError, match="larger than the array"):
        look(ArrayDtm(posting_m=0.5, size_m=(31.0, 20.0)), Path(), heights=heights)


def test_an_array_of_masked_heights_is_refused():
    """As rasterio reads a raster with holes; one without a hole is taken."""
    spec = ArrayDtm(posting_m=0.5, size_m=(30.0, 20.0), noise="keep")
    heights = np.ma.masked_equal(np.zeros((41, 61)), -9999.0)
    assert look(spec, Path(), heights=heights)[0].datum_height == 0.0
    heights[20, 30] = np.ma.masked
    with pytest.raises(RecipeError, match=r"^heights that are masked: a number for each post$"):
        survey(spec, body=MARS, folder=Path(), heights=heights)


@pytest.mark.parametrize("height", [-3.4028227e38, 3.39e6, -1.8e5])
def test_an_array_with_heights_that_no_ground_has_is_refused(height):
    """Such as what a file without a mask has for no data, or radii."""
    heights = np.zeros((41, 61))
    heights[20, 30] = height
    spec = ArrayDtm(posting_m=0.5, size_m=(30.0, 20.0))
    with pytest.raises(RecipeError, match=r"from the datum, mars's radius is 3\.39e\+06 m"):
        survey(spec, body=MARS, folder=Path(), heights=heights)


def test_flat_site_can_know_its_place():
    site, ground = look(FlatDtm(size_m=(10.0, 10.0), lonlat_deg=(23.5, 0.7)), Path(), body=MOON)
    assert site.georeferenced
    assert not ground.elevation.any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"source": "none.tif"}, "no such file"),
        ({"source": "text.txt"}, "not a raster"),
        ({"source": "a.npz"}, r"\(an array: save it as a GeoTIFF.* dtm: {kind: array}\)"),
        ({"source": "e.hdr"}, r"\(the heights are in e.img: name that\)"),
        ({"source": "f.img.hdr"}, r"\(the heights are in f.img: name that\)"),
        ({"source": "alone.hdr"}, r"\(a header alone: put its data beside it, as one of alone, al"),
        ({"size_m": (500.0, 80.0)}, "400 × 300"),
        ({"centre": Centre(offset_m=(0.0, 120.0))}, "400 × 300"),
        ({"band": 2}, "band 2 of 1"),
        ({"height_range_m": (0.0, 1.0)}, "for integers"),
    ],
)
def test_dtm_that_cannot_serve(tmp_path, change, message):
    write_raster(tmp_path / "dtm.tif")
    for name in ("text.txt", "a.npz", "e.hdr", "e.img", "f.img", "f.img.hdr", "alone.hdr"):
        (tmp_path / name).write_text("no raster")
    spec = replace(SPEC, **change)
    with pytest.raises(DataError, match=message):
        look(spec, tmp_path)


@pytest.mark.parametrize("save", [np.save, np.savez])
def test_an_array_beside_a_header_is_not_its_data(tmp_path, save):
    """Its own header would be read as heights."""
    array = tmp_path / ("a.npy" if save is np.save else "a.npz")
    save(array, np.zeros((60, 60), np.float32))
    lines = "samples = 60", "lines = 60", "bands = 1", "data type = 4", "interleave = bsq"
    (tmp_path / "a.hdr").write_text("\n".join(["ENVI", *lines, "byte order = 0", ""]))
    with pytest.raises(DataError, match=r"\(an array: save it as a GeoTIFF"):
        look(replace(SPEC, source=array.name), tmp_path)
    with pytest.raises(DataError, match=r"\(a header alone"):
        look(replace(SPEC, source="a.hdr"), tmp_path)


def test_nodata_everywhere_or_another_body(tmp_path):
    write_raster(tmp_path / "dtm.tif", change=lambda h: np.full_like(h, -9999.0))
    with pytest.raises(DataError, match="no valid height"):
        look(SPEC, tmp_path)
    with pytest.raises(DataError, match="moon has 1737 km"):
        look(SPEC, tmp_path, body=MOON)


def test_kernel_reproduces_quadratics_and_samples():
    rows, columns = np.mgrid[0:12, 0:9].astype(float)
    grid = 2.0 + 0.5 * columns - rows + 0.25 * columns * rows + 0.125 * columns**2
    column, row = np.random.default_rng(1).uniform(1.0, 7.0, (2, 40, 3))
    expected = 2.0 + 0.5 * column - row + 0.25 * column * row + 0.125 * column**2
    assert np.abs(cubic(grid, column=column, row=row) - expected).max() < 1e-12
    assert np.array_equal(cubic(grid, column=columns, row=rows), grid)


@pytest.mark.parametrize("wrap", [False, True])
def test_few_places_have_the_same_bits_as_many(wrap):
    random = np.random.default_rng(2)
    grid = random.normal(size=(12, 9)) * 1e3
    column, row = random.uniform(-9.0, 20.0, (2, 90, 100))
    many = cubic(grid, column=column, row=row, wrap=wrap)
    few = [cubic(grid, column=column[[n]], row=row[[n]], wrap=wrap) for n in range(90)]
    assert np.array_equal(np.concatenate(few), many)


def test_roughness_of_a_known_surface():
    """Points of a self-affine ground, averaged to posts of 0.5 m."""
    site = worlds.site().replace(size=(128.0, 128.0), spacing=0.125)
    from terrain_forge.terrain import Fractal

    layer = Fractal(hurst=0.7, deviation_1m_m=0.1, longest_wavelength_m=512.0)
    heights = shape_ground(site=site, window=site.window, layers=(layer,)).elevation[:-1, :-1]
    heights = heights.astype(float).reshape(256, 4, 256, 4).mean(axis=(1, 3))
    found = fit_roughness(heights, 0.5, MARS)
    assert found.hurst == pytest.approx(0.7, abs=0.12)
    assert found.deviation == pytest.approx(0.1, rel=0.15)
    small = fit_roughness(heights[:40, :40], 0.5, MARS)
    assert "preset" in small.source


@needs_data
def test_landing_pixel_of_perseverance():
    with rasterio.open(JEZERO) as file:
        x, y = at(file.transform, 664.5, 268.5)
    spec = RasterDtm(
        source=JEZERO.name, size_m=(160.0, 160.0), centre=Centre(crs=(x, y)), noise="keep"
    )
    site, ground = look(spec, JEZERO.parent, spacing=0.125)
    assert ground.shape == (1281, 1281)
    assert site.datum_height == pytest.approx(-2568.53, abs=0.005)
    lon, lat = np.degrees(site.lonlat)
    assert (lon, lat) == (pytest.approx(77.4508, abs=1e-3), pytest.approx(18.4447, abs=1e-3))


@needs_data
@pytest.mark.parametrize(
    ("path", "body", "words"),
    [
        ("moon/LDEM_4.LBL", MOON, ["radius", "7.581 km", "too coarse", "PDS"]),
        ("moon/isis_ldem_4_reduced.cub", MOON, ["radius", "ISIS3", "too coarse"]),
        ("mars/isis_DTM_2Bands_cropped.cub", MARS, ["band 1 of 2", "height above the datum"]),
        ("mars/isis_PSP_002118_1510_1m_o_forPDS_cropped.cub", MARS, ["without a vertical scale"]),
        (
            "mars/isis_Polar_Crater_1_1m_ngate_edited2_forPDS_lowres.cub",
            MARS,
            ["no valid sample", "500 m"],
        ),
    ],
)
def test_description_of_real_products(path, body, words):
    raster = open_raster(RasterDtm(source=path, size_m=(1.0, 1.0)), body=body, folder=DATA)
    with raster.dataset:
        found = describe(raster)
    text = " ".join([value for _, value in found.facts] + list(found.warnings))
    for word in words:
        assert word in text.replace("498 m", "500 m")


def test_site_is_a_record():
    assert worlds.site() == worlds.site()
    assert worlds.site() != worlds.site().replace(seed=2)
    assert isinstance(worlds.site(), Site)
