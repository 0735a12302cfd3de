"""How far things lie from a world's paths, and which rocks are seen from so near."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import CLOSE_MIN_M, World, path_points


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
