"""Planned paths over more ground than is held at once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from terrain_forge.base import RecipeError
from terrain_forge.model import Heightfield
from terrain_forge.paths import PathSpec, Planned, plan_path, traversability
from terrain_forge.paths.far import blocks_of, plan_far
from tests.helpers import worlds
from tests.unit.paths.test_traversability import ROVER, ground, rate

LIMIT = 0.99


class Land:
    """Ground of which no more is rated than is asked for."""

    def __init__(self, whole: Heightfield) -> None:
        self.whole, self.largest = whole, 0

    def blocks(self):
        """Blocks of costs that come in four parts."""
        cost, parts = rate(self.whole).cost, []
        rows, columns = (size // 2 + 3 for size in cost.shape)
        for row in (0, rows):
            for column in (0, columns):
                part = cost[row : row + rows, column : column + columns]
                parts.append((row, column, part))
        return blocks_of(parts, shape=cost.shape, origin=self.whole.origin, spacing=0.25)

    def field(self, bounds):
        low, high = np.reshape(bounds, (2, 2)) - self.whole.origin
        most = np.array(self.whole.shape[::-1]) - 1
        first = np.clip(np.floor(low / 0.25), 0, most).astype(int)
        last = np.clip(np.ceil(high / 0.25), 0, most).astype(int)
        (column, row), (columns, rows) = first, last - first
        part = self.whole.cut(column=column, row=row, columns=columns, rows=rows)
        self.largest = max(self.largest, part.elevation.size)
        return rate(part, cut_sides=(*(first > 0), *(last < most)))


def find(land, start, goal, *, ahead=12.0, **more):
    route = Planned(start_m=start, goal_m=goal, **more)
    spec = PathSpec(name="far", route=route, speed_m_s=0.3)
    return plan_far(
        spec, route, blocks=land.blocks(), field_at=land.field, rover=ROVER, ahead=ahead
    )


def require_drivable(route, land):
    """Each place of the route is one that the rover can pass."""
    field = rate(land.whole)
    column, row = np.rint((route.position - field.origin) / field.spacing).astype(int).T
    assert field.cost[row, column].max() <= np.float32(LIMIT)
    assert (field.clearance[row, column] >= field.half_width).all()


def test_a_window_that_holds_all_gives_the_path_of_one_world():
    land = Land(ground(lambda x, y: 0.4 * np.sin(0.5 * x) * np.cos(0.4 * y)))
    found = find(land, (-9.0, -5.0), (9.0, 4.0), ahead=96.0)
    route = Planned(start_m=(-9.0, -5.0), goal_m=(9.0, 4.0))
    spec = PathSpec(name="far", route=route, speed_m_s=0.3)
    wanted = plan_path(spec, route, field=rate(land.whole), rover=ROVER)
    assert np.array_equal(found.position, wanted.position)


def test_windows_along_a_guide_lead_as_straight():
    land = Land(ground(lambda x, y: 0.02 * x + 0.0 * y, size=(120.0, 24.0)))
    route = find(land, (-55.0, -4.0), (55.0, 5.0), via_m=((0.0, 2.0),))
    legs = math.dist((-55, -4), (0, 2)) + math.dist((0, 2), (55, 5))
    assert route.distance[-1] == pytest.approx(legs, rel=0.005)
    assert np.abs(np.diff(route.heading)).max() < 0.02
    assert np.linalg.norm(route.position - (0.0, 2.0), axis=1).min() < 0.02
    assert land.largest < 0.6 * land.whole.elevation.size


def walls(x, y):
    """Two walls, higher than any rover goes over, with a gap at the other end of each."""
    first = (np.abs(x + 12.0) < 0.3) & (y < 15.0)
    second = (np.abs(x - 12.0) < 0.3) & (y > -15.0)
    return np.where(first | second, 1.0, 0.0)


def test_what_the_guide_does_not_see_is_found_on_the_way():
    """A thin wall leaves free nodes in each block that it crosses."""
    land = Land(ground(walls, size=(64.0, 40.0)))
    route = find(land, (-25.0, -10.0), (25.0, 10.0))
    require_drivable(route, land)
    north = np.interp((-12.0, 12.0), route.position[:, 0], route.position[:, 1])
    assert north[0] > 15.0
    assert north[1] < -15.0


@pytest.mark.parametrize("seed", range(1, 7))
def test_among_many_rocks_it_finds_nearly_the_way_of_one_world(seed):
    random = np.random.default_rng(seed)
    count = int(random.integers(100, 260))
    east, north = random.uniform(-1, 1, (count, 2)).T * [[25.0], [18.0]]
    radius = random.uniform(0.3, 1.2, count)

    def rocks(x, y):
        away = [
            (x - e) ** 2 + (y - n) ** 2 < r * r for e, n, r in zip(east, north, radius, strict=True)
        ]
        return np.any(away, axis=0) * 1.0

    land = Land(ground(rocks, size=(64.0, 40.0)))
    route = Planned(start_m=(-29.0, -8.0), goal_m=(29.0, 8.0))
    spec = PathSpec(name="far", route=route, speed_m_s=0.3)
    wanted = plan_path(spec, route, field=rate(land.whole), rover=ROVER)
    found = find(land, *(place for _, place in route.stops))
    require_drivable(found, land)
    assert found.length < 1.25 * wanted.length


def test_no_way_is_told_with_the_place_that_is_reached():
    land = Land(ground(lambda x, y: np.where(np.abs(x) + 0.0 * y < 0.3, 1.0, 0.0)))
    with pytest.raises(
        RecipeError, match=r"no way was found from \(-9, 0\) m to \(9, 0\) m"
    ) as error:
        find(land, (-9.0, 0.0), (9.0, 0.0))
    assert error.value.key == ("paths", "route", "goal_m")


def test_a_blocked_start_is_told_as_in_one_world():
    rocks = worlds.field(40)
    land = Land(ground(lambda x, y: 0.0 * (x + y)))
    field = traversability(ground=land.whole, rocks=rocks, library=worlds.library(), rover=ROVER)
    land.field = lambda _: field
    place = tuple(float(x) for x in field.obstacles.centre[0])
    with pytest.raises(RecipeError, match="inside rock") as error:
        find(land, place, (9.0, 4.0))
    assert error.value.key[-1] == "start_m"
