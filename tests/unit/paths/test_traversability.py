"""Traversability: planes, steps and rocks with known answers; windows; the map as ROS reads it."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import rasterio
import yaml

from terrain_forge.base import RecipeError
from terrain_forge.making import plan
from terrain_forge.model import Heightfield, Window, rotations
from terrain_forge.paths import (
    IMPASSABLE,
    UNKNOWN,
    PathSpec,
    Spline,
    arrivals,
    highest_step,
    plan_route,
    traversability,
)
from terrain_forge.paths.obstacles import find_obstacles, half_diagonal
from terrain_forge.pipeline import realise
from terrain_forge.recipe.schema import adapter
from terrain_forge.rovers import built_in_rovers, find_rover, resolve_rover
from terrain_forge.truth import rate_world
from terrain_forge.truth.traversability import write_map, write_traversability
from tests.helpers import worlds

ROVER = find_rover("morpheus")
MorpheusSpec, Skid4Spec = built_in_rovers().values()


def ground(height, *, spacing=0.25, size=(24.0, 16.0)):
    """A ground of z = height(east, north)."""
    east = np.arange(-size[0] / 2, size[0] / 2 + spacing / 2, spacing)
    north = np.arange(-size[1] / 2, size[1] / 2 + spacing / 2, spacing)
    z = np.broadcast_to(height(east[None, :], north[:, None]), (len(north), len(east)))
    return Heightfield(elevation=z, spacing=spacing, origin=(east[0], north[0]))


def rate(land, rocks=None, **options):
    rocks = worlds.field(0) if rocks is None else rocks
    return traversability(
        ground=land, rocks=rocks, library=worlds.library(), rover=ROVER, **options
    )


@pytest.mark.parametrize("spacing", [0.05, 0.125, 0.25, 0.5])
def test_a_tilted_plane_has_its_slope_and_no_steps(spacing):
    field = rate(ground(lambda x, y: 0.2 * x - 0.1 * y + 300.0, spacing=spacing, size=(12.0, 8.0)))
    known = field.slope >= 0.0
    assert known.any()
    angle = np.arctan(np.hypot(0.2, 0.1))
    assert np.allclose(field.slope[known], angle, atol=2e-4)  # heights of 300 m in float32
    assert field.step[known].max() < 2e-4
    assert field.clearance.min() == np.float32(2.0 * half_diagonal(ROVER))
    assert field.cost[known].max() == pytest.approx(angle / ROVER.tilt_limit, abs=0.02)


def test_a_plane_steeper_than_the_limit_is_impassable():
    limit = np.tan(ROVER.tilt_limit)
    for factor, passable in ((0.98, True), (1.02, False)):
        rise = factor * limit
        field = rate(ground(lambda x, y, rise=rise: rise * y + 0.0 * x))
        known = field.cost != UNKNOWN
        assert bool((field.cost[known] < 1.0).all()) == passable


@pytest.mark.parametrize("spacing", [0.1, 0.25])
@pytest.mark.parametrize("tilt", [0.0, 0.25])
def test_a_step_has_its_height_whatever_the_slope(spacing, tilt):
    """Also a step that takes as long as the reach of a wheel, along both axes."""
    for height in (0.1, 0.3):
        for axis in (0, 1):
            land = ground(
                lambda x, y, axis=axis, height=height: (
                    tilt * x - 0.1 * y + height * np.clip((y if axis else x) / 0.1, 0.0, 1.0)
                ),
                spacing=spacing,
            )
            field = rate(land)
            assert field.step.max() == pytest.approx(height, abs=1e-5)
            coordinate = np.broadcast_to(
                land.north[:, None] if axis else land.east[None, :], land.shape
            )
            known = field.step >= 0.0
            away = known & (np.abs(coordinate) > 2 * ROVER.wheels[0].radius + 2 * spacing)
            assert field.step[away].max() < 1e-5


def test_a_ramp_and_its_kinks_are_no_steps():
    field = rate(ground(lambda x, y: 0.3 * np.clip(x, 0.0, 4.0) + 0.0 * y))
    assert field.step.max() < 1e-6


def test_clearance_is_the_distance_to_the_step():
    """Lethal is a step above the limit: beside a wall the rover needs its half width."""
    field = rate(ground(lambda x, y: np.where(x > 3.9, 0.5, 0.0) + 0.0 * y))
    row = field.clearance[32]
    lethal = np.flatnonzero(row == 0.0)
    east = field.origin[0] + field.spacing * np.arange(len(row))
    assert abs(east[lethal].mean() - 3.875) < 0.26
    wanted = np.clip(
        (lethal[0] - np.arange(lethal[0])) * field.spacing, None, 2.0 * half_diagonal(ROVER)
    )
    assert np.allclose(row[: lethal[0]], wanted)
    narrow = field.clearance < field.half_width
    known = field.cost != UNKNOWN
    assert np.array_equal(field.cost[known] == 1.0, narrow[known])


def outline_points(field, library, n):
    """Corners of the exposed part of a rock in plan."""
    mesh = library.prototypes[field.prototype[n]].meshes[0]
    corners = field.scale[n] * mesh.vertices @ rotations(field)[n].T
    low, high = corners[:, 2].min(), corners[:, 2].max()
    exposed = corners[:, 2] >= low + field.buried_fraction[n] * (high - low) - 1e-12
    return corners[exposed, :2] + field.position[n, :2]


def test_obstacles_are_the_high_rocks_with_their_outlines():
    rocks, library = worlds.field(40), worlds.library()
    hidden = rocks.replace(collides=np.arange(40) != 7)
    found = find_obstacles(hidden, library, ROVER)
    wanted = (rocks.height > highest_step(ROVER)) & (rocks.id != 7)
    assert wanted[:8].any()
    assert found.id.tolist() == rocks.id[wanted].tolist()
    for n, rock in enumerate(found.id):
        corners = outline_points(rocks, library, rock)
        inside = [found.distances(corner)[n] for corner in corners]
        assert max(inside) < 1e-9
        # The outline touches its outermost corners in each direction that is told.
        away = corners - found.centre[n]
        assert found.support[n, 0] == pytest.approx(away[:, 0].max(), abs=0.05)
        assert found.support[n, 16] == pytest.approx(away[:, 1].max(), abs=0.05)


def test_the_gap_to_a_rock_is_that_between_outline_and_rectangle():
    rocks, library = worlds.field(12), worlds.library()
    found = find_obstacles(rocks, library, ROVER)
    n = int(np.argmax(found.height))
    corners = outline_points(rocks, library, int(found.id[n]))
    angle = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
    distance = np.linspace(0.2, 2.5, 16)
    position = found.centre[n] + distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    heading = 2.3 * angle
    gaps = found.gaps(n, position, heading, ROVER)
    for pose in range(len(angle)):
        cos, sin = np.cos(heading[pose]), np.sin(heading[pose])
        local = (corners - position[pose]) @ np.array([[cos, -sin], [sin, cos]])
        over = np.abs(local) - 0.5 * np.array([ROVER.length, ROVER.width])
        nearest = np.linalg.norm(np.maximum(over, 0.0), axis=1).min()
        if nearest == 0.0:
            assert gaps[pose] < 0.0
        else:
            # Corners of the rock are not all of its outline, and gaps err on the safe side.
            assert nearest - 0.25 < gaps[pose] <= nearest + 1e-9
    assert gaps.min() < 0.0 < gaps.max()


def test_rocks_bar_the_way_and_low_ones_are_steps():
    rocks = worlds.field(40)
    flat = ground(lambda x, y: 0.0 * (x + y))
    field = rate(flat, rocks)
    low = rocks.height <= field.highest_step
    assert 5 < low.sum() < 35
    column = np.rint((rocks.position[:, 0] - flat.origin[0]) / 0.25).astype(int)
    row = np.rint((rocks.position[:, 1] - flat.origin[1]) / 0.25).astype(int)
    assert np.all(field.step[row, column] >= rocks.height.astype(np.float32))
    assert np.all(field.cost[row, column][~low] == 1.0)
    alone = rate(flat, rocks.select(low))
    assert alone.cost.max() < 1.0
    assert rate(flat, rocks.select(low & ~low)).step.max() == 0.0


def test_a_window_has_the_whole_rims_of_rocks_that_stand_on_nodes():
    rocks = worlds.field(40)
    place = 0.2 * np.random.default_rng(2).integers(-30, 31, (40, 2))
    position = np.column_stack([place, rocks.position[:, 2]])
    rocks = rocks.replace(position=position, diameter=np.full(40, 1.0))
    whole = ground(lambda x, y: 0.0 * (x + y), spacing=0.2)
    steps = rate(whole, rocks).step
    for first in range(1, 20):
        west, south = (edge + first * 0.2 for edge in whole.origin)
        part = Heightfield(
            elevation=whole.elevation[first:, first:], spacing=0.2, origin=(west, south)
        )
        found = rate(part, rocks).step
        known = found != UNKNOWN
        assert np.array_equal(found[known], steps[first:, first:][known]), first


def test_threads_change_nothing(use_threads):
    rocks, land = worlds.field(40), worlds.ground()
    one = rate(land, rocks)
    use_threads(3)
    assert rate(land, rocks) == one


RECIPE = {
    "name": "yard",
    "seed": 4,
    "body": "mars",
    "dtm": {"kind": "flat", "size_m": [20, 16]},
    "horizon": {"reach_m": 0},
    "terrain": {"spacing_m": 0.125, "layers": [{"kind": "fractal"}]},
    "rocks": {
        "library": {"shapes": 4, "seed": 3},
        "populations": [
            {
                "name": "all",
                "size_frequency": {"kind": "golombek", "k": 0.25},
                "diameter_m": [0.2, 1.5],
            }
        ],
    },
}


@pytest.fixture(scope="module")
def yard():
    return realise(plan(adapter().validate_python(RECIPE)))


def test_a_window_has_the_wholes_values_where_it_knows_any(yard):
    part = Window(column=40, row=24, columns=90, rows=104)
    whole, cut = rate_world(yard), rate_world(realise(yard.site, part))
    rows, columns = slice(24, 24 + 105), slice(40, 40 + 91)
    for name in ("slope", "step", "cost"):
        one, other = getattr(whole, name)[rows, columns], getattr(cut, name)
        known = other != UNKNOWN
        assert known.sum() > 2000
        assert np.array_equal(one[known], other[known]), name
    # The window ends at the site's north: there the cost is known as near as the whole's.
    assert np.array_equal(cut.cost[-15:, 40] == UNKNOWN, whole.cost[-15:, 80] == UNKNOWN)


def test_the_truth_holds_what_the_rover_meets(yard, tmp_path):
    path = worlds.trajectory()
    path = path.replace(position=path.position * (1.0, 0.8, 1.0))
    files = write_traversability(yard.replace(trajectories=(path,)), tmp_path)
    field = rate_world(yard)
    for name, values in (("slope", np.degrees(field.slope)), ("cost", field.cost)):
        with rasterio.open(tmp_path / f"{name}.tif") as file:
            read = file.read(1, masked=True)
            x, y = file.xy(0, 0)
        assert (x, y) == (-10.0, 8.0)
        known = ~np.ma.getmaskarray(read)[::-1]
        assert np.array_equal(known, getattr(field, name) >= 0.0)
        assert np.allclose(read.data[::-1][known], values[known], atol=3e-3)
    table = np.genfromtxt(tmp_path / "paths" / "arc.csv", delimiter=",", names=True)
    assert len(table) == len(path.time)
    assert np.allclose(table["x_m"], path.position[:, 0], atol=1e-4)
    assert np.all(table["gap_m"] < table["clearance_m"] + 1.0)
    assert {file.name for file in files} >= {"map.pgm", "map.yaml", "step.tif", "arc.csv"}


def test_a_world_without_wheels_has_none(tmp_path):
    assert write_traversability(worlds.world(), tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def occupancy(folder, name):
    """What Nav2's map_server makes of a map: cells from the lower left, and their middles [m].

    After its documented rules for the modes `trinary` and `raw`; image rows run down, the grid's
    run up.
    """
    about = yaml.safe_load((folder / f"{name}.yaml").read_text())
    data = (folder / about["image"]).read_bytes()
    kind, size, most, pixels = data.split(b"\n", 3)
    columns, rows = map(int, size.split())
    assert (kind, most) == (b"P5", b"255")
    image = np.frombuffer(pixels, np.uint8).reshape(rows, columns)[::-1]
    assert about["negate"] == 0
    if about["mode"] == "trinary":
        shade = 1.0 - image / 255.0
        full, free = shade > about["occupied_thresh"], shade < about["free_thresh"]
        cells = np.select([full, free], [100, 0], -1)
    else:
        assert about["mode"] == "raw"
        cells = np.where(image <= 100, image.astype(int), -1)
    x, y, yaw = about["origin"]
    assert yaw == 0.0
    east = x + (np.arange(columns) + 0.5) * about["resolution"]
    north = y + (np.arange(rows) + 0.5) * about["resolution"]
    return cells, east, north


def test_the_map_server_sees_the_cost_where_it_is(tmp_path):
    """The hand-made world is asymmetric: a flip, a transpose or half a cell would show."""
    world = worlds.world(rover=ROVER)
    field = rate_world(world.replace(window=world.site.window))
    write_map(field, tmp_path / "map")
    costs, east, north = occupancy(tmp_path / "map", "cost")
    assert costs.shape == world.ground.shape
    assert np.allclose(east, world.ground.east)
    assert np.allclose(north, world.ground.north)
    unknown, barred = field.cost == UNKNOWN, field.cost == 1.0
    assert 0 < unknown.sum() < unknown.size
    assert np.array_equal(costs == -1, unknown)
    assert np.allclose(costs[~unknown], 100.0 * field.cost[~unknown], atol=0.51)
    cells, *middles = occupancy(tmp_path / "map", "map")
    assert all(map(np.array_equal, middles, (east, north)))
    assert np.array_equal(cells == -1, unknown)
    assert np.array_equal(cells == 100, barred)
    assert np.array_equal(cells == 0, ~unknown & ~barred)
    for transformed in (barred[::-1], barred[:, ::-1], barred[::-1, ::-1]):
        assert not np.array_equal(cells == 100, transformed)


def test_the_recipe_tells_how_high_the_rover_goes():
    """Without its word, the lower of clearance and 0.8 wheel diameters."""
    assert highest_step(ROVER) == pytest.approx(0.8 * 2 * 0.14)
    assert highest_step(find_rover("skid4")) == pytest.approx(0.14)
    careful = resolve_rover(MorpheusSpec(step_limit_m=0.05), Path()).rover
    assert highest_step(careful) == 0.05
    rocks, flat = worlds.field(40), ground(lambda x, y: 0.0 * (x + y))
    field = traversability(ground=flat, rocks=rocks, library=worlds.library(), rover=careful)
    assert field.highest_step == 0.05
    assert np.count_nonzero(rocks.height > 0.05) == len(field.obstacles)
    assert len(field.obstacles) > len(rate(flat, rocks).obstacles)


def test_no_rover_goes_over_more_than_its_wheel():
    with pytest.raises(RecipeError, match=r"0.3 m is more than the diameter .* 0.28 m") as error:
        resolve_rover(MorpheusSpec(step_limit_m=0.3), Path())
    assert error.value.key == ("rover", "step_limit_m")


@pytest.mark.parametrize(
    ("rover", "clearance"),
    [(MorpheusSpec(), 0.15), (Skid4Spec(), 0.14), (MorpheusSpec(step_limit_m=0.05), 0.05)],
)
def test_a_corridor_keeps_no_rock_that_the_rover_cannot_pass(rover, clearance):
    spec = PathSpec(name="a", route=Spline(points_m=((0, 0), (5, 0))), speed_m_s=0.2)
    route = plan_route(spec, rover=resolve_rover(rover, Path()).rover, driven=True)
    assert route.corridor_clearance == pytest.approx(clearance)


def test_many_starts_are_not_all_in_memory_at_once():
    flat = rate(ground(lambda x, y: 0.0 * x))
    barred = np.random.default_rng(1).uniform(size=flat.cost.shape) < 0.02
    field = flat.replace(cost=np.where(barred, IMPASSABLE, flat.cost).astype(flat.cost.dtype))
    few = arrivals(field, seed=3, starts=2_000)
    tracemalloc.start()
    try:
        many = arrivals(field, seed=3, starts=40_000)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert 0.0 < few.straight < few.planned <= 1.0
    assert many.planned == pytest.approx(few.planned, abs=0.05)
    assert peak < 60e6  # 21 MB of it are the random numbers
