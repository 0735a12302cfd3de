"""Rocks that the ground does not hold: it falls away beneath them, however deep they are buried."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import portable
from terrain_forge.model import Heightfield, RockField, RockLibrary, rotations
from terrain_forge.rocks.embedding.embed import foot_of
from terrain_forge.rocks.embedding.outline import MAX_BURIED

DAYLIGHT = 0.02
"""Part of its diameter by which a rock's foot may stand out of the ground."""
_NEARLY = 0.01  # of the extent: how far below `MAX_BURIED` a rock may be at its limit


def unsupported(rocks: RockField, library: RockLibrary, ground: Heightfield) -> NDArray[np.bool_]:
    """Which fixed rocks show daylight, though they are buried as deep as may be.

    Args:
        rocks: Rocks as `place_rocks` has them.
        library: Their shapes.
        ground: The ground under all of them.

    Returns:
        Shape [rocks].
    """
    found = np.zeros(len(rocks), np.bool_)
    deep = ~rocks.dynamic & (rocks.buried_fraction > MAX_BURIED - _NEARLY)
    west, south, east, north = ground.bounds
    for number in np.unique(rocks.prototype[deep]).tolist():
        rows = np.flatnonzero(deep & (rocks.prototype == number))
        some = rocks.select(rows)
        pose = rotations(some) * some.scale[:, None, None]
        foot = foot_of(library.prototypes[number].meshes[0])
        points = portable.product(foot, pose.transpose(0, 2, 1)) + some.position[:, None]
        x, y = np.clip(points[..., 0], west, east), np.clip(points[..., 1], south, north)
        above = (points[..., 2] - ground.height_at(x, y)).max(axis=1)
        found[rows] = above > DAYLIGHT * some.diameter
    return found
