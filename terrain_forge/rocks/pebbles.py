"""What is near paths: rocks that are seen from so close, and pebbles, for pictures alone.

Pebbles are rocks below a recipe's smallest. Their number and sizes follow the size-frequency law of
the population with the smallest rocks, on down. They are no part of the world: nothing touches
them, and truth does not count them. A world that has them among its rocks is for cameras and lidars
alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.random import Generator, Philox
from numpy.typing import NDArray

from terrain_forge.base import Array, ExportError, Positive, checked, mix, stage_key
from terrain_forge.model import (
    CLOSE_MIN_M,
    Bounds,
    BuiltTile,
    Heightfield,
    RockField,
    Site,
    Tile,
    TiledSite,
    World,
    merge,
    owned,
    path_points,
    points_along,
)

MOST_PEBBLES = 2_000_000
"""Pebbles that one world, or tile, may have."""
FIRST_ID = 2**30
"""Least id of the first; it is above those of all rocks."""
_CELL = 0.5  # side of the squares that are drawn by themselves [m]
_HIGH = 0.2  # height of a pebble's centre above the ground [diameters]
_SUNK = 0.02  # how deep its lowest corner lies in the ground at least [diameters]


def path_distance(world: World, places: Array) -> Array:
    """Distances of places (east, north [m]) to the nearest path [m]; infinite without one."""
    return _distance(path_points(world.trajectories), places)


def _distance(points: Array, places: Array) -> Array:
    """Distances of places to the nearest of points [m]; infinite without one."""
    from scipy.spatial import KDTree

    if not len(points) or not len(places):
        return np.full(len(places), np.inf)
    return np.asarray(KDTree(points).query(places)[0])


def rocks_near_paths(world: World, *, smallest: float, within: float) -> NDArray[np.int32]:
    """The rocks of at least `smallest` [m] no farther than `within` [m] from a path; with 0 none.

    Returns:
        Their ids, shape [rocks].
    """
    rocks = world.field.select((world.field.diameter >= smallest) & (within > 0.0))
    away = path_distance(world, rocks.position[:, :2]) - 0.5 * rocks.diameter
    return np.asarray(rocks.id[away <= within])


def seen_close(world: World, *, within: float) -> NDArray[np.int32]:
    """The rocks that pictures near the world's paths should draw by their close meshes.

    They are the large ones (`CLOSE_MIN_M`) near a path, as `rocks_near_paths` has them, whose
    shapes have such a mesh.

    Returns:
        Their ids, shape [rocks].
    """
    has_one = np.array([shape.close is not None for shape in world.library.prototypes], np.bool_)
    fine = world.replace(field=world.field.select(has_one[world.field.prototype]))
    return rocks_near_paths(fine, smallest=CLOSE_MIN_M, within=within)


def path_pebbles(
    world: World, *, smallest: float, within: float, around: Heightfield | None = None
) -> RockField:
    """Pebbles from a diameter [m] on, up to a distance from the world's paths [m].

    They stand on the world's ground; `around` is that with some of what lies beyond its border.

    The same pebbles lie in any window, but for their ids, by which they have a colour. Those are
    above the ids of the world's rocks.

    Raises:
        ExportError: if no law tells their number, or if there would be too many.
    """
    law, largest = _law(world.site, smallest, paths=bool(world.trajectories))
    density = float(law.cumulative_number(smallest) - law.cumulative_number(largest))
    cells = _cells(path_points(world.trajectories), world.ground.bounds, within)
    expected = density * _CELL**2 * len(cells)
    _require_few(expected, smallest, within)
    key = stage_key(world.site.seed, "path-pebbles")
    plan, hashes = [np.empty((0, 2))], [np.empty(0, np.uint64)]
    for column, row in cells.tolist():
        square = mix(np.uint64(mix(key, _counted(column))), _counted(row))
        random = Generator(Philox(key=int(square)))
        count = int(random.poisson(density * _CELL**2))
        plan.append((np.array([column, row]) + random.random((count, 2))) * _CELL)
        hashes.append(random.integers(0, 2**64, count, np.uint64, endpoint=False))
    places, drawn = np.concatenate(plan), np.concatenate(hashes)
    near = path_distance(world, places) <= within
    near &= world.ground.covers(places[:, 0], places[:, 1])
    diameter = law.sample(drawn[near], smallest, largest)
    return _laid(world, around or world.ground, places[near], drawn[near], diameter)


def _require_few(expected: float, smallest: float, within: float) -> None:
    if expected > MOST_PEBBLES:
        raise ExportError(
            f"some {expected:,.0f} pebbles from {smallest:g} m within {within:g} m of the paths of "
            f"a world or tile, at most {MOST_PEBBLES:,}: choose a larger pebbles_min_m or smaller "
            "pebbles_within_m"
        )


def tiles_near_paths(
    tiled: TiledSite, *, close: float, smallest: float, within: float
) -> Iterator[tuple[BuiltTile, Tile, RockField]]:
    """The tiles of a site that have something near paths, with their pebbles.

    Args:
        tiled: The site.
        close: How far from a path something else than pebbles lies, at most [m]; 0 for nothing.
        smallest: Diameter of the smallest pebbles [m], as `path_pebbles` has it; 0 for none.
        within: How far from a path they lie, at most [m].

    Returns:
        Tiles, made with all paths, and the pebbles that lie in no other.
    """
    for built, tile in tiled.near_paths(max(close, within if smallest else 0.0)):
        laid = tile.field.select(np.zeros(len(tile.field), np.bool_))
        if smallest:
            around = tile.whole.ground
            laid = path_pebbles(tile.world, smallest=smallest, within=within, around=around)
        yield built, tile, laid.select(owned(laid, tile.ground, tiled.site.bounds))


@checked
def with_pebbles(world: World, *, smallest: Positive, within: Positive = 2.0) -> World:
    """The world as pictures and sensors near its paths see it: with pebbles among its rocks.

    They are visual-only rocks of the population with the smallest ones.

    Args:
        world: The world, which stays as it is.
        smallest: Diameter of the smallest [m].
        within: How far from a path they lie, at most [m].

    Raises:
        DataError: for lengths that are none.
        ExportError: if no law tells their number, or if there would be too many.
    """
    pebbles = path_pebbles(world, smallest=smallest, within=within)
    return world.replace(field=merge(world.field, pebbles))


def require_pebbles(site: Site, *, smallest: float, within: float) -> None:
    """Refuse pebbles that a site cannot have, before anything is made.

    A `smallest` of 0 asks for none. A path that is planned on the finished ground, or that winds in
    a tile, may have too many yet.

    Raises:
        ExportError: if no law tells their number, there is no path, or would be too many along the
            routes that are known; of a site in tiles along one that goes straight through a tile.
    """
    if smallest == 0.0:
        return
    law, largest = _law(site, smallest, paths=bool(site.recipe.paths))
    if site.recipe.tiles is None:
        points = points_along(route.position for route in site.routes)
        area = _CELL**2 * len(_cells(points, site.bounds, within))
    else:
        area = min(2.0 * within, site.tile_side) * min(site.tile_side, *site.size)
    density = float(law.cumulative_number(smallest) - law.cumulative_number(largest))
    _require_few(density * area, smallest, within)


def _law(site: Site, smallest: float, *, paths: bool) -> tuple[Any, float]:
    """The law that goes on below the smallest rocks, and their diameter [m]."""
    populations = site.recipe.rocks.populations
    if not populations or not paths:
        raise ExportError(
            "pebbles lie near paths in the number that a population's law gives; the recipe has no "
            f"{'path' if populations else 'population'}"
        )
    least_of_all = [_smallest(population) for population in populations]
    largest = min(least_of_all)
    law = populations[least_of_all.index(largest)].size_frequency
    known = law.smallest_known
    if smallest >= largest or (known is not None and smallest < known):
        least = f"from {known:g} m, which its counts end at, " if known is not None else ""
        raise ExportError(
            f"pebbles_min_m is {smallest:g}; allowed: {least}below {largest:g} m, the recipe's "
            "smallest rock"
        )
    return law, largest


def _counted(index: int) -> np.uint64:
    """A whole number of any sign as one from 0 on."""
    return np.uint64(2 * index if index >= 0 else -2 * index - 1)


def _smallest(population: Any) -> float:
    """The diameter of its smallest rocks [m], which a plan has written out."""
    return float(population.diameter_m[0])


def _cells(points: Array, box: Bounds, within: float) -> Array:
    """Columns and rows of a box's squares that reach within a distance of a path's points [m]."""
    reach = int(np.ceil(within / _CELL)) + 1
    on_path = np.unique(np.floor(points / _CELL).astype(np.int64), axis=0)
    bounds = np.floor(np.array(box) / _CELL).astype(np.int64)
    axes = [np.arange(bounds[n], bounds[n + 2] + 1) for n in (0, 1)]
    if len(on_path) * (2 * reach + 1) ** 2 < len(axes[0]) * len(axes[1]):
        steps = np.arange(-reach, reach + 1)
        around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        cells = np.unique((on_path[:, None, :] + around).reshape(-1, 2), axis=0)
        cells = cells[((cells >= bounds[:2]) & (cells <= bounds[2:])).all(axis=1)]
    else:  # more than the site has
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.asarray(cells[_distance(points, (cells + 0.5) * _CELL) <= within + _CELL])


def _laid(
    world: World,
    around: Heightfield,
    places: Array,
    hashes: NDArray[np.uint64],
    diameter: Array,
) -> RockField:
    """The pebbles as rocks, in whatever shape and turn their hashes say."""
    count, shapes = len(places), world.library.prototypes
    turn = np.pi * ((hashes >> np.uint64(8)) & np.uint64(0xFFFF)).astype(np.float64) / 2.0**16
    height = world.ground.height_at(places[:, 0], places[:, 1])
    quaternion = np.zeros((count, 4))
    quaternion[:, 0], quaternion[:, 3] = np.cos(turn), np.sin(turn)
    prototype = ((hashes >> np.uint64(32)) % np.uint64(len(shapes))).astype(np.int32)
    volume = np.array([shape.volume for shape in shapes])[prototype] * diameter**3
    rise = _rises(world, around, places, turn, prototype, diameter)
    populations = world.site.recipe.rocks.populations
    last = max(int(rocks.id.max(initial=-1)) for rocks in (world.field, world.neighbours))
    finest = int(np.argmin([_smallest(population) for population in populations]))
    return RockField(
        populations=world.field.populations,
        id=(max(FIRST_ID, last + 1) + np.arange(count)).astype(np.int32),
        population=np.full(count, finest, np.int32),
        prototype=prototype,
        position=np.column_stack([places, height + rise]),
        quaternion=quaternion,
        scale=diameter,
        diameter=diameter,
        height=0.5 * diameter + rise,
        buried_fraction=0.5 - rise / diameter,
        volume=volume,
        mass=world.site.body.rock_density * volume,
        dynamic=np.zeros(count, np.bool_),
        collides=np.zeros(count, np.bool_),
    )


def _rises(
    world: World,
    around: Heightfield,
    places: Array,
    turn: Array,
    prototype: NDArray[np.int32],
    diameter: Array,
) -> Array:
    """Heights of the pebbles' centres over the ground below them [m].

    The lowest corner of the mesh that is drawn lies in the ground, also where that falls away.
    """
    drawn = [shape.meshes[-1].vertices for shape in world.library.prototypes]
    lowest = np.array([corners[corners[:, 2].argmin()] for corners in drawn], np.float64)
    x, y, low = (lowest[prototype] * diameter[:, None]).T
    cosine, sine = np.cos(2.0 * turn), np.sin(2.0 * turn)
    west, south, east, north = around.bounds
    foot = around.height_at(
        np.clip(places[:, 0] + cosine * x - sine * y, west, east),
        np.clip(places[:, 1] + sine * x + cosine * y, south, north),
    )
    fall = around.height_at(places[:, 0], places[:, 1]) - foot
    return np.asarray(np.minimum(_HIGH * diameter, -low - fall - _SUNK * diameter))
