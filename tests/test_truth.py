"""The truth bundle: rasters against brute force, tables read back, the size-frequency proof."""

import csv
import json
from types import SimpleNamespace

import numba
import numpy as np
import pytest
import rasterio
from PIL import Image
from rasterio.crs import CRS
from scipy import stats
from scipy.spatial.transform import Rotation

from terrain_forge.frames import matrix_from_quaternion
from terrain_forge.mesh import Mesh
from terrain_forge.paths.files import write_trajectory
from terrain_forge.paths.route import Route
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.rocks.size_frequency import Golombek
from terrain_forge.truth.bundle import write_truth
from terrain_forge.truth.rasters import rock_rasters
from terrain_forge.truth.size_frequency import clark_evans, size_frequency, write_size_frequency
from terrain_forge.truth.tables import geographic, write_rocks
from terrain_forge.world import merge
from tests import worlds

ALPHA = 0.001


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
    import trimesh

    box = trimesh.creation.box(extents=(2.0, 2.0, 2.0))
    world = worlds.world(rocks=len(positions))
    shape = Mesh(vertices=box.vertices, faces=box.faces)
    prototype = world.library.prototypes[0].replace(
        meshes=(shape,), hulls=(shape,), uvs=(np.zeros((len(shape.faces), 3, 2)),)
    )
    count = len(positions)
    return world.replace(
        site=world.site.replace(spacing=1.0),
        window=world.site.replace(spacing=1.0).window,
        ground=world.ground.replace(elevation=np.zeros((17, 25)), spacing=1.0),
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
    tiles = list(world.tiles(cells=21))
    assert len(tiles) == 20
    for tile in tiles:
        rows = slice(tile.window.row, tile.window.row + tile.window.rows + 1)
        columns = slice(tile.window.column, tile.window.column + tile.window.columns + 1)
        part_top, part_id = rock_rasters(tile)
        assert part_top.tobytes() == top[rows, columns].tobytes()
        assert part_id.tobytes() == rock_id[rows, columns].tobytes()


def test_rasters_do_not_depend_on_the_number_of_threads(small_world):
    many = rock_rasters(small_world)
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        one = rock_rasters(small_world)
    finally:
        numba.set_num_threads(threads)
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


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_rocks_are_read_back_as_they_are(tmp_path):
    world = worlds.world(rocks=5000)
    names = ("pebbles", 'boulders, "large"')
    world = world.replace(field=world.field.replace(populations=names))
    write_rocks(world, tmp_path / "rocks.csv")
    assert (tmp_path / "rocks.csv").read_bytes().split(b"\n", 1)[0] == COLUMNS.encode()
    rows, rocks = read(tmp_path / "rocks.csv"), world.field
    assert [row["population"] for row in rows] == [names[n] for n in rocks.population]
    table = {
        name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name[:3] != "pop"
    }
    np.testing.assert_array_equal(table["id"], rocks.id)
    np.testing.assert_array_equal(table["prototype"], rocks.prototype)
    position = np.stack([table["x_m"], table["y_m"], table["z_m"]], -1)
    np.testing.assert_allclose(position, rocks.position, rtol=0, atol=1e-7)
    quaternion = np.stack([table[name] for name in ("qw", "qx", "qy", "qz")], -1)
    np.testing.assert_allclose(quaternion, rocks.quaternion, rtol=0, atol=1e-9)
    for name, column in (("diameter_m", "diameter"), ("height_m", "height"),
                         ("buried_fraction", "buried_fraction")):  # fmt: skip
        np.testing.assert_allclose(table[name], getattr(rocks, column), rtol=0, atol=1e-7)
    np.testing.assert_allclose(table["volume_m3"], rocks.volume, rtol=1e-8)
    np.testing.assert_allclose(table["mass_kg"], rocks.mass, rtol=1e-8)


def test_longitudes_and_latitudes_are_those_of_the_spherical_mercator_turned_round(tmp_path):
    radius, longitude, latitude = 1737400.0, -23.4, 71.5
    crs = f"+proj=tmerc +lat_0={latitude} +lon_0={longitude} +R={radius} +units=m +no_defs"
    site = worlds.site().replace(crs=CRS.from_string(crs).to_wkt())
    east, north = np.random.default_rng(3).uniform(-2000, 2000, (2, 50))
    # Snyder 1987, equations 8-6 to 8-8.
    d = north / radius + np.radians(latitude)
    expected_latitude = np.degrees(np.arcsin(np.sin(d) / np.cosh(east / radius)))
    expected = longitude + np.degrees(np.arctan2(np.sinh(east / radius), np.cos(d)))
    found_longitude, found_latitude = geographic(site, east, north)
    np.testing.assert_allclose(found_longitude, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found_latitude, expected_latitude, rtol=0, atol=1e-9)

    world = worlds.world().replace(site=site)
    write_rocks(world, tmp_path / "rocks.csv")
    rows = read(tmp_path / "rocks.csv")
    assert ",".join(rows[0]) == COLUMNS + ",lon_deg,lat_deg"
    lon, lat = geographic(site, *world.field.position[:, :2].T)
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


# Sizes


def population(name="rocks", *, k=0.07, diameter=(0.1, 1.5)):
    return PopulationSpec(name=name, size_frequency=Golombek(k=k), diameter_m=diameter)


def draw(random, spec, area):
    """Diameters by numerical inversion of the truncated law; Poisson number."""
    a, b = spec.diameter_m
    at = np.geomspace(a, b, 20001)
    above = spec.size_frequency.cumulative_number(at)
    count = random.poisson((above[0] - above[-1]) * area)
    u = random.uniform(above[-1], above[0], count)
    return np.interp(u, above[::-1], at[::-1])


def scattered(diameters, *, side=100.0, seed=11):
    """A flat square world with rocks of these diameters at random places."""
    count = sum(map(len, diameters))
    xy = np.random.default_rng(seed).uniform(-side / 2, side / 2, (count, 2))
    world = worlds.world(rocks=count)
    site = world.site.replace(size=(side, side), spacing=1.0)
    nodes = round(side) + 1
    return world.replace(
        site=site,
        window=site.window,
        ground=world.ground.replace(
            elevation=np.zeros((nodes, nodes)), spacing=1.0, origin=(-side / 2, -side / 2)
        ),
        field=world.field.replace(
            populations=tuple(f"p{n}" for n in range(len(diameters))),
            population=np.repeat(np.arange(len(diameters)), list(map(len, diameters))),
            position=np.column_stack([xy, np.zeros(count)]),
            diameter=np.concatenate(diameters),
        ),
        unplaced=tuple(range(len(diameters))),
    )


def test_the_wanted_figures_are_the_golden_ones():
    spec = population("p0")
    found = size_frequency(scattered([np.array([0.2])]), populations=[spec])["populations"][0]
    assert found["count"]["wanted"] == pytest.approx(13842.68, abs=0.01)
    assert found["cover"]["wanted"] == pytest.approx(0.0469199, abs=1e-7)
    assert found["cover"]["standard_deviation"] == pytest.approx(0.00080622, abs=1e-8)


def test_right_samples_agree_and_kolmogorov_smirnov_is_scipys():
    random = np.random.default_rng(8)
    spec = population("p0", diameter=(0.2, 1.5))
    law = spec.size_frequency
    diameters = draw(random, spec, 1e4)
    found = size_frequency(scattered([diameters]), populations=[spec])["populations"][0]
    ends = law.cumulative_number(np.array(spec.diameter_m))

    def distribution(d):
        return (ends[0] - law.cumulative_number(d)) / (ends[0] - ends[1])

    exact = stats.kstest(diameters, distribution, method="exact")
    test = found["kolmogorov_smirnov"]
    assert test["distance"] == pytest.approx(exact.statistic, rel=1e-12)
    assert test["p_value"] == pytest.approx(exact.pvalue, abs=1e-3)
    assert test["critical_distance"] == pytest.approx(
        stats.kstwo.isf(0.05, len(diameters)), rel=1e-3
    )
    assert test["p_value"] > ALPHA
    cover = np.pi / 4 * np.sum(diameters**2) / 1e4
    assert found["cover"]["realised"] == pytest.approx(cover, rel=1e-12)
    for name in ("count", "cover"):
        assert abs(found[name]["z"]) < stats.norm.isf(ALPHA / 2)


@pytest.mark.parametrize("count", [5, 12, 60])
def test_kolmogorov_smirnov_holds_for_few_rocks(count):
    spec = population("p0", diameter=(0.2, 1.5))
    diameters = np.linspace(0.21, 0.55, count)
    found = size_frequency(scattered([diameters]), populations=[spec])["populations"][0]
    test = found["kolmogorov_smirnov"]
    assert test["p_value"] == pytest.approx(stats.kstwo.sf(test["distance"], count), abs=0.01)


def test_a_wrong_law_is_found_out():
    random = np.random.default_rng(9)
    diameters = draw(random, population(k=0.1, diameter=(0.2, 1.5)), 1e4)
    spec = population("p0", k=0.07, diameter=(0.2, 1.5))
    found = size_frequency(scattered([diameters]), populations=[spec])["populations"][0]
    assert found["kolmogorov_smirnov"]["p_value"] < ALPHA
    assert found["count"]["z"] > 10
    assert found["cover"]["z"] > 10


def test_populations_add_up_and_strangers_stay_out():
    random = np.random.default_rng(10)
    specs = [population("p0", diameter=(0.2, 0.5)), population("p1", diameter=(0.5, 1.5))]
    world = scattered([*(draw(random, spec, 1e4) for spec in specs), np.full(100, 5.0)])
    proof = size_frequency(world, populations=specs)
    one, two, both = *proof["populations"], proof["together"]
    for name in ("wanted", "realised"):
        assert both["count"][name] == pytest.approx(one["count"][name] + two["count"][name])
        assert both["cover"][name] == pytest.approx(one["cover"][name] + two["cover"][name])
    assert both["diameter_m"] == [0.2, 1.5]
    assert both["kolmogorov_smirnov"]["p_value"] > ALPHA
    assert (one["unplaced"], two["unplaced"]) == (0, 1)


def test_the_band_is_the_poisson_one_and_the_curve_counts():
    spec = population("p0")
    diameters = draw(np.random.default_rng(12), spec, 1e4)
    curve = size_frequency(scattered([diameters]), populations=[spec])["populations"][0]["curve"]
    wanted = np.array(curve["number_wanted"]) * 1e4
    for name, tail in (("number_low", 0.025), ("number_high", 0.975)):
        np.testing.assert_allclose(np.array(curve[name]) * 1e4, stats.poisson.ppf(tail, wanted))
    n = 20
    larger = diameters[diameters >= curve["diameter_m"][n]]
    assert curve["number_realised"][n] == pytest.approx(len(larger) / 1e4)
    assert curve["cover_realised"][n] == pytest.approx(np.pi / 4 * np.sum(larger**2) / 1e4)


def test_rocks_and_area_of_corridors_stay_out():
    random = np.random.default_rng(13)
    spec = population("p0", diameter=(0.2, 1.5))
    x = np.arange(-40, 40.05, 0.1)
    route = Route(
        name="straight",
        position=np.column_stack([x, np.full(len(x), 3.0)]),
        heading=np.zeros(len(x)),
        distance=x - x[0],
        closed=False,
        speed=0.3,
        corridor_width=8.0,
        corridor_clearance=0.15,
    )
    world = scattered([draw(random, spec, 1e4)])
    world = world.replace(site=world.site.replace(routes=(route,)))
    swept = np.hypot(np.maximum(np.abs(world.field.position[:, 0]) - 40, 0),
                     world.field.position[:, 1] - 3.0) < 4.0  # fmt: skip
    proof = size_frequency(world.replace(field=world.field.select(~swept)), populations=[spec])
    assert proof["corridor_area_m2"] == pytest.approx(80 * 8 + np.pi * 16, rel=2e-3)
    assert proof["together"]["count"]["realised"] == np.sum(~swept)
    assert abs(proof["together"]["count"]["z"]) < stats.norm.isf(ALPHA / 2)
    assert size_frequency(world, populations=[spec])["together"] == proof["together"]


def test_clark_evans_tells_random_from_even_and_clustered():
    random = np.random.default_rng(14)
    points = random.uniform(0, 100, (2000, 2))
    assert abs(clark_evans(points, 1e4, 400.0)["z"]) < stats.norm.isf(ALPHA / 2)
    lattice = np.stack(np.meshgrid(np.arange(30.0), np.arange(30.0)), -1).reshape(-1, 2)
    even = clark_evans(lattice, 900.0, 120.0)
    # 2 without edges; Donnelly's expectation is 1 + 2 (0.0514 + 0.041/30) 4·30/900 times larger.
    assert even["ratio"] == pytest.approx(2.0 / (1 + 2 * (0.0514 + 0.041 / 30) * 120 / 900))
    assert clark_evans(points * 0.5, 1e4, 400.0)["z"] < -10
    assert clark_evans(points[:1], 1e4, 400.0) is None


def test_populations_without_any_rock_are_said_to_have_none(tmp_path):
    world = scattered([np.zeros(0)])
    write_size_frequency(world, tmp_path, populations=[population("p0")])
    found = json.loads((tmp_path / "size_frequency.json").read_text())["populations"][0]
    assert found["count"]["realised"] == 0
    assert found["kolmogorov_smirnov"] is None
    assert found["clark_evans"] is None
    write_size_frequency(world, tmp_path, populations=[])
    assert json.loads((tmp_path / "size_frequency.json").read_text())["together"] is None


def test_any_name_can_be_drawn(tmp_path):
    spec = population("_a$ {b_$", diameter=(0.2, 1.5))
    world = scattered([draw(np.random.default_rng(16), spec, 1e4)])
    world = world.replace(field=world.field.replace(populations=(spec.name,)))
    write_size_frequency(world, tmp_path, populations=[spec])
    assert (tmp_path / "size_frequency.png").stat().st_size > 10_000


# The bundle


def test_the_bundle_is_whole_and_repeats(tmp_path):
    specs = (
        population("pebbles", diameter=(0.2, 0.7)),
        population("boulders", diameter=(0.7, 2.0)),
    )
    world = worlds.world()
    world.site.__dict__["recipe"] = SimpleNamespace(rocks=SimpleNamespace(populations=specs))
    files = write_truth(world, tmp_path / "one")
    again = write_truth(world, tmp_path / "two")
    names = ["surface.tif", "surface_with_rocks.tif", "rock_id.tif", "rocks.csv",
             "size_frequency.json", "size_frequency.png"]  # fmt: skip
    assert [file.name for file in files] == names
    assert sorted(f.name for f in (tmp_path / "one" / "truth").iterdir()) == sorted(names)
    assert [f.read_bytes() for f in files] == [f.read_bytes() for f in again]
    top, rock_id = rock_rasters(world)
    for file, expected in zip(files, (world.ground.elevation, top, rock_id), strict=False):
        with rasterio.open(file) as raster:
            np.testing.assert_array_equal(raster.read(1)[::-1], expected)
    with rasterio.open(files[2]) as raster:
        assert raster.nodata == -1
    with Image.open(files[5]) as image:
        image.load()
        assert image.size[0] > 1000
        assert "Software" not in image.info
