"""The truth bundle: rasters against brute force and rays, tables read back."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest
import rasterio
import trimesh
from PIL import Image
from rasterio.crs import CRS
from scipy.spatial.transform import Rotation

from terrain_forge.base import matrix_from_quaternion
from terrain_forge.dtm import geographic_crs, transform
from terrain_forge.model import Mesh, merge
from terrain_forge.paths.files import write_trajectory
from terrain_forge.recipe import ValidateSpec
from terrain_forge.truth import rock_rasters, write_truth
from terrain_forge.truth.size_frequency import size_frequency
from terrain_forge.truth.tables import write_rocks
from terrain_forge.validation.checks.rocks import Resting, foot_and_top
from terrain_forge.validation.checks.truth import TopSurface
from tests.helpers import worlds
from tests.unit.truth.test_size_frequency_verification import population, rocks

ALPHA = 0.001
BARE = SimpleNamespace(layers=())


# Rasters


def brute_force(world):
    """Highest surface under a vertical line at each node, by solving for every triangle."""
    top = world.ground.elevation.astype(np.float64)
    owner = np.full(top.shape, -1)
    east, north = np.meshgrid(world.ground.east, world.ground.north)
    rocks = merge(world.field, world.neighbours)
    for n in range(len(rocks)):
        mesh = world.library.prototypes[rocks.prototype[n]].meshes[0]
        turn = matrix_from_quaternion(rocks.quaternion[n])
        vertices = rocks.scale[n] * mesh.vertices @ turn.T + rocks.position[n]
        for a, b, c in vertices[mesh.faces]:
            # a + u (b - a) + v (c - a) over the node: u, v by Cramer's rule.
            (p, q), (r, s) = (b - a)[:2], (c - a)[:2]
            x, y = east - a[0], north - a[1]
            area = p * s - q * r
            u, v = (x * s - y * r) / area, (y * p - x * q) / area
            height = a[2] + u * (b - a)[2] + v * (c - a)[2]
            inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (height > top)
            top[inside], owner[inside] = height[inside], rocks.id[n]
    return top, owner


def test_rasters_equal_brute_force_rays():
    world = worlds.world(rocks=60)
    world = world.replace(
        field=world.field.select(np.arange(0, 60, 2)),
        neighbours=world.field.select(np.arange(1, 60, 2)),
    )
    top, rock_id = rock_rasters(world)
    expected_top, expected_id = brute_force(world)
    assert (top.dtype, rock_id.dtype) == (np.float32, np.int32)
    np.testing.assert_allclose(top, expected_top, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(rock_id, expected_id)
    assert set(np.unique(rock_id)) & set(world.neighbours.id.tolist())
    bare = rock_id == -1
    np.testing.assert_array_equal(top[bare], world.ground.elevation[bare])
    assert 0.02 < 1 - bare.mean() < 0.5


def with_boxes(positions):
    """A flat world of 1 m spacing with cubes of 2 m whose corners lie on nodes."""
    box = trimesh.creation.box(extents=(2.0, 2.0, 2.0))
    world = worlds.world(rocks=len(positions))
    shape = Mesh(vertices=box.vertices, faces=box.faces)
    prototype = world.library.prototypes[0].replace(
        meshes=(shape,), hulls=(shape,), uvs=(np.zeros((len(shape.faces), 3, 2)),)
    )
    count = len(positions)
    return worlds.on_ground(
        world,
        world.ground.replace(elevation=np.zeros((17, 25)), spacing=1.0),
        site=world.site.replace(spacing=1.0),
        library=world.library.replace(prototypes=(prototype,)),
        field=world.field.replace(
            prototype=np.zeros(count),
            position=np.array(positions),
            quaternion=np.tile([1.0, 0, 0, 0], (count, 1)),
            scale=np.ones(count),
        ),
    )


def test_no_ray_slips_between_triangles_and_edges_count():
    top, rock_id = rock_rasters(with_boxes([(3.0, -2.0, 0.5)]))
    expected = np.full((17, 25), -1)
    expected[5:8, 14:17] = 0
    np.testing.assert_array_equal(rock_id, expected)
    np.testing.assert_array_equal(top, np.where(expected == 0, 1.5, 0.0))


def test_ties_go_to_the_lower_id_and_to_the_ground():
    boxes = with_boxes([(3.0, -2.0, 0.5), (3.0, -2.0, 0.5), (-3.0, 2.0, -1.0), (0.0, 6.0, -5.0)])
    reordered = boxes.replace(field=boxes.field.replace(id=np.array([7, 4, 8, 9])))
    _, rock_id = rock_rasters(reordered)
    assert set(np.unique(rock_id)) == {-1, 4}


def test_a_window_has_the_bits_of_the_whole():
    world = worlds.world(rocks=60)
    top, rock_id = rock_rasters(world)
    tiles = [tile.world for tile in world.tiles(cells=21)]
    assert len(tiles) == 20
    for tile in tiles:
        rows = slice(tile.window.row, tile.window.row + tile.window.rows + 1)
        columns = slice(tile.window.column, tile.window.column + tile.window.columns + 1)
        part_top, part_id = rock_rasters(tile)
        assert part_top.tobytes() == top[rows, columns].tobytes()
        assert part_id.tobytes() == rock_id[rows, columns].tobytes()


def test_rasters_do_not_depend_on_the_number_of_threads(small_world, use_threads):
    one = rock_rasters(small_world)
    use_threads(3)
    many = rock_rasters(small_world)
    assert all(a.tobytes() == b.tobytes() for a, b in zip(many, one, strict=True))


def test_a_world_without_rocks_is_its_ground():
    world = worlds.world(rocks=0)
    top, rock_id = rock_rasters(world)
    np.testing.assert_array_equal(top, world.ground.elevation)
    assert (rock_id == -1).all()


# Tables

COLUMNS = (
    "id,population,prototype,x_m,y_m,z_m,qw,qx,qy,qz,"
    "diameter_m,height_m,buried_fraction,volume_m3,mass_kg"
)
MORE_COLUMNS = ",a_m,b_m,c_m,collision_parts,dynamic,collides"


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_rocks_are_read_back_as_they_are(tmp_path):
    world = worlds.world(rocks=5000)
    names = ("pebbles", 'boulders, "large"')
    world = world.replace(field=world.field.replace(populations=names))
    write_rocks(world, tmp_path / "rocks.csv")
    header = (tmp_path / "rocks.csv").read_bytes().split(b"\n", 1)[0]
    assert header == (COLUMNS + MORE_COLUMNS).encode()
    rows, field = read(tmp_path / "rocks.csv"), world.field
    assert [row["population"] for row in rows] == [names[n] for n in field.population]
    table = {
        name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name[:3] != "pop"
    }
    np.testing.assert_array_equal(table["id"], field.id)
    np.testing.assert_array_equal(table["prototype"], field.prototype)
    position = np.stack([table["x_m"], table["y_m"], table["z_m"]], -1)
    np.testing.assert_allclose(position, field.position, rtol=0, atol=1e-7)
    quaternion = np.stack([table[name] for name in ("qw", "qx", "qy", "qz")], -1)
    np.testing.assert_allclose(quaternion, field.quaternion, rtol=0, atol=1e-9)
    for name, column in (("diameter_m", "diameter"), ("height_m", "height"),
                         ("buried_fraction", "buried_fraction")):  # fmt: skip
        np.testing.assert_allclose(table[name], getattr(field, column), rtol=0, atol=1e-7)
    np.testing.assert_allclose(table["volume_m3"], field.volume, rtol=1e-8)
    np.testing.assert_allclose(table["mass_kg"], field.mass, rtol=1e-8)


def test_the_later_columns_are_axes_parts_and_what_the_rocks_are_for(tmp_path):
    world = worlds.world(rocks=30)
    shapes = world.library.prototypes
    split = shapes[0].replace(hulls=shapes[0].hulls * 3)
    dynamic, solid = np.arange(30) % 7 == 0, np.arange(30) % 5 > 0
    world = world.replace(
        library=world.library.replace(prototypes=(split, *shapes[1:])),
        field=world.field.replace(dynamic=dynamic, collides=solid),
    )
    write_rocks(world, tmp_path / "rocks.csv")
    rows = read(tmp_path / "rocks.csv")
    for n, row in enumerate(rows):
        shape, scale = shapes[int(row["prototype"])], world.field.scale[n]
        axes = [float(row[name]) for name in ("a_m", "b_m", "c_m")]
        extents = np.ptp(scale * shape.meshes[0].vertices, axis=0)
        np.testing.assert_allclose(axes, extents, rtol=0, atol=1e-7)
        assert (row["dynamic"], row["collides"]) == (str(int(dynamic[n])), str(int(solid[n])))
        parts = 3 if row["prototype"] == "0" else 1
        assert int(row["collision_parts"]) == (parts if solid[n] else 0)


def test_longitudes_and_latitudes_are_those_of_the_spherical_mercator_turned_round(tmp_path):
    radius, longitude, latitude = 1737400.0, -23.4, 71.5
    crs = f"+proj=tmerc +lat_0={latitude} +lon_0={longitude} +R={radius} +units=m +no_defs"
    site = worlds.site().replace(crs=CRS.from_string(crs).to_wkt())
    east, north = np.random.default_rng(3).uniform(-2000, 2000, (2, 50))
    # Snyder 1987, equations 8-6 to 8-8.
    d = north / radius + np.radians(latitude)
    expected_latitude = np.degrees(np.arcsin(np.sin(d) / np.cosh(east / radius)))
    expected = longitude + np.degrees(np.arctan2(np.sinh(east / radius), np.cos(d)))
    found_longitude, found_latitude = transform(site.crs, geographic_crs(site.crs), east, north)
    np.testing.assert_allclose(found_longitude, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found_latitude, expected_latitude, rtol=0, atol=1e-9)

    world = worlds.world().replace(site=site)
    write_rocks(world, tmp_path / "rocks.csv")
    rows = read(tmp_path / "rocks.csv")
    assert ",".join(rows[0]) == COLUMNS + ",lon_deg,lat_deg" + MORE_COLUMNS
    lon, lat = transform(site.crs, geographic_crs(site.crs), *world.field.position[:, :2].T)
    np.testing.assert_allclose([float(r["lon_deg"]) for r in rows], lon, rtol=0, atol=1e-9)
    np.testing.assert_allclose([float(r["lat_deg"]) for r in rows], lat, rtol=0, atol=1e-9)


def test_trajectories_are_read_back_by_table_and_by_tum(tmp_path, small_world):
    path = small_world.trajectories[0]
    files = write_trajectory(path, tmp_path / "paths")
    assert [file.name for file in files] == ["arc.csv", "arc.tum"]
    table = np.genfromtxt(files[0], delimiter=",", names=True)
    assert table.dtype.names == (
        "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "roll_rad", "pitch_rad", "yaw_rad",
    )  # fmt: skip
    angles = np.stack([table[name] for name in table.dtype.names[-3:]], -1)
    np.testing.assert_allclose(angles, path.rpy, rtol=0, atol=1e-9)
    assert angles[:, 2].max() > np.pi
    tum = np.loadtxt(files[1])
    np.testing.assert_allclose(tum[:, 0], path.time, rtol=0, atol=1e-9)
    np.testing.assert_allclose(tum[:, 1:4], path.position, rtol=0, atol=1e-9)
    expected = Rotation.from_euler("ZYX", path.rpy[:, ::-1])
    for turn in (
        Rotation.from_quat(tum[:, 4:]),
        Rotation.from_quat(np.stack([table[n] for n in ("qx", "qy", "qz", "qw")], -1)),
    ):
        assert (expected * turn.inv()).magnitude().max() < 1e-8


# Checks of the built world


def test_the_true_outline_is_the_ground_that_is_seen_to_be_rock():
    """Cubes of 2 m on a grid of 1 m: nine nodes each, of which four cells are the rock."""
    boxes = with_boxes([(3.3, -2.2, 0.0), (-6.7, 2.4, 0.0)])
    boxes = boxes.replace(field=boxes.field.replace(population=np.array([0, 1])))
    spec = population("pebbles", diameter=(0.2, 1.5))
    cover = size_frequency(boxes, rocks=rocks(spec))["populations"][0]["cover"]
    assert cover["outline"] == pytest.approx(4.0 / (24 * 16))
    assert cover["outline_error"] == pytest.approx(2.0 / (24 * 16))


def top_surface_checks(world, directory):
    built = SimpleNamespace(world=world, directory=directory, spec=ValidateSpec(points=2000))
    return TopSurface().checks(built)


def test_top_surface_and_ids_are_checked_by_rays(tmp_path):
    world = worlds.world(rocks=60)
    world.site.__dict__["recipe"] = SimpleNamespace(rocks=rocks(), terrain=BARE)
    write_truth(world, tmp_path)
    height, ids = top_surface_checks(world, tmp_path)
    assert height.passed
    assert ids.passed
    assert height.figure < 1e-5
    moved = world.field.position + np.array([0.0, 0.0, 0.01])
    height, ids = top_surface_checks(
        world.replace(field=world.field.replace(position=moved)), tmp_path
    )
    assert not height.passed
    assert height.figure == pytest.approx(0.01, abs=1e-4)
    gone = world.replace(field=world.field.select(world.field.id % 5 > 0))
    assert not top_surface_checks(gone, tmp_path)[1].passed
    assert top_surface_checks(world, tmp_path / "truth") == []


def test_daylight_and_drowned_rocks_are_found():
    """Balls of radius ½ m: one in the ground, one over it, one under it."""
    world = worlds.world(rocks=1)
    flat = world.ground.replace(elevation=np.zeros(world.ground.shape))
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    shape = Mesh(vertices=ball.vertices, faces=ball.faces)
    prototype = world.library.prototypes[0].replace(
        meshes=(shape,), hulls=(shape,), uvs=(np.zeros((len(shape.faces), 3, 2)),)
    )
    library = world.library.replace(prototypes=(prototype,))
    at = [(0.0, 0.0, 0.3), (0.0, 0.0, 0.52), (0.0, 0.0, -0.6)]
    field = world.field.select(np.zeros(3, np.intp)).replace(
        id=np.arange(3), prototype=np.zeros(3), position=np.array(at),
        quaternion=np.tile([1.0, 0, 0, 0], (3, 1)), scale=np.ones(3), diameter=np.ones(3),
    )  # fmt: skip
    foot, top = foot_and_top(field, prototype, flat)
    # The foot is at a twentieth of the ball's extent.
    np.testing.assert_allclose(foot, [-0.15, 0.07, -1.05], atol=1e-6)
    np.testing.assert_allclose(top, [0.8, 1.02, -0.1], atol=1e-6)
    daylight, drowned = Resting().checks(
        SimpleNamespace(world=worlds.on_ground(world, flat, library=library, field=field))
    )
    assert (daylight.figure, drowned.figure) == (1.0, 1.0)
    assert not drowned.passed


# The bundle


def test_the_bundle_is_whole_and_repeats(tmp_path):
    specs = (
        population("pebbles", diameter=(0.2, 0.7)),
        population("boulders", diameter=(0.7, 2.0)),
    )
    world = worlds.world()
    world.site.__dict__["recipe"] = SimpleNamespace(rocks=rocks(*specs), terrain=BARE)
    files = write_truth(world, tmp_path / "one")
    again = write_truth(world, tmp_path / "two")
    names = ["surface.tif", "surface_with_rocks.tif", "rock_id.tif", "rocks.csv",
             "size_frequency.json", "size_frequency.png"]  # fmt: skip
    assert [file.name for file in files] == names
    assert sorted(f.name for f in (tmp_path / "one" / "truth").iterdir()) == sorted(names)
    assert [f.read_bytes() for f in files] == [f.read_bytes() for f in again]
    top, rock_id = rock_rasters(world)
    for file, values in zip(files, (world.ground.elevation, top, rock_id), strict=False):
        with rasterio.open(file) as raster:
            np.testing.assert_array_equal(raster.read(1)[::-1], values)
    with rasterio.open(files[2]) as raster:
        assert raster.nodata == -1
    with Image.open(files[5]) as image:
        image.load()
        assert image.size[0] > 200
        assert "Software" not in image.info
