"""What lies beyond a world's edge: its heights, its stitching, its rocks, what it is made from."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import rasterio
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from terrain_forge.base import DataError, RecipeError, length_text
from terrain_forge.building import site_lines
from terrain_forge.dtm import FlatDtm, HorizonSpec, RasterDtm, followed_to
from terrain_forge.making import make_horizon, plan
from terrain_forge.model import Heightfield, World
from terrain_forge.model.inputs import FarHeights
from terrain_forge.recipe import Recipe
from terrain_forge.rocks import Golombek, PopulationSpec, RocksSpec
from terrain_forge.terrain import Fractal, heights_beyond, paint, shape_ground
from terrain_forge.terrain.horizon.crests import places_of
from terrain_forge.terrain.horizon.rings import rings_around
from tests.helpers import worlds
from tests.helpers.recipes import flat
from tests.helpers.surfaces import random_points

RADIUS = 3396190.0
CRS = f"+proj=eqc +R={RADIUS} +units=m +no_defs"


FINE = RasterDtm(source="fine.tif", size_m=(100.0, 80.0), noise="keep")


def land(x, y):
    """Hills of a kilometre, a mountain in the east, a slope [m]."""
    hills = 20.0 * np.sin(x / 700.0) * np.cos(y / 900.0)
    return hills + 400.0 * np.exp(-(((x - 6000.0) / 2500.0) ** 2) - (y / 3000.0) ** 2) + 0.02 * x


def ridges(x, y):
    """Walls a few hundred metres wide around the origin, as high as they are far [m]."""
    away = np.hypot(x, y)
    return 0.08 * away * np.maximum(0.0, np.cos(2 * np.pi * np.log(away / 300.0 + 1.0) * 3.3)) ** 4


def raster(path: Path, *, posting: float, half: float, rise: float = 0.0, land=land) -> Path:
    """A GeoTIFF of `land` about the origin."""
    places = np.arange(-half + posting / 2, half, posting)
    heights = land(places[None, :], -places[:, None]) + rise
    heights = heights.astype(np.float32)
    shape = {"width": len(places), "height": len(places), "count": 1, "dtype": "float32"}
    transform = rasterio.Affine(posting, 0, -half, 0, -posting, half)
    with rasterio.open(path, "w", driver="GTiff", crs=CRS, transform=transform, **shape) as file:
        file.write(heights, 1)
    return path


def recipe(dtm, horizon=None, layers=(), rocks=None) -> Recipe:
    more = {"horizon": horizon or HorizonSpec(), "rocks": rocks or RocksSpec()}
    return flat((1.0, 1.0), 0.5, terrain={"layers": layers}, seed=5, **(more | {"dtm": dtm}))


def made(wanted: Recipe, folder: Path):
    """Site, ground and horizon of a recipe, its rocks left out within the site."""
    site = plan(wanted, folder=folder)
    layers = wanted.terrain.layers
    ground = shape_ground(site=site, window=site.window, layers=layers)
    colours = paint(site, site.window, ground)
    return site, ground, make_horizon(site, ground, colours, worlds.library())


@pytest.fixture(scope="module")
def site_in_hills(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hills")
    raster(folder / "fine.tif", posting=8.0, half=4000.0)
    raster(folder / "coarse.tif", posting=200.0, half=30000.0, rise=123.0)
    return folder


def drop(points, half):
    off = points - np.clip(points, np.negative(half), half)
    return (off**2).sum(axis=1) / (2.0 * RADIUS)


@pytest.mark.parametrize("level", ["none", "plane"])
def test_heights_beyond_are_those_of_the_model_out_to_where_it_ends(site_in_hills, level):
    """The levelled plane is held for a site's length and does not lift the landscape."""
    site, ground, horizon = made(recipe(replace(FINE, level=level)), site_in_hills)
    random = np.random.default_rng(3)
    turn = random.uniform(0, 2 * np.pi, 300)
    away = random.uniform(80.0, 130.0 if level == "plane" else 2000.0, 300)
    points = away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    found = heights_beyond(ground, horizon, *points.T) + drop(points, (50.0, 40.0))
    wanted = land(*points.T) - site.datum_height - points @ site.slope
    near = away < 300.0
    assert np.abs(found - wanted)[near].max() < 0.3
    assert np.abs(found - wanted).max() < 4.0  # the rings are 10 % apart, the hills 20 m high
    assert 3500.0 < horizon.followed < 4020.0
    assert followed_to(site) == pytest.approx(horizon.followed, rel=0.1)
    assert f"out to {length_text(followed_to(site))} (fine.tif)" in "".join(site_lines(site, ()))
    assert "level" in horizon.told


@pytest.mark.parametrize("reach", [0.5, 100.0, 2000.0])
def test_heights_are_told_no_farther_than_the_horizon_is_to_reach(site_in_hills, reach):
    site = plan(recipe(FINE, HorizonSpec(reach_m=reach)), folder=site_in_hills)
    assert followed_to(site) == pytest.approx(reach)


def test_nodes_are_on_the_model_to_its_very_edge(site_in_hills):
    """In its corners too: what it hides in a mountain's foot would be 200 m."""
    site, _, horizon = made(recipe(FINE), site_in_hills)
    x, y, z = horizon.mesh.vertices.T
    off = drop(horizon.mesh.vertices[:, :2], (50.0, 40.0))
    wrong = np.abs(z + off - land(x, y) + site.datum_height)
    away = np.maximum(np.abs(x), np.abs(y))
    for low, high, most in ((60.0, 3000.0, 0.5), (3000.0, 3996.0, 0.5)):
        here = (away > low) & (away < high)
        assert here.sum() > 100
        assert wrong[here].max() < most
    assert 3500.0 < horizon.followed < 4020.0


@pytest.mark.slow
def test_the_skyline_is_that_of_the_model_where_its_ridges_fall_between_rings(tmp_path):
    raster(tmp_path / "fine.tif", posting=8.0, half=4000.0, land=ridges)
    site, ground, horizon = made(recipe(FINE), tmp_path)
    turn, away = np.meshgrid(np.radians(np.arange(0.0, 360.0, 2.0)), np.geomspace(300, 3500, 1500))
    points = np.stack([away * np.cos(turn), away * np.sin(turn)], axis=-1).reshape(-1, 2)
    wanted = ridges(*points.T) - site.datum_height - drop(points, (50.0, 40.0))
    eye = ground.elevation.mean() + 2.0
    tops = [
        np.degrees(np.arctan2(heights - eye, away.ravel())).reshape(away.shape).max(axis=0)
        for heights in (heights_beyond(ground, horizon, *points.T), wanted)
    ]
    wrong = np.abs(tops[0] - tops[1])
    assert tops[1].min() > 4.0
    assert np.median(wrong) < 0.25
    assert wrong.max() < 0.5


def test_crests_are_those_that_a_parts_own_middle_sees():
    """A part of a site lies anywhere on it; so does the land around it here."""
    size = np.zeros((41, 61))
    found = []
    for east, north in ((0.0, 0.0), (512.0, -256.0)):
        ground = Heightfield(elevation=size, spacing=1.0, origin=(east - 30.0, north - 20.0))
        middle = np.array([east, north])

        def known_at(points, middle=middle):
            x, y = (points - middle).T
            return ridges(x, y) + 0.05 * x, np.ones(len(points))

        rings = rings_around(ground, 3000.0)
        found.append(np.concatenate(places_of(rings, ground, known_at)) - middle)
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)


def test_heights_under_points_are_those_of_the_triangles(tmp_path):
    raster(tmp_path / "fine.tif", posting=8.0, half=4000.0, land=ridges)
    _, ground, horizon = made(recipe(FINE), tmp_path)
    corners = horizon.mesh.vertices[horizon.mesh.faces[: horizon.ground_faces]]
    (a, b), c = np.diff(corners[..., :2], axis=1).transpose(1, 0, 2), corners[:, 0]
    assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).min() > 0.0  # none lies on its head
    share = np.random.default_rng(2).dirichlet((1.0, 1.0, 1.0), len(c))
    points = np.einsum("nk,nkd->nd", share, corners)
    np.testing.assert_allclose(
        heights_beyond(ground, horizon, *points[:, :2].T), points[:, 2], atol=1e-6
    )


def test_no_cliff_where_the_model_ends(site_in_hills):
    _, _, horizon = made(recipe(FINE), site_in_hills)
    mesh = horizon.mesh
    a, b, c = (mesh.vertices[mesh.faces[: horizon.ground_faces, n]] for n in range(3))
    normal = np.cross(b - a, c - a)
    assert (normal[:, 2] / np.linalg.norm(normal, axis=1)).min() > np.cos(np.radians(15.0))


def test_a_second_model_goes_on_at_the_height_of_the_first(site_in_hills):
    spec = HorizonSpec(dtm="coarse.tif")
    site, ground, horizon = made(recipe(FINE, spec), site_in_hills)
    points = np.array([[6000.0, 0.0], [6000.0, 1500.0], [-5000.0, 4000.0]])
    found = heights_beyond(ground, horizon, *points.T) + drop(points, (50.0, 40.0))
    assert found == pytest.approx(land(*points.T) - site.datum_height, abs=25.0)
    assert "coarse.tif" in horizon.told
    assert horizon.reach > 20000.0


@pytest.mark.parametrize("cut", [False, True])
def test_a_second_model_takes_over_before_the_first_ends(site_in_hills, tmp_path, cut):
    """Nothing of the first is made up beyond its edge, be it straight or one of no data askew."""
    fine = raster(tmp_path / "fine.tif", posting=8.0, half=4000.0)
    (tmp_path / "coarse.tif").symlink_to(site_in_hills / "coarse.tif")
    if cut:
        with rasterio.open(fine, "r+") as file:
            heights, places = file.read(1), np.abs(np.arange(1000) - 499.5) * 8.0
            file.write(np.where(places[:, None] + places > 4500.0, np.nan, heights), 1)
    site, _, horizon = made(recipe(FINE, HorizonSpec(dtm="coarse.tif")), tmp_path)
    x, y, z = horizon.mesh.vertices.T
    wrong = z + drop(horizon.mesh.vertices[:, :2], (50.0, 40.0)) - land(x, y) + site.datum_height
    here = (np.maximum(np.abs(x), np.abs(y)) > 60.0) & (np.hypot(x, y) < 8000.0)
    assert np.abs(wrong[here]).max() < 2.0


def test_a_second_model_elsewhere_is_refused(site_in_hills, tmp_path):
    raster(site_in_hills / "small.tif", posting=50.0, half=3000.0)
    dtm = FlatDtm(size_m=(100.0, 80.0), lonlat_deg=(10.0, 0.0))
    with pytest.raises(DataError, match=r"small\.tif does not reach around the site"):
        plan(recipe(dtm, HorizonSpec(dtm="small.tif")), folder=site_in_hills)
    lunar = replace(recipe(dtm, HorizonSpec(dtm="small.tif")), body="moon")
    with pytest.raises(DataError, match="lies on a body of") as caught:
        plan(lunar, folder=site_in_hills)
    assert caught.value.key == ("horizon", "dtm")
    nowhere = FlatDtm(size_m=(100.0, 80.0))
    with pytest.raises(DataError, match="needs a georeferenced site"):
        plan(recipe(nowhere, HorizonSpec(dtm="small.tif")), folder=site_in_hills)


@pytest.mark.parametrize("latitude", [10.0, 33.0, 41.0, 47.0, 60.0, 69.0])
def test_each_sample_near_the_site_counts_where_meridians_converge(tmp_path, latitude):
    """A map of longitudes has more samples in a wide window than around the site."""
    posting, count = 4000.0, 600
    west, north = -0.5 * count * posting, np.radians(latitude) * RADIUS + 0.5 * count * posting
    with rasterio.open(
        tmp_path / "map.tif", "w", driver="GTiff", height=count, width=count, count=1, crs=CRS,
        dtype="float32", transform=rasterio.Affine(posting, 0, west, 0, -posting, north),
    ) as file:  # fmt: skip
        file.write(np.random.default_rng(1).normal(size=(count, count)).astype(np.float32), 1)
    dtm = FlatDtm(size_m=(40.0, 40.0), lonlat_deg=(0.0, latitude))
    site = plan(recipe(dtm, HorizonSpec(dtm="map.tif")), folder=tmp_path)
    nearest = site.surroundings[0]
    assert nearest.to_pixel[0] == pytest.approx(1.0 / posting)
    assert min(nearest.heights.shape) >= 40


@pytest.mark.parametrize("latitude", [78.0, -82.0, 85.0])
def test_rows_are_followed_as_finely_as_they_are_near_a_pole(tmp_path, latitude):
    """Where a window has many columns and few rows; and no window goes on across the pole."""
    rows, step = 720, np.radians(0.25) * RADIUS
    north = rows * step / 2
    with rasterio.open(
        tmp_path / "globe.tif", "w", driver="GTiff", height=rows, width=2 * rows, count=1, crs=CRS,
        dtype="float32", transform=rasterio.Affine(step, 0, -rows * step, 0, -step, north),
    ) as file:  # fmt: skip
        z = 3000.0 * np.sin((np.arange(rows) + 0.5) / 2.0)  # three degrees from ridge to ridge
        file.write(np.tile(z[:, None], (1, 2 * rows)).astype(np.float32), 1)
    dtm = FlatDtm(size_m=(40.0, 40.0), lonlat_deg=(20.0, latitude))
    site = plan(recipe(dtm, HorizonSpec(dtm="globe.tif")), folder=tmp_path)
    assert len(site.surroundings) > 1
    to_pole = np.radians(90.0 - abs(latitude)) * RADIUS
    for level in site.surroundings:
        assert np.ptp(level.heights, axis=0).max() > 5500.0
        assert level.reach < to_pole


def test_the_land_reaches_as_far_as_is_wanted():
    for reach in (0.3, 5.0, 49.0, 3000.0):
        wanted = recipe(FlatDtm(size_m=(32.0, 24.0)), HorizonSpec(reach_m=reach))
        _, _, horizon = made(wanted, Path())
        assert horizon.reach == reach
        west, south = horizon.mesh.vertices[:, :2].min(axis=0)
        assert (west, south) == pytest.approx((-16.0 - reach, -12.0 - reach))


def test_a_summit_is_seen_from_as_far_as_it_stands_above_the_land(tmp_path):
    def mountain(x, y):
        return 2000.0 * np.exp(-(x * x + y * y) / 3000.0**2)

    raster(tmp_path / "fine.tif", posting=25.0, half=6000.0, land=mountain)
    raster(tmp_path / "coarse.tif", posting=1000.0, half=200e3, land=mountain)
    wanted = recipe(FINE, horizon=HorizonSpec(dtm="coarse.tif"))
    site, _, horizon = made(wanted, tmp_path)
    true = np.sqrt(2.0 * site.body.mean_radius * 2000.0)
    assert true < horizon.reach < 2.0 * true
    assert horizon.followed > 0.75 * true


def test_the_mean_of_heights_is_of_those_that_are_followed():
    heights = np.array([[1.0, 2.0], [3.0, 6.0]], np.float32)
    frame = {"to_pixel": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0), "crs": "", "wrap": (0.0, 0.0)}
    for weight, mean in (((1.0, 0.0), 2.0), ((0.0, 0.0), 3.0)):
        weights = np.broadcast_to(np.float32(weight), (2, 2)).copy()
        far = FarHeights(
            heights=heights, weight=weights, reach=1.0, posting=1.0, source="a", **frame
        )
        assert far.mean == mean


def test_a_horizon_is_not_beyond_the_body():
    at_most = HorizonSpec(reach_m=0.2499 * 3389500.0)
    assert plan(recipe(FlatDtm(size_m=(8.0, 8.0)), at_most)).surroundings == ()
    for reach in (0.2501 * 3389500.0, 1e9, 1e12):
        far = HorizonSpec(reach_m=reach)
        with pytest.raises(RecipeError, match="a quarter of the radius of mars") as told:
            plan(recipe(FlatDtm(size_m=(8.0, 8.0)), far))
        assert told.value.key == ("horizon", "reach_m")


def test_flat_ground_goes_on_as_rough_as_it_is_and_then_level(tmp_path):
    layers = (Fractal(hurst=0.8, deviation_1m_m=0.05),)
    site, ground, horizon = made(recipe(FlatDtm(size_m=(64.0, 48.0)), layers=layers), tmp_path)
    height = partial(heights_beyond, ground, horizon)
    east = np.linspace(-30.0, 30.0, 241)
    beyond = height(east, np.full(241, 24.0 + 1.0))
    whole = site.replace(size=(64.0, 56.0))  # the same noise on a larger site
    larger = shape_ground(site=whole, window=whole.window, layers=layers)
    wanted = larger.height_at(east, np.full(241, 25.0))
    assert np.corrcoef(beyond, wanted)[0, 1] > 0.8
    far = height(np.linspace(-500.0, 500.0, 50), np.full(50, 3000.0))
    level = far + drop(np.column_stack([np.linspace(-500, 500, 50), np.full(50, 3000.0)]), (32, 24))
    assert np.ptp(level) < 0.05
    assert "no heights were read" in horizon.told


def test_rocks_beyond_are_as_many_as_the_law_says_and_lie_outside(tmp_path):
    law = Golombek(k=0.05)
    rocks = RocksSpec(
        populations=(PopulationSpec(name="r", size_frequency=law, diameter_m=(0.6, 2.0)),)
    )
    wanted = recipe(FlatDtm(size_m=(64.0, 48.0)), rocks=rocks)
    _, _, horizon = made(wanted, tmp_path)
    belt = 164.0 * 148.0 - 64.0 * 48.0
    expected = belt * (law.cumulative_number(0.6) - law.cumulative_number(2.0))
    assert abs(horizon.rocks - expected) < 4.0 * np.sqrt(expected)
    stones = horizon.mesh.vertices[horizon.ground_vertices :]
    assert np.maximum(np.abs(stones[:, 0]) - 32.0, np.abs(stones[:, 1]) - 24.0).min() > 0.0
    bare = made(recipe(FlatDtm(size_m=(64.0, 48.0)), HorizonSpec(rocks_m=0), rocks=rocks), tmp_path)
    assert bare[2].rocks == 0
    nothing = recipe(FlatDtm(size_m=(64.0, 48.0)), HorizonSpec(reach_m=0))
    assert made(nothing, tmp_path)[2] is None


@pytest.mark.parametrize("seed", range(4))
def test_rocks_lie_on_the_ground_that_a_small_reach_leaves(tmp_path, seed):
    law = Golombek(k=0.1)
    rocks = RocksSpec(
        populations=(PopulationSpec(name="r", size_frequency=law, diameter_m=(0.2, 2.0)),)
    )
    near = recipe(FlatDtm(size_m=(64.0, 64.0)), HorizonSpec(reach_m=3.0), rocks=rocks)
    _, _, horizon = made(replace(near, seed=seed), tmp_path)
    stones = horizon.mesh.vertices[horizon.ground_vertices :]
    assert horizon.rocks > 10
    assert np.abs(stones[:, :2]).max() < 32.0 + horizon.reach


def test_small_rocks_next_to_the_border_have_few_corners(tmp_path):
    law = Golombek(k=0.1)
    rocks = RocksSpec(
        populations=(PopulationSpec(name="r", size_frequency=law, diameter_m=(0.1, 2.0)),)
    )
    _, _, horizon = made(recipe(FlatDtm(size_m=(32.0, 32.0)), rocks=rocks), tmp_path)
    stones = horizon.mesh.vertices[horizon.ground_vertices :]
    assert horizon.rocks > 600
    assert len(stones) < 14_000
    faces = horizon.mesh.faces[horizon.ground_faces :] - horizon.ground_vertices
    joined = coo_matrix((np.ones(len(faces) * 2), (faces[:, [0, 1]].ravel(), faces[:, 1:].ravel())))
    count, which = connected_components(joined, directed=False)
    assert count == horizon.rocks
    corners = np.bincount(which)
    wide = np.array([np.ptp(stones[which == n, :2], axis=0).max() for n in range(count)])
    away = np.array([np.abs(stones[which == n, :2]).max(axis=1).min() - 16.0 for n in range(count)])
    assert corners[wide < 0.4].max() == corners.min() == 12 < corners.max()
    assert wide[away < 2.0].min() < 0.4 < wide[away > 25.0].min()


def test_the_horizon_is_saved_with_the_world(tmp_path):
    world = worlds.with_horizon(worlds.world())
    world.save(tmp_path)
    assert World.load(tmp_path).horizon == world.horizon
    assert all(tile.world.horizon is None for tile in world.tiles(cells=32))


def test_points_within_are_not_beyond(small_world):
    found = worlds.with_horizon(small_world).horizon
    points = random_points(small_world.ground, 10, 5)
    with pytest.raises(ValueError, match="beyond the world's edge"):
        heights_beyond(small_world.ground, found, *points.T)
