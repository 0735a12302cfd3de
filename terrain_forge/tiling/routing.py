"""Paths of a site in tiles: planned from coarse to fine, laid on ground that is made on the way."""

from __future__ import annotations

import json
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    Key,
    OutputError,
    Stopwatch,
    from_plain,
    read_arrays,
    read_json,
    reading,
    to_plain,
)
from terrain_forge.dtm import open_dataset
from terrain_forge.making import make_ground
from terrain_forge.model import Route, Site, TileGrid, Trajectory, Window, World
from terrain_forge.paths import (
    Blocks,
    PathSpec,
    Planned,
    Traversability,
    blocks_of,
    known_within,
    make_trajectory,
    plan_far,
    planned_routes,
    require_stops,
    write_trajectories,
)
from terrain_forge.rovers import rover_of
from terrain_forge.tiling.making import world_of
from terrain_forge.tiling.order import FOLDER, MOST, TileOrder, reading_of_tile
from terrain_forge.truth import rate_world, write_surroundings

_ROUTES = "routes.json", "routes.npz"
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


def require_paths_begin(order: TileOrder) -> None:
    """Refuse planned paths whose places are blocked, before any tile is made.

    Raises:
        RecipeError: says by what.
    """
    land, rover = Land(order), rover_of(order.site)
    for number, spec in enumerate(order.site.recipe.paths):
        if isinstance(spec.route, Planned):
            key = ("paths", number, "route")
            require_stops(spec.route, land.field, rover=rover, key=key)


def lay_paths(order: TileOrder, watch: Stopwatch) -> tuple[Trajectory, ...]:
    """Find and write the paths of a site whose tiles are there: paths/, truth/paths/.

    Planned routes are kept in the site's folder when they are found.

    Raises:
        RecipeError: if a planned path cannot be found.
    """
    site, rover = order.site, rover_of(order.site)
    land, blocks = Land(order), list[Blocks]()

    def found(spec: PathSpec, route: Planned, key: Key) -> Route:
        watch(f"paths: planning {spec.name}")
        if not blocks:
            nodes = order.grid.rows + 1, order.grid.columns + 1
            corner = site.west, site.south
            blocks.append(
                blocks_of(costs_of(order), shape=nodes, origin=corner, spacing=site.spacing)
            )
        return plan_far(
            spec, route, blocks=blocks[0], field_at=land.field, rover=rover, key=key,
            ahead=reach_of(site),
        )  # fmt: skip

    routes = {route.name: route for route in site.routes}
    if (planned := load_routes(order.out)) is None:
        planned = tuple(planned_routes(site, rover, found).values())
        _save_routes(planned, order.out)
    routes |= {route.name: route for route in planned}
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


def load_routes(out: Path) -> tuple[Route, ...] | None:
    """The planned routes of a site in tiles; None where they were not found yet.

    Raises:
        OutputError: if they are damaged.
    """
    table, binary = (out / FOLDER / name for name in _ROUTES)
    if not table.is_file():
        return None
    try:
        plain = read_json(table, table.name, most=MOST)
        with reading(binary.name):
            routes = from_plain(plain, read_arrays(binary), tuple[Route, ...])
    except DataError as error:
        raise OutputError(
            f"{table} is damaged: {error}; move it away, and build again, which plans anew"
        ) from None
    return routes


def _save_routes(routes: tuple[Route, ...], out: Path) -> None:
    arrays: dict[str, NDArray[Any]] = {}
    text = json.dumps(to_plain(routes, arrays, "routes"), indent=1, allow_nan=False) + "\n"
    binary = BytesIO()
    np.savez(binary, allow_pickle=False, **arrays)  # type: ignore[arg-type]
    contents = text.encode(), binary.getvalue()
    for name, content in reversed([*zip(_ROUTES, contents, strict=True)]):  # the table last
        fresh = out / FOLDER / f".{name}"
        fresh.write_bytes(content)
        fresh.replace(out / FOLDER / name)


class Land:
    """A site's worlds and what they mean to its rover, window by window; the last ones are kept."""

    def __init__(self, order: TileOrder) -> None:
        self._order, self._site = order, order.site
        rover = rover_of(order.site)
        self._border = known_within(rover, order.site.spacing) if rover.wheels else 0
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
    """The ground of a site of any size, made where it is asked for."""

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
            ground = make_ground(site, grid.window(one))
            west, south, most_east, most_north = ground.bounds
            # Divisions round: a place at a patch's border may be said to lie a bit beyond it.
            heights[here] = ground.height_at(
                np.clip(east[here], west, most_east), np.clip(north[here], south, most_north)
            )
        return heights


def costs_of(order: TileOrder) -> Iterator[tuple[int, int, NDArray[np.float32]]]:
    """Row and column of each tile's first node, and the costs of its nodes."""
    for number in range(len(order.grid)):
        window, folder = order.grid.window(number), order.folder(number)
        path = folder / "truth/cost.tif"
        with reading_of_tile(path, folder), open_dataset(path) as raster:
            costs = raster.read(1)[::-1]
        yield window.row, window.column, costs
