"""Planned paths: optimal on the grid, smooth, clear of rocks, and honest where there is none."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from terrain_forge import World, plan, realise
from terrain_forge.base import RecipeError
from terrain_forge.making import draft
from terrain_forge.model import Heightfield, Window
from terrain_forge.paths import PathSpec, Planned, plan_path, planner, survey_paths, traversability
from terrain_forge.paths.lattice import MOVES, bend, cheapest_path, straighten
from terrain_forge.paths.obstacles import Obstacles, half_diagonal
from terrain_forge.paths.planner import node_weights
from terrain_forge.paths.traversability_field import UNKNOWN
from terrain_forge.recipe.schema import adapter
from terrain_forge.rovers import find_rover
from terrain_forge.validation.checks.paths import Paths
from tests.helpers import worlds
from tests.unit.paths.test_traversability import RECIPE, ground

ROVER = find_rover("morpheus")


def graph(weight):
    """The lattice as a sparse graph, made edge by edge from its definition."""
    rows, columns = weight.shape
    edges = []
    for j, i in np.ndindex(rows, columns):
        for down, right in MOVES:
            row, column = j + down, i + right
            if not (0 <= row < rows and 0 <= column < columns):
                continue
            met = [weight[j, i], weight[row, column]]
            if abs(down) == 2:
                met += [weight[j + down // 2, i], weight[j + down // 2, column]]
            elif abs(right) == 2:
                met += [weight[j, i + right // 2], weight[row, i + right // 2]]
            cost = math.hypot(down, right) * float(np.mean(met))
            if abs(down) == abs(right):
                cost += 0.0 * (weight[row, i] + weight[j, column])
            if math.isfinite(cost):
                edges.append((j * columns + i, row * columns + column, cost))
    begin, end, cost = zip(*edges, strict=True)
    return coo_matrix((cost, (begin, end)), shape=(weight.size, weight.size)).tocsr()


@pytest.mark.parametrize("seed", range(0, 12, 2))
def test_the_way_is_as_cheap_as_dijkstras(seed):
    random = np.random.default_rng(seed)
    weight = (1.0 + 9.0 * random.random((17, 23)) ** 3).astype(np.float32)
    weight[random.random(weight.shape) < 0.03 * seed] = np.inf
    weight[0, 0] = weight[-1, -1] = 1.0
    with np.errstate(invalid="ignore"):
        costs = dijkstra(graph(weight), indices=0)
    way = cheapest_path(weight, start=(0, 0), goal=(16, 22))
    assert way.cost == pytest.approx(costs[-1], rel=1e-6)
    if not math.isfinite(way.cost):
        assert way.reached == np.isfinite(costs).sum()
        assert len(way.nodes) == 0
        return
    assert way.nodes[0].tolist() == [0, 0]
    assert way.nodes[-1].tolist() == [16, 22]
    assert np.isfinite(weight[tuple(way.nodes.T)]).all()


def test_most_of_those_maps_have_a_way():
    """So the test above compares ways, not only their absence."""
    found = 0
    for seed in range(12):
        random = np.random.default_rng(seed)
        weight = (1.0 + 9.0 * random.random((17, 23)) ** 3).astype(np.float32)
        weight[random.random(weight.shape) < 0.03 * seed] = np.inf
        weight[0, 0] = weight[-1, -1] = 1.0
        found += len(cheapest_path(weight, start=(0, 0), goal=(16, 22)).nodes) > 0
    assert found >= 7


def smooth_line(weight, nodes):
    line = straighten(weight, nodes, step=1.0)
    return bend(weight, line, np.zeros(len(line), np.bool_))


def test_the_smooth_line_is_straight_where_nothing_is_in_the_way():
    weight = np.ones((60, 60), np.float32)
    way = cheapest_path(weight, start=(3, 5), goal=(50, 40))
    line = smooth_line(weight, way.nodes)
    assert np.array_equal(line[0], (5, 3))
    assert np.array_equal(line[-1], (40, 50))
    straight = np.array([35.0, 47.0]) / math.hypot(35.0, 47.0)
    offset = line - line[0]
    assert np.abs(offset @ [-straight[1], straight[0]]).max() < 1e-6


def test_the_smooth_line_keeps_off_and_is_bent_gently():
    weight = np.ones((60, 60), np.float32)
    weight[20:40, 10:50] = np.inf
    way = cheapest_path(weight, start=(5, 30), goal=(55, 28))
    line = smooth_line(weight, way.nodes)
    column, row = np.rint(line).astype(int).T
    assert np.isfinite(weight[row, column]).all()
    steps = np.diff(line, axis=0)
    turns = np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    assert np.abs(turns).max() < 0.35  # the way over the nodes turns by 0.46 and more at once


def spec_of(route):
    return PathSpec(name="p", route=route, speed_m_s=0.4)


def find(land, start, goal, *, rocks=None, **changes):
    rocks = worlds.field(0) if rocks is None else rocks
    field = traversability(ground=land, rocks=rocks, library=worlds.library(), rover=ROVER)
    route = Planned(start_m=start, goal_m=goal, **changes)
    return plan_path(spec_of(route), route, field=field, rover=ROVER), field


FLAT = ground(lambda x, y: 0.0 * (x + y))


def test_the_plan_goes_around_rocks_with_its_clearance():
    route, field = find(FLAT, (-10.0, -6.0), (10.0, 6.5), rocks=worlds.field(40), margin_m=0.15)
    assert route.position[0] == pytest.approx((-10.0, -6.0))
    assert route.position[-1] == pytest.approx((10.0, 6.5))
    assert len(field.obstacles) > 15
    centre = min(field.obstacles.distances(point).min() for point in route.position[::5])
    assert centre > field.half_width
    for _, _, gaps in field.obstacles.beside(route.position, route.heading, ROVER, 0.0):
        assert gaps.min() > 0.0
    assert route.length < 1.35 * math.dist((-10.0, -6.0), (10.0, 6.5))
    curvature = np.abs(np.diff(route.heading)) / np.diff(route.distance)
    assert curvature.max() < 4.0
    assert np.abs(np.diff(route.heading)).max() < 0.1


def test_the_plan_prefers_gentle_ground_and_passes_where_it_is_told():
    hill = ground(lambda x, y: 2.2 * np.exp(-(x**2 + y**2) / 8.0))
    around, field = find(hill, (-9.0, 0.0), (9.0, 0.0))
    weight = node_weights(field, field.half_width)
    column, row = np.rint((around.position - field.origin) / field.spacing).astype(int).T
    straight = np.arange(*np.rint((np.array([-9.0, 9.0]) + 12.0) / 0.25).astype(int))
    assert weight[row, column].mean() * around.length < weight[32, straight].mean() * 18.0
    assert np.abs(around.position[:, 1]).max() > 0.5
    via, _ = find(FLAT, (-9.0, 0.0), (9.0, 0.0), via_m=((0.0, 5.0), (3.0, -4.0)))
    assert np.abs(np.diff(via.heading) / np.diff(via.distance)).max() < 4.0
    for place in ((0.0, 5.0), (3.0, -4.0)):
        assert np.linalg.norm(via.position - place, axis=1).min() < 0.05


def test_start_and_goal_on_one_node():
    near, _ = find(FLAT, (0.0, 0.0), (0.1, 0.02))
    assert near.length == pytest.approx(math.hypot(0.1, 0.02), rel=1e-6)


def test_corners_that_would_touch_make_it_take_the_wider_way(monkeypatch):
    """As if all curves of the first line touched: the second has room to turn on the spot."""
    ends = (-10.0, -6.0), (10.0, 6.5)
    judge, weigh = Obstacles.first_touched, planner.node_weights
    answers, asked = iter(["rock 1"] * len(planner.KNOTS)), []

    def suspicious(*arguments):
        return next(answers, None) or judge(*arguments)

    def watched(field, needed):
        asked.append(needed)
        return weigh(field, needed)

    monkeypatch.setattr(Obstacles, "first_touched", suspicious)
    monkeypatch.setattr(planner, "node_weights", watched)
    wide, field = find(FLAT, *ends, rocks=worlds.field(40), margin_m=0.0)
    assert asked == [field.half_width, half_diagonal(ROVER)]
    nearest = min(field.obstacles.distances(point).min() for point in wide.position[::5])
    assert nearest > half_diagonal(ROVER) - 0.5 * field.spacing
    monkeypatch.setattr(Obstacles, "first_touched", lambda *_: "rock 1 at its place")
    with pytest.raises(RecipeError, match="too narrow for the rover, which touches rock 1 at its"):
        find(FLAT, *ends, rocks=worlds.field(40), margin_m=0.0)


def test_a_coarse_search_finds_a_way_too_and_the_narrow_gap(monkeypatch):
    wall = ground(lambda x, y: np.where((np.abs(x) < 1.0) & (np.abs(y) > 1.2), 1.0, 0.0))
    fine, _ = find(wall, (-9.0, 3.0), (9.0, 3.0), margin_m=0.0)
    monkeypatch.setattr(planner, "MOST_NODES", 25)
    coarse, field = find(wall, (-9.0, 3.0), (9.0, 3.0), margin_m=0.0)
    assert field.clearance[field.node((0.0, 0.0))] > field.half_width
    assert coarse.length == pytest.approx(fine.length, rel=0.1)
    assert np.abs(np.interp(0.0, coarse.position[:, 0], coarse.position[:, 1])) < 1.2


def refused(*arguments, **changes):
    with pytest.raises(RecipeError) as caught:
        find(*arguments, **changes)
    return str(caught.value), caught.value.key


def test_blocked_places_and_missing_ways_are_told_with_their_reason():
    rocks = worlds.field(40)
    number = int(np.argmax(rocks.height))
    place = tuple(rocks.position[number, :2].tolist())
    message, key = refused(FLAT, place, (10.0, 6.0), rocks=rocks)
    assert f"inside rock {rocks.id[number]} at" in message
    assert key[-1] == "start_m"
    message, key = refused(FLAT, (-10.0, 0.0), (11.8, 0.0))
    assert "over the border" in message
    assert key[-1] == "goal_m"
    steep = ground(lambda x, y: np.where(x > 0.0, 0.9 * x, 0.0) + 0.0 * y)
    message, _ = refused(steep, (-8.0, 0.0), (8.0, 0.0))
    assert "slopes by 42.0°, the rover may be driven on 30.0°" in message
    wall = ground(lambda x, y: np.where(np.abs(x) < 1.0, 1.0, 0.0) + 0.0 * y)
    message, key = refused(wall, (-8.0, 0.0), (8.0, 0.0))
    assert "no way leads from (-8, 0) m to (8, 0) m" in message
    assert "m², nearest at (-1." in message
    assert key[-1] == "goal_m"
    message, key = refused(wall, (-8.0, 0.0), (-4.0, 0.0), via_m=((-1.2, 0.0),))
    assert "from a step above 0.22 m in the ground" in message
    assert key[-1] == "via_m"


def planned_recipe(**changes):
    route = {"kind": "planned", "start_m": [-8.0, -6.0], "goal_m": [8.0, 6.0]}
    path = {"name": "found", "route": route, "speed_m_s": 0.4}
    fixed = {"name": "fixed", "route": {"kind": "loop", "length_m": 12.0}, "speed_m_s": 0.4}
    return adapter().validate_python({**RECIPE, "paths": [path | changes, fixed]})


@pytest.fixture(scope="module")
def world():
    return realise(plan(planned_recipe()))


def test_a_planned_path_is_part_of_the_whole_world_only(world, tmp_path):
    assert [path.name for path in world.trajectories] == ["found", "fixed"]
    found = world.trajectories[0]
    assert found.position[-1, :2] == pytest.approx((8.0, 6.0), abs=1e-6)
    again = realise(world.site)
    assert again.trajectories == world.trajectories
    window = realise(world.site, Window(column=0, row=0, columns=160, rows=127))
    assert [path.name for path in window.trajectories] == ["fixed"]
    world.save(tmp_path)
    assert World.load(tmp_path) == world


def test_rocks_stay_as_they_are_without_the_planned_path(world):
    recipe = planned_recipe()
    without = replace(recipe, paths=recipe.paths[1:])
    assert realise(plan(without)).field == world.field


def test_places_at_the_border_are_refused_before_the_ground(world):
    field = traversability(
        ground=world.ground, rocks=world.field, library=world.library, rover=ROVER
    )
    far = 0.5 * world.site.size[0]
    met = set()
    for x in np.linspace(far - 3.0, far, 61).round(3).tolist():
        unknown = bool(field.cost[field.node((x, 0.0))] == UNKNOWN)
        met.add(unknown)
        route = {"kind": "planned", "start_m": [-8.0, 0.0], "goal_m": [x, 0.0]}
        with pytest.raises(RecipeError, match="over the border") if unknown else nullcontext():
            draft(planned_recipe(route=route))
    assert met == {False, True}


def path_checks(world):
    paths = Paths()
    return paths.checks(SimpleNamespace(world=world)), paths.report()["paths"]


def test_the_planned_path_keeps_every_limit(world):
    checks, figures = path_checks(world)
    mine = [check for check in checks if check.name.startswith("path found")]
    assert len(mine) == 4
    assert all(check.passed for check in mine)
    assert sum(check.limit is not None for check in mine) == 3
    assert figures[0]["smallest_gap_m"] > 0.0
    assert figures[0]["rocks_in_its_way"] == []


def test_a_path_through_a_rock_fails_with_the_rock_and_its_place(world):
    rocks = world.field
    number = int(np.argmax(np.where(np.hypot(*rocks.position[:, :2].T) < 2.5, rocks.height, 0.0)))
    assert rocks.height[number] > 0.25
    place = rocks.position[number, :2]
    path = worlds.trajectory()
    away = np.linspace(-2.5, 2.5, len(path.time))
    track = np.stack([place[0] + away, 0 * away + place[1], 0 * away], -1)
    through = path.replace(name="found", position=track, rpy=0.0 * path.rpy)
    checks, figures = path_checks(world.replace(trajectories=(through,)))
    check = next(c for c in checks if "rocks in its way" in c.name)
    assert not check.passed
    assert f"rock {rocks.id[number]} at ({place[0]:.2f}, {place[1]:.2f}) m" in check.note
    assert rocks.id[number] in figures[0]["rocks_in_its_way"]
    # The same track as an actor's alone is told, not judged.
    free, _ = path_checks(world.replace(trajectories=(through.replace(name="fixed"),)))
    assert all(check.passed for check in free)


def test_tilt_and_steps_under_the_wheels_are_found(world):
    path = worlds.trajectory()
    away = np.linspace(-3.0, 3.0, len(path.time))
    track = np.stack([away, 0 * away, 0 * away], -1)
    through = path.replace(name="found", position=track, rpy=0.0 * path.rpy)
    axes = world.ground.east[None, :], world.ground.north[:, None]
    nothing = world.field.select(np.arange(0))
    for height, low, high in (
        (0.3 * axes[0] + 0.0 * axes[1], (16.69, 0.0), (16.71, 1e-5)),
        (np.where(axes[0] > 0.3, 0.31, 0.0) + 0.0 * axes[1], (8.0, 0.309), (25.0, 0.311)),
    ):
        land = Heightfield(elevation=height, spacing=0.125, origin=world.ground.origin)
        changed = world.replace(ground=land, field=nothing, trajectories=(through,))
        met = survey_paths(changed)["found"]
        assert low[0] < math.degrees(met.tilt.max()) < high[0]
        assert low[1] <= met.step.max() < high[1]
        checks, _ = path_checks(changed)
        assert all(check.passed for check in checks) == (high[1] < 0.2)


def test_a_driven_path_may_not_start_within_a_rock(tmp_path):
    """Not even in one of the user's own, which no exclusion_zone moves away."""
    (tmp_path / "own.csv").write_text("x_m,y_m,diameter_m\n-4,1,1.2\n")
    route = {"kind": "polyline", "points_m": [[-4, 1], [4, 1]]}
    recipe = {**RECIPE, "paths": [{"name": "a", "route": route, "speed_m_s": 0.2}]}
    own = {"name": "own", "file": "own.csv", "buried_fraction": [0.1, 0.2]}
    recipe["rocks"] = {"library": {"shapes": 4, "seed": 3}, "lists": [own]}
    realise(plan(adapter().validate_python(recipe), folder=tmp_path))  # an actor may
    recipe["validate"] = {"drive": "a"}
    with pytest.raises(RecipeError, match=r"starts at \(-4.00, 1.00\) m within rock") as caught:
        realise(plan(adapter().validate_python(recipe), folder=tmp_path))
    assert caught.value.key == ("paths", 0, "route")
