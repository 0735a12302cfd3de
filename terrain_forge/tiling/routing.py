"""Paths of a site in tiles: planned from coarse to fine, laid on ground that is made on the way."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, Key, Stopwatch
from terrain_forge.model import Route, Site, TileGrid, Trajectory, Window, World
from terrain_forge.paths import (
    Blocks,
    PathSpec,
    Planned,
    Traversability,
    block_weights,
    known_within,
    make_trajectory,
    plan_far,
    planned_routes,
    squared_costs,
    write_trajectories,
)
from terrain_forge.rovers import rover_of
from terrain_forge.terrain import shape_ground
from terrain_forge.tiling.making import world_of
from terrain_forge.tiling.order import TileOrder
from terrain_forge.truth import rate_world, write_surroundings

_SMALLEST_BLOCK, _MOST_BLOCKS = 8, 1100
"""Nodes of a block each way, and blocks of a site."""
AHEAD, _AHEAD_CELLS = 96.0, 400
"""How far a window looks along a path [m], and at most [cells]."""
_SNAP = 128
"""Windows begin and end at multiples of so many cells, so that neighbouring ones are the same."""
_PATCH = 256
"""Cells each way of the ground that is made at once under a path."""
_KEPT = 6
"""Windows, and patches of ground, that are kept."""
Bounds = tuple[float, float, float, float]


def reach_of(site: Site) -> float:
    """How far a window looks along a path [m]."""
    return min(AHEAD, _AHEAD_CELLS * site.spacing)


def lay_paths(order: TileOrder, watch: Stopwatch) -> tuple[Trajectory, ...]:
    """Find and write the paths of a site whose tiles are there: paths/, truth/paths/.

    Raises:
        RecipeError: if a planned path cannot be found.
    """
    site, rover = order.site, rover_of(order.site)
    land = Land(order)

    def found(spec: PathSpec, route: Planned, key: Key) -> Route:
        watch(f"paths: planning {spec.name}")
        return plan_far(
            spec, route, blocks=blocks(), field_at=land.field, rover=rover, key=key,
            ahead=reach_of(site),
        )  # fmt: skip

    blocks = lru_cache(partial(read_blocks, order))
    routes = {route.name: route for route in site.routes}
    routes |= planned_routes(site, rover, found)
    made = []
    for spec in site.recipe.paths:
        watch(f"paths: {spec.name}")
        path = make_trajectory(
            routes[spec.name], spec=spec, ground=FarGround(site), rover=rover, seed=site.seed
        )
        made.append(path)
        if rover.wheels:
            write_surroundings(path, land.along(path), order.out / "truth/paths")
    if made:
        write_trajectories(tuple(made), order.out / "paths")
    return tuple(made)


class Land:
    """A site's worlds and what they mean to its rover, window by window; the last ones are kept."""

    def __init__(self, order: TileOrder) -> None:
        self._order, self._site = order, order.site
        self._border = known_within(rover_of(order.site), order.site.spacing)
        self._kept = dict[tuple[int, ...], tuple[World, Traversability]]()

    def field(self, bounds: Bounds) -> Traversability:
        """What is known around bounds [m]."""
        return self.there(self.window(bounds))[1]

    def there(self, window: Window) -> tuple[World, Traversability]:
        """The world of a window, rated."""
        key = window.column, window.row, window.columns, window.rows
        if key not in self._kept:
            world = world_of(self._order, window)
            self._kept[key] = world, rate_world(world)
            if len(self._kept) > _KEPT:
                self._kept.pop(next(iter(self._kept)))
        return self._kept[key]

    def window(self, bounds: Bounds) -> Window:
        """Cells that hold bounds [m], as far as the site goes, all of whose costs are known."""
        site, whole = self._site, self._site.window
        edges = site.west, site.south, site.west, site.south
        low_east, low_north, high_east, high_north = (
            (value - edge) / site.spacing for value, edge in zip(bounds, edges, strict=True)
        )
        first = [
            max(int(np.floor((low - self._border) / _SNAP)) * _SNAP, 0)
            for low in (low_east, low_north)
        ]
        end = [
            min(int(np.ceil((high + self._border) / _SNAP)) * _SNAP, most)
            for high, most in ((high_east, whole.columns), (high_north, whole.rows))
        ]
        return Window(
            column=first[0], row=first[1], columns=end[0] - first[0], rows=end[1] - first[1]
        )

    def along(self, path: Trajectory) -> Iterator[tuple[slice, World, Traversability]]:
        """Parts of a path, one after the other, each with the world around it."""
        for part in parts_of(path, reach_of(self._site)):
            place = path.position[part, :2]
            (west, south), (east, north) = place.min(axis=0), place.max(axis=0)
            room = 0.25 * reach_of(self._site)
            window = self.window((west - room, south - room, east + room, north + room))
            yield part, *self.there(window)


def parts_of(path: Trajectory, length: float) -> Iterator[slice]:
    """Slices of a path's samples, each of at most about a length [m]."""
    steps = np.linalg.norm(np.diff(path.position[:, :2], axis=0), axis=1)
    number = (np.concatenate([[0.0], np.cumsum(steps)]) // length).astype(np.int64)
    begins = np.flatnonzero(np.diff(number, prepend=-1))
    ends = [*begins[1:].tolist(), len(number)]
    for begin, end in zip(begins.tolist(), ends, strict=True):
        yield slice(begin, end)


class FarGround:
    """The bare ground of a site of any size, made where it is asked for."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._grid = TileGrid.of(site, _PATCH)

    def height_at(self, east: Array, north: Array) -> Array:
        """Heights [m] at places [m], all within the site."""
        site, grid = self._site, self._grid
        column, row = (
            np.clip(np.floor((place - edge) / site.spacing).astype(np.int64), 0, most - 1) // _PATCH
            for place, edge, most in (
                (east, site.west, grid.columns), (north, site.south, grid.rows)
            )
        )  # fmt: skip
        number, heights = row * grid.across + column, np.empty(east.shape)
        for one in np.unique(number).tolist():
            here = number == one
            layers = site.recipe.terrain.layers
            ground = shape_ground(site=site, window=grid.window(one), layers=layers)
            west, south, most_east, most_north = ground.bounds
            # Divisions round: a place at a patch's border may be said to lie a bit beyond it.
            heights[here] = ground.height_at(
                np.clip(east[here], west, most_east), np.clip(north[here], south, most_north)
            )
        return heights


def read_blocks(order: TileOrder) -> Blocks:
    """What it costs to cross the site's blocks, by the costs of the tiles' nodes."""
    import rasterio

    grid, side = order.grid, _SMALLEST_BLOCK
    nodes = grid.rows + 1, grid.columns + 1
    while max(nodes) > side * _MOST_BLOCKS:
        side *= 2
    shape = -(-nodes[0] // side), -(-nodes[1] // side)
    total, free = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    dear = np.zeros(shape)
    for number in range(len(grid)):
        with rasterio.open(_cost_of(order, number)) as raster:
            squares, passed = squared_costs(raster.read(1)[::-1])
        window = grid.window(number)
        rows, columns = (
            (first + np.arange(count)) // side
            for first, count in zip((window.row, window.column), squares.shape, strict=True)
        )
        place = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
        cuts = [np.flatnonzero(np.diff(index, prepend=-1)) for index in (rows, columns)]
        for sums, values in (
            (total, np.ones(squares.shape, np.int64)),
            (free, passed.astype(np.int64)),
            (dear, squares),
        ):
            part = np.add.reduceat(np.add.reduceat(values, cuts[0], 0), cuts[1], 1)
            sums[place] += part
    middle = 0.5 * (side - 1) * order.site.spacing
    return Blocks(
        origin=(order.site.west + middle, order.site.south + middle),
        spacing=side * order.site.spacing,
        weight=block_weights(total, dear, free),
    )


def _cost_of(order: TileOrder, number: int) -> Path:
    return order.folder(number) / "truth/cost.tif"
