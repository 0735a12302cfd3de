"""Where every export is measured: points on the ground, rocks, and balls to let down."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, mix, stage_key, uniforms
from terrain_forge.model import Heightfield, RockField, World

ROCKS = 200
"""How many rocks are looked at."""
BALLS = 12
"""How many balls are let down."""
DROP = 0.02
"""How far above its place of rest a ball begins [m]."""
SETTLING = 3.0
"""How long it may take to rest [s]."""
BALL_RADIUS = 0.2
"""Radius of the balls where the world's rover has no wheels [m]."""
_DYNAMIC = 50
_PLACES = 1000


@dataclass(frozen=True, kw_only=True, eq=False)
class Balls:
    """Balls of a wheel's radius on vertical sliders."""

    radius: float
    """[m]."""
    xy: Array
    """Where the sliders stand [m], shape [balls, 2]."""
    rest: Array
    """Heights at which the centres come to rest on the triangulated ground [m], shape [balls]."""

    @property
    def start(self) -> Array:
        """Where the centres begin [m], shape [balls, 3]."""
        return np.column_stack([self.xy, self.rest + DROP])


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """What is measured of a world in every consumer."""

    world: World
    """The world."""
    points: Array
    """Points on the ground [m], shape [points, 2]."""
    rows: NDArray[np.int64]
    """Rows of the rocks that are looked at, shape [rocks]."""
    balls: Balls
    """Balls that are let down, away from all rocks."""
    quick: bool = False
    """Whether a build asks: for the ground, the rocks that are looked at as they are touched,
    gravity and the replays between samples alone, and soon. There are no balls."""

    @cached_property
    def dynamic(self) -> NDArray[np.int64]:
        """Rows of the dynamic rocks whose masses are compared, of a quick sample's rocks or all."""
        dynamic = self.world.field.dynamic
        return self.rows[dynamic[self.rows]] if self.quick else np.flatnonzero(dynamic)

    @cached_property
    def rocks(self) -> frozenset[int]:
        """Ids of the rocks that are looked at."""
        return frozenset(self.world.field.id[self.rows].tolist())

    @cached_property
    def reach(self) -> Array:
        """How far each of these rocks reaches from its centre of mass at most [m], [rocks]."""
        return _reaches(self.world, self.world.field.select(self.rows))

    @cached_property
    def _marked(self) -> tuple[NDArray[np.bool_], float]:
        """Cells of the ground that these rocks may reach, rows running north, and their size."""
        west, south, east, north = self.world.ground.bounds
        cell = max(east - west, north - south) / 2048
        shape = int((north - south) / cell) + 2, int((east - west) / cell) + 2
        marked = np.zeros(shape, np.bool_)
        for (x, y, _), reach in zip(
            self.world.field.position[self.rows].tolist(), self.reach.tolist(), strict=True
        ):
            low = int((y - reach - south) / cell), int((x - reach - west) / cell)
            high = int((y + reach - south) / cell) + 2, int((x + reach - west) / cell) + 2
            marked[max(low[0], 0) : high[0], max(low[1], 0) : high[1]] = True
        return marked, cell

    def near(self, places: Array) -> NDArray[np.bool_]:
        """Which places, shape [n, 3], may belong to one of these rocks, seen from above, [n]."""
        marked, cell = self._marked
        across = (places[:, :2] - self.world.ground.bounds[:2]) / cell
        row, column = np.clip(across.astype(np.int64)[:, ::-1], 0, np.array(marked.shape) - 1).T
        return np.asarray(marked[row, column])


def draw_sample(world: World, *, points: int, quick: bool = False) -> Sample:
    """The sample of a world, drawn by its site's seed."""
    return Sample(
        world=world,
        points=random_points(world, points),
        rows=_rock_rows(world),
        balls=_balls(world, most=0 if quick else BALLS),
        quick=quick,
    )


def random_points(world: World, count: int) -> Array:
    """Points all over the world's ground, drawn by the site's seed, shape [count, 2] [m]."""
    west, south, east, north = world.ground.bounds
    key = stage_key(world.site.seed, "agreement")
    unit = np.array([uniforms(np.uint64(mix(key, n)), 2) for n in range(count)])
    return np.asarray((west, south) + unit * (east - west, north - south))


def _rock_rows(world: World) -> NDArray[np.int64]:
    """Rocks evenly over all, dynamic ones, and the largest."""
    rows = np.arange(len(world.field))
    largest = np.argsort(world.field.diameter, kind="stable")[-1:]
    dynamic = np.flatnonzero(world.field.dynamic)
    most = ROCKS - _DYNAMIC - 1 if len(dynamic) else ROCKS - 1
    return np.unique(np.concatenate([_spread(rows, most), _spread(dynamic, _DYNAMIC), largest]))


def _spread(rows: NDArray[np.intp], most: int) -> NDArray[np.int64]:
    places = np.linspace(0, len(rows) - 1, min(most, len(rows))).round().astype(np.int64)
    return rows[places].astype(np.int64)


def _balls(world: World, *, most: int) -> Balls:
    """Balls where no rock is near; fewer where there are no such places."""
    radius = world.rover.wheels[0].radius if world.rover.wheels else BALL_RADIUS
    west, south, east, north = world.ground.bounds
    low, high = np.array([west, south]) + 2 * radius, np.array([east, north]) - 2 * radius
    drawn = uniforms(stage_key(world.site.seed, "balls"), 2 * _PLACES).reshape(-1, 2)
    xy = low + drawn * (high - low) if most and np.all(low < high) else np.zeros((0, 2))
    free = free_of_rocks(world, xy, margin=radius)
    chosen: list[Array] = []
    for place in xy[free]:
        if len(chosen) == most:
            break
        if all(np.linalg.norm(place - other) > 3 * radius for other in chosen):
            chosen.append(place)
    rest = [resting_height(world.ground, x, y, radius) for x, y in chosen]
    return Balls(radius=radius, xy=np.reshape(chosen, (-1, 2)), rest=np.array(rest))


def free_of_rocks(world: World, xy: Array, *, margin: float) -> NDArray[np.bool_]:
    """Which places, shape [n, 2], no rock reaches within a margin [m], seen from above."""
    from scipy.spatial import cKDTree

    free = np.ones(len(xy), np.bool_)
    for field in (world.field, world.neighbours):
        if len(field) and len(xy):
            reach = _reaches(world, field) + margin
            for places in cKDTree(xy).query_ball_point(field.position[:, :2], reach):
                free[places] = False
    return free


def _reaches(world: World, rocks: RockField) -> Array:
    """How far each rock reaches from its centre of mass at most [m], shape [rocks]."""
    shapes = world.library.prototypes
    radii = [np.linalg.norm(shape.meshes[0].vertices, axis=1).max() for shape in shapes]
    return np.asarray(np.array(radii)[rocks.prototype] * rocks.scale)


def resting_height(ground: Heightfield, x: float, y: float, radius: float) -> float:
    """Height of the centre of a ball that is let down onto the triangulated ground [m].

    The ball hangs on whichever point of the ground within its outline reaches highest into it:
    found on a grid, then on a finer one around the place.
    """
    step, offset, best = radius / 100, np.zeros(2), 0.0
    for _ in range(2):
        line = np.arange(-100, 101) * step
        east, north = np.meshgrid(line + offset[0], line + offset[1])
        square = east**2 + north**2
        inside = square < radius**2
        touch = ground.height_at(x + east[inside], y + north[inside])
        touch += np.sqrt(radius**2 - square[inside])
        place = int(touch.argmax())
        best = float(touch[place])
        offset = np.array([east[inside][place], north[inside][place]])
        step /= 50
    return best
