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
