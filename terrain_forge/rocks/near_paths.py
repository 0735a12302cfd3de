"""How far things lie from a world's paths, and which rocks are seen from so near."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask
from terrain_forge.model import CLOSE_MIN_M, Tile, Trajectory, World

_STEP = 0.1  # along paths [m]


def path_points(paths: Iterable[Trajectory]) -> Array:
    """Points along paths, 0.1 m apart, east and north [m], shape [points, 2]."""
    points = [np.empty((0, 2))]
    for trajectory in paths:
        line = trajectory.position[:, :2]
        steps = np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1))
        far = np.concatenate([[0.0], np.cumsum(steps)])
        at = np.arange(0.0, far[-1] + _STEP, _STEP)
        points.append(np.stack([np.interp(at, far, line[:, n]) for n in (0, 1)], axis=-1))
    return np.concatenate(points)


def path_distance(world: World, places: Array) -> Array:
    """Distances of places (east, north [m]) to the nearest path [m]; infinite without one."""
    from scipy.spatial import KDTree

    points = path_points(world.trajectories)
    if not len(points) or not len(places):
        return np.full(len(places), np.inf)
    return np.asarray(KDTree(points).query(places)[0])


def seen_close(world: World, *, within: float) -> NDArray[np.int32]:
    """The rocks that pictures near the world's paths should draw by their close meshes.

    They are the large ones (`CLOSE_MIN_M`) whose edge is no farther than `within` [m] from a path
    and whose shapes have such a mesh; with 0 none.

    Returns:
        Their ids, shape [rocks].
    """
    rocks = world.field
    has_one = np.array([shape.close is not None for shape in world.library.prototypes], np.bool_)
    fine = has_one[rocks.prototype] & (within > 0.0)
    large = rocks.select(fine & (rocks.diameter >= CLOSE_MIN_M))
    away = path_distance(world, large.position[:, :2]) - 0.5 * large.diameter
    return np.asarray(large.id[away <= within])


def cells_near_paths(tile: Tile, *, within: float) -> Mask:
    """Which cells of a tile's ground lie within so many metres of a path, to about a cell.

    Returns:
        Shape [rows, columns].
    """
    from scipy.ndimage import distance_transform_edt

    ground = tile.ground
    cells = ground.shape[0] - 1, ground.shape[1] - 1
    if within <= 0.0:
        return np.zeros(cells, np.bool_)
    reach = math.ceil(within / ground.spacing) + 1
    away = np.ones((cells[0] + 2 * reach, cells[1] + 2 * reach), np.bool_)
    places = np.floor(
        (path_points(tile.whole.trajectories) - ground.origin) / ground.spacing
    ).astype(np.int64)
    column, row = (places + reach).T
    inside = (row >= 0) & (row < away.shape[0]) & (column >= 0) & (column < away.shape[1])
    away[row[inside], column[inside]] = False
    if away.all():
        return np.zeros(cells, np.bool_)
    near = distance_transform_edt(away) * ground.spacing <= within
    return np.asarray(near[reach:-reach, reach:-reach])
