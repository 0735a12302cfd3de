"""Planned paths over more ground than is held at once: coarse to fine.

A path over blocks of many nodes guides the search. Along it the way is found in windows of full
detail, each from where the last one was left to what is ahead on the guide; only the first part of
what is found is kept. Where a window has no way, the first block of the guide that cannot be
reached is barred, and the search goes on from where another guide leaves this one; at last windows
look twice as far.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Key, RecipeError, Record
from terrain_forge.model import Route, Rover
from terrain_forge.paths.lattice import bend, cheapest_path
from terrain_forge.paths.obstacles import Obstacles
from terrain_forge.paths.planner import (
    DISLIKE,
    MOST_NODES,
    Line,
    Place,
    Weight,
    leg_between,
    node_weights,
    nodes_of,
    places_of,
    require_free,
    smooth_route,
)
from terrain_forge.paths.spec import PathSpec, Planned
from terrain_forge.paths.traversability_field import IMPASSABLE, Traversability

Bounds = tuple[float, float, float, float]
"""West, south, east and north [m]."""

_BESIDE_GUIDE, _LEAST_BESIDE = 0.25, 8.0
"""Ground beside the guide in a window, over how far it looks; and at least [m]."""
_WIDER = 2.0
"""How much farther windows look where no way was found."""
_KEPT = 0.5
"""Part of the way in a window that is kept."""
_BENT = 64
"""Points of the kept line that are made smooth once more with what follows."""
_DETOURS = 200
"""Blocks that may be barred for one leg."""
_BESIDE = 3.0
"""Obstacles farther from the line than this, and three rovers, cannot be touched [m]."""
_SMALLEST = 8
"""Nodes of a block each way at least."""
_LEAST_SHARE = 0.05
"""A block is taken to have at least this part of nodes that can be passed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Blocks(Record):
    """What it costs to cross blocks of a ground, so many nodes each way."""

    origin: Place
    """East and north of the middle of block [0, 0] [m]."""
    spacing: float
    """Size of a block [m]."""
    weight: Weight
    """Cost of a metre, from 1; 0 where nothing can be passed, shape [rows, columns]."""

    def __post_init__(self) -> None:
        self.freeze("weight", np.float32, ("rows", "columns"))

    def at(self, place: Place) -> tuple[int, int]:
        """Row and column of the block of a place [m]."""
        rows, columns = self.weight.shape
        column, row = (
            math.floor((x - first) / self.spacing + 0.5)
            for x, first in zip(place, self.origin, strict=True)
        )
        return min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)


def blocks_of(
    costs: Iterable[tuple[int, int, NDArray[np.float32]]],
    *,
    shape: tuple[int, int],
    origin: Place,
    spacing: float,
) -> Blocks:
    """The blocks of a ground whose costs come in parts; dearer the fewer of their nodes are free.

    Args:
        costs: Row and column of each part's first node, and its costs.
        shape: Rows and columns of the ground's nodes.
        origin: East and north of its first node [m].
        spacing: Distance of its nodes [m].
    """
    side = _SMALLEST
    while max(shape) > side * MOST_NODES:
        side *= 2
    total, free = np.zeros((2, *(-(-count // side) for count in shape)), np.int64)
    dear = np.zeros(total.shape)
    for row, column, cost in costs:
        passed = (cost >= 0.0) & (cost < IMPASSABLE)
        numbers = [
            (first + np.arange(count)) // side
            for first, count in zip((row, column), cost.shape, strict=True)
        ]
        place = tuple(slice(index[0], index[-1] + 1) for index in numbers)
        down, right = (np.flatnonzero(np.diff(index, prepend=-1)) for index in numbers)
        squares = np.where(passed, cost.astype(np.float64) ** 2, 0.0)
        for sums, values in ((total, np.ones_like(passed)), (free, passed), (dear, squares)):
            values = values.astype(sums.dtype)
            sums[place] += np.add.reduceat(np.add.reduceat(values, down, 0), right, 1)
    share = np.maximum(free / np.maximum(total, 1), _LEAST_SHARE)
    weight = (1.0 + DISLIKE * dear / np.maximum(free, 1)) / share
    middle = 0.5 * (side - 1) * spacing
    return Blocks(
        origin=(origin[0] + middle, origin[1] + middle),
        spacing=side * spacing,
        weight=np.where(free > 0, weight, 0.0).astype(np.float32),
    )


def plan_far(
    spec: PathSpec,
    route: Planned,
    *,
    blocks: Blocks,
    field_at: Callable[[Bounds], Traversability],
    rover: Rover,
    ahead: float,
    key: Key = ("paths",),
) -> Route:
    """The planned route of a path over ground that is looked at window by window.

    Args:
        spec: The path.
        route: Where it goes.
        blocks: The whole ground, coarse.
        field_at: What the ground around bounds means to the rover, at least as far as they reach
            and the ground does.
        rover: Who drives.
        key: The path's place in the recipe.
        ahead: How far along the guide a window looks [m].

    Raises:
        RecipeError: as `plan_path`.
    """
    key = (*key, "route")
    turning = require_stops(route, field_at, rover=rover, key=key)
    clearances = 0.5 * rover.width + route.margin_m, turning

    def line(clearance: float, *, ahead: float) -> Line:
        walk = _Walk(
            blocks=blocks, field_at=field_at, needed=clearance, ahead=ahead,
            beside=_BESIDE + 3.0 * rover.length, line=np.array([route.stops[0][1]]),
        )  # fmt: skip
        for (_, begin), (name, end) in pairwise(route.stops):
            walk.go(begin, end, (*key, name))
        return walk.line, walk.fixed, walk.obstacles()

    with suppress(RecipeError):
        return smooth_route(spec, partial(line, ahead=ahead), clearances, rover, key)
    return smooth_route(spec, partial(line, ahead=_WIDER * ahead), clearances, rover, key)


def require_stops(
    route: Planned, field_at: Callable[[Bounds], Traversability], *, rover: Rover, key: Key
) -> float:
    """Refuse places of a route that are blocked; returns the clearance to turn on the spot [m].

    Raises:
        RecipeError: says by what.
    """

    def around(place: Place) -> Traversability:
        return field_at(_around(np.array([place]), _LEAST_BESIDE))

    return require_free(route, around, rover=rover, key=key)


@dataclass(frozen=True, kw_only=True)
class _Step:
    """How far the line was after a window."""

    there: int
    """The last block of the guide that the window saw."""
    at: int
    """The block of the guide at which the line then ended."""
    length: int
    """Points of the line."""


@dataclass(kw_only=True, eq=False)
class _Walk:
    """The line while it is found."""

    blocks: Blocks
    field_at: Callable[[Bounds], Traversability]
    needed: float
    ahead: float
    beside: float
    line: Array
    """Points so far."""
    fixed: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(1, np.bool_))
    met: list[Obstacles] = field(default_factory=list)

    def go(self, begin: Place, end: Place, key: Key) -> None:
        """Add the leg between two stops.

        Raises:
            RecipeError: if there is no way.
        """
        weight, first = np.array(self.blocks.weight), len(self.line)
        weight[weight == 0.0] = np.inf
        for place in (begin, end):  # the rover can be there, whatever else is in its block
            row, column = self.blocks.at(place)
            weight[row, column] = min(weight[row, column], np.float32(1.0 / _LEAST_SHARE))
        guide, steps = np.zeros((0, 2), np.int64), [_Step(there=-1, at=0, length=first)]
        for _ in range(_DETOURS):
            path = cheapest_path(weight, start=self.blocks.at(begin), goal=self.blocks.at(end))
            if not len(path.nodes):
                break
            # What was found where this guide is the last one's stays.
            common = min(len(guide), len(path.nodes))
            same = (guide[:common] == path.nodes[:common]).all(axis=1)
            common = int(np.argmin(same)) if not same.all() else common
            guide = path.nodes
            while steps[-1].there >= common:
                steps.pop()
            length = steps[-1].length
            self.line, self.fixed = self.line[:length], self.fixed[:length]
            barred = self._follow(guide, end, steps, key)
            if barred is None:
                self.fixed[-1] = True
                return
            weight[barred] = np.inf
        x, y = _middles(self.blocks, np.array([path.nearest]))[0]
        raise RecipeError(
            f"no way was found from ({begin[0]:g}, {begin[1]:g}) m to ({end[0]:g}, {end[1]:g}) m: "
            f"the rover comes no nearer than about ({x:.0f}, {y:.0f}) m; via_m lead it "
            "elsewhere",
            key=key,
        )

    def _follow(
        self, guide: NDArray[np.int64], end: Place, steps: list[_Step], key: Key
    ) -> tuple[int, int] | None:
        """Find the way along blocks, on from the last step; the one to bar where there is none."""
        places, at = _middles(self.blocks, guide), steps[-1].at
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
        for _ in range(4 * len(guide) + 4):
            there = min(int(np.searchsorted(along, along[at] + self.ahead)), len(guide) - 1)
            last = there == len(guide) - 1
            tail = min(_BENT, len(self.line) - 1)
            near = np.vstack([places[at : there + 1], self.line[-1 - tail :]])
            land = self.field_at(_around(near, max(_BESIDE_GUIDE * self.ahead, _LEAST_BESIDE)))
            weight = node_weights(land, self.needed)
            goal, barred = self._goal(land, weight, guide[at : there + 1], end if last else None)
            if goal is None:
                return barred
            here = (float(self.line[-1, 0]), float(self.line[-1, 1]))
            if goal == here:
                return None if last else (int(guide[there][0]), int(guide[there][1]))
            self._keep(land, weight, leg_between(land, weight, (here, goal), key), last)
            if last:
                return None
            gap = np.linalg.norm(places[at : there + 1] - self.line[-1], axis=1)
            at += int(np.argmin(gap))
            steps.append(_Step(there=there, at=at, length=len(self.line)))
        return int(guide[there][0]), int(guide[there][1])

    def _goal(
        self, land: Traversability, weight: Weight, guide: NDArray[np.int64], end: Place | None
    ) -> tuple[Place | None, tuple[int, int] | None]:
        """A place in the last block that is reached from the line's end; else the block to bar."""
        from scipy.ndimage import label

        ways, _ = label(np.isfinite(weight))
        own = ways == ways[land.node((float(self.line[-1, 0]), float(self.line[-1, 1])))]
        own &= np.isfinite(weight)
        if end is not None and own[land.node(end)]:
            return end, None
        middles = _middles(self.blocks, guide)
        reach = 0.5 * self.blocks.spacing
        inside = [_nodes_within(land, own, middle, reach) for middle in middles]
        if end is None and len(inside[-1]):
            there = places_of(land, inside[-1])
            x, y = there[np.argmin(np.linalg.norm(there - middles[-1], axis=1))].tolist()
            return (x, y), None
        missing = (n for n, nodes in enumerate(inside) if n and not len(nodes))
        missed = next(missing, len(guide) - 1)
        return None, (int(guide[missed][0]), int(guide[missed][1]))

    def _keep(self, land: Traversability, weight: Weight, found: Array, last: bool) -> None:
        """Add the first part of what was found, or all of it, and make it smooth."""
        tail = min(_BENT, len(self.line) - 1)
        points = np.concatenate([self.line[len(self.line) - 1 - tail :], found[1:]])
        stays = np.zeros(len(points), np.bool_)
        stays[: tail + 1] = self.fixed[len(self.line) - 1 - tail :]
        points = places_of(land, bend(weight, nodes_of(land, points), stays))
        if not last:
            kept = tail + 1 + max(math.ceil(_KEPT * (len(found) - 1)), 1)
            points, stays = points[:kept], stays[:kept]
        begin = len(self.line) - 1 - tail
        self.line = np.concatenate([self.line[:begin], points])
        self.fixed = np.concatenate([self.fixed[:begin], stays])
        self.met.append(_near(land.obstacles, points, self.beside))

    def obstacles(self) -> Obstacles:
        """All obstacles beside the line, by their numbers."""
        ids, first = np.unique(np.concatenate([one.id for one in self.met]), return_index=True)
        rest = {
            name: np.concatenate([getattr(one, name) for one in self.met])[first]
            for name in ("centre", "height", "support")
        }
        return Obstacles(id=ids, **rest)


def _near(obstacles: Obstacles, points: Array, reach: float) -> Obstacles:
    """The obstacles within a distance of a line's points."""
    from scipy.spatial import cKDTree

    if not len(obstacles):
        return obstacles
    gap, _ = cKDTree(points).query(obstacles.centre)
    near = gap <= reach + obstacles.support.max(axis=1)
    return Obstacles(
        id=obstacles.id[near],
        centre=obstacles.centre[near],
        height=obstacles.height[near],
        support=obstacles.support[near],
    )


def _middles(blocks: Blocks, nodes: NDArray[np.int64]) -> Array:
    """East and north of the middles of blocks, given by row and column [m]."""
    return np.asarray(np.asarray(blocks.origin) + blocks.spacing * nodes[:, ::-1])


def _around(points: Array, margin: float) -> Bounds:
    (west, south), (east, north) = points.min(axis=0), points.max(axis=0)
    return float(west - margin), float(south - margin), float(east + margin), float(north + margin)


def _nodes_within(
    land: Traversability, chosen: NDArray[np.bool_], middle: Array, reach: float
) -> NDArray[np.int64]:
    """Columns and rows of chosen nodes in a square around a place [m]."""
    low = np.maximum(np.ceil((middle - reach - land.origin) / land.spacing), 0).astype(np.int64)
    high = np.floor((middle + reach - land.origin) / land.spacing).astype(np.int64)
    rows, columns = np.nonzero(chosen[low[1] : high[1] + 1, low[0] : high[0] + 1])
    return np.stack([columns, rows], -1) + low
