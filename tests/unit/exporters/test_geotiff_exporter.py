import numpy as np
import pytest
import rasterio
from terrain_forge.exporters.geotiff import Options, export
from terrain_forge.exporters.geotiff.joining import OVERVIEW, join_tiles, overview_nodes

from terrain_forge.base import RecipeError
from terrain_forge.model import BuiltTile, TiledSite, TileGrid, rotations
from terrain_forge.writers import band_statistics, write_geotiff
from tests.helpers.surfaces import top_under

PRODUCTS = ["elevation", "hillshade", "orthoimage", "rock_id", "slope", "surface_with_rocks"]


def exported(world, directory, **options):
    """Each raster written, rows run north."""
    directory.mkdir()
    report = export(world, directory, options=Options(**options))
    found = sorted(path.name for path in directory.iterdir())
    assert list(map(str, report.files)) == found
    rasters = {}
    for name in found:
        with rasterio.open(directory / name) as file:
            values = np.moveaxis(file.read(), 0, -1)[::-1]
            rasters[name.removesuffix(".tif")] = values[..., 0] if file.count == 1 else values
    return rasters


def tilted(world, east, north):
    """The world on a plane that rises so much per metre."""
    ground = world.ground
    plane = east * ground.east + (north * ground.north)[:, None]
    return world.replace(ground=ground.replace(elevation=plane))


def test_heights_and_ids_are_those_of_the_world(small_world, tmp_path):
    rasters = exported(small_world, tmp_path / "geotiff")
    assert sorted(rasters) == PRODUCTS
    ground, field = small_world.ground, small_world.field
    assert np.array_equal(rasters["elevation"], ground.elevation)
    east, north = np.meshgrid(ground.east, ground.north)
    nodes = np.stack([east.ravel(), north.ravel()], axis=-1)
    top, wanted = ground.elevation.astype(float).ravel(), np.full(len(nodes), -1)
    for row, turn in enumerate(rotations(field)):
        shape = small_world.library.prototypes[field.prototype[row]].meshes[0]
        placed = field.scale[row] * shape.vertices @ turn.T + field.position[row]
        near = np.flatnonzero(np.abs(nodes - field.position[row, :2]).max(axis=1) < 2)
        heights = top_under(placed, shape.faces, nodes[near])
        higher = heights > top[near]
        top[near[higher]], wanted[near[higher]] = heights[higher], field.id[row]
    assert (wanted >= 0).sum() > 100
    assert np.array_equal(rasters["rock_id"].ravel(), wanted)
    assert np.abs(rasters["surface_with_rocks"].ravel() - top).max() < 1e-5


@pytest.mark.parametrize("cloud_optimized", [False, True])
def test_bands_hold_their_statistics(small_world, tmp_path, cloud_optimized):
    """Or GDAL writes them into files beside."""
    products = ("elevation", "rock_id", "orthoimage")
    options = Options(products=products, cloud_optimized=cloud_optimized)
    for name in export(small_world, tmp_path, options=options).files:
        with rasterio.open(tmp_path / name) as file:
            for band, values in enumerate(file.read(masked=True), start=1):
                told = {key: float(value) for key, value in file.tags(band).items()}
                assert told["STATISTICS_MINIMUM"] == values.min()
                assert told["STATISTICS_MAXIMUM"] == values.max()
                assert told["STATISTICS_MEAN"] == pytest.approx(values.mean(dtype=float))
                assert told["STATISTICS_STDDEV"] == pytest.approx(values.std(dtype=float))
                share = 100.0 * values.count() / values.size
                assert told["STATISTICS_VALID_PERCENT"] == pytest.approx(share, abs=0.01)


def test_slope_and_shade_of_a_plane(small_world, tmp_path):
    rasters = exported(tilted(small_world, 0.3, -0.4), tmp_path / "geotiff")
    assert rasters["slope"] == pytest.approx(np.degrees(np.arctan(0.5)), abs=1e-3)
    normal = np.array([-0.3, 0.4, 1]) / np.sqrt(1.25)
    light = max(0.0, normal @ small_world.lighting.towards_sun)
    assert 0.1 < light < 0.9
    assert np.abs(rasters["hillshade"].astype(float) - 255 * light).max() <= 0.51


def test_the_slope_of_nearly_level_ground(small_world, tmp_path):
    rasters = exported(tilted(small_world, 1e-4, 0.0), tmp_path / "geotiff", products=("slope",))
    assert rasters["slope"][:, 1:-1] == pytest.approx(np.degrees(1e-4), rel=0.01)


def test_the_side_away_from_the_sun_is_black(small_world, tmp_path):
    east, north, _ = small_world.lighting.towards_sun
    rasters = exported(tilted(small_world, 2 * east, 2 * north), tmp_path / "geotiff")
    assert rasters["hillshade"].max() == 0


def test_the_orthoimage_shows_ground_and_rocks(small_world, tmp_path):
    colours = np.random.default_rng(8).integers(0, 256, (65, 97, 3)).astype(np.uint8)
    looks = small_world.appearance.replace(ground_rgb=colours)
    rasters = exported(small_world.replace(appearance=looks), tmp_path / "geotiff")
    rock = rasters["rock_id"]
    assert np.array_equal(rasters["orthoimage"][rock < 0], colours[rock < 0])
    field = small_world.field
    rows = np.searchsorted(field.id, rock[rock >= 0])
    wanted = small_world.appearance.rock_rgb[field.population[rows]]
    assert np.array_equal(rasters["orthoimage"][rock >= 0], wanted)


def test_heights_above_the_datum(small_world, tmp_path):
    site = small_world.site.replace(datum_height=-4500.0, slope=(0.01, -0.02))
    rasters = exported(small_world.replace(site=site), tmp_path / "geotiff", heights="datum")
    ground = small_world.ground
    plane = 0.01 * ground.east - 0.02 * ground.north[:, None] - 4500
    for name in ("elevation", "surface_with_rocks"):
        world = exported(small_world, tmp_path / name, products=(name,))[name]
        assert np.abs(rasters[name] - (world + plane)).max() < 0.0003


def test_only_the_products_that_were_asked_for(small_world, tmp_path):
    rasters = exported(small_world, tmp_path / "geotiff", products=("slope", "rock_id"))
    assert sorted(rasters) == ["rock_id", "slope"]
    with pytest.raises(RecipeError, match="slope is named twice"):
        Options(products=("slope", "rock_id", "slope"))


def test_cloud_optimized(small_world, tmp_path):
    plain = exported(small_world, tmp_path / "plain")
    cloud = exported(small_world, tmp_path / "cloud", cloud_optimized=True)
    for name in PRODUCTS:
        assert np.array_equal(plain[name], cloud[name])
        with rasterio.open(tmp_path / "cloud" / f"{name}.tif") as file:
            assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
    with rasterio.open(tmp_path / "cloud" / "orthoimage.tif") as file:
        assert [colour.name for colour in file.colorinterp] == ["red", "green", "blue"]


def test_equal_worlds_make_equal_cloud_optimised_bytes(small_world, tmp_path):
    for name in ("one", "two"):
        exported(small_world, tmp_path / name, cloud_optimized=True)
    for product in PRODUCTS:
        one, two = (tmp_path / name / f"{product}.tif" for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()


def test_the_overview_of_a_site_in_tiles_shows_nodes_amid_its_pixels(
    small_world, tmp_path, monkeypatch
):
    monkeypatch.setattr("terrain_forge.exporters.geotiff.joining.OVERVIEW_PIXELS", 12)
    site, ground = small_world.site, small_world.ground
    grid = TileGrid.of(site, max(site.window.columns, site.window.rows))
    rows, columns = (
        overview_nodes(count - 1, grid, first=0, count=count) for count in ground.shape
    )
    north = np.tile(ground.north.astype(np.float32)[:, None], (1, len(ground.east)))
    write_geotiff(tmp_path / "elevation.tif", north, world_ground=ground, site=site)
    np.savez(tmp_path / OVERVIEW, elevation=north[np.ix_(rows, columns)])
    tile = BuiltTile(
        number=0, row=0, column=0, window=grid.window(0), folder=".", height=(0, 1), rocks=0,
        figures={}, statistics={"elevation.tif": band_statistics(tmp_path / "elevation.tif")},
    )  # fmt: skip
    tiled = TiledSite(
        site=site, grid=grid, world=small_world, tiles=(tile,), near_paths=lambda _: iter(())
    )
    join_tiles(tiled, tmp_path, options=Options(products=("elevation",)))
    with (
        rasterio.open(tmp_path / "elevation.vrt", overview_level=0) as shown,
        rasterio.open(tmp_path / "elevation_overview.tif") as overview,
    ):
        assert max(shown.shape) < 0.2 * max(ground.shape)
        assert shown.transform.almost_equals(overview.transform, 1e-9)
        place = shown.transform
        places = place.f + (np.arange(shown.height)[:, None] + 0.5) * place.e
        assert np.abs(shown.read(1) - places).max() <= 0.5 * site.spacing + 1e-5
