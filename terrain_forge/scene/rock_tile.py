"""The relief of rocks' faces: the tile that exports show as maps, looked up where a ray lands.

It lies on a rock as exports lay it: projected along the axis of the rock's own frame that the
triangle's normal is nearest to, one tile to a mean axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner
from terrain_forge.model import RockLibrary

_NO_TILE = np.zeros((2, 1, 3), np.float32)
_NO_TILE.setflags(write=False)


def no_tile() -> NDArray[np.float32]:
    """A tile without relief."""
    return _NO_TILE


def rock_tile(library: RockLibrary) -> NDArray[np.float32]:
    """What `tile_at` looks up: rise along u and v, and brightness over its mean, less 1.

    Smaller and smaller pictures of the tile stand one after another, each of half the pixels of the
    last, so that a pixel sees the mean of what it covers. Shape [2 · side, side, 3].
    """
    if library.normals is None or len(set(library.texture.shape)) > 1:
        return no_tile()
    side = len(library.texture)
    if side & (side - 1):
        return no_tile()
    normals = library.normals.astype(np.float32) / np.float32(127.5) - np.float32(1.0)
    level = np.empty((side, side, 3), np.float32)
    level[..., :2] = -normals[..., :2] / np.maximum(normals[..., 2:], np.float32(0.1))
    level[..., 2] = library.texture / np.float32(library.texture.mean()) - np.float32(1.0)
    levels = np.zeros((2 * side, side, 3), np.float32)
    first = 0
    while True:
        count = len(level)
        levels[first : first + count, :count] = level
        first += count
        if count == 1:
            break
        level = level.reshape(count // 2, 2, count // 2, 2, 3).mean(axis=(1, 3))
    levels.setflags(write=False)
    return levels


@inner
def tile_at(tile, own, normal, scale, footprint):  # type: ignore[no-untyped-def]
    """Brightness of a rock over its mean, less 1, and the gradient of its relief.

    Args:
        tile: What `rock_tile` made.
        own: The place in the rock's own frame [m].
        normal: The triangle's normal in that frame.
        scale: The rock's size in units of its shape [m].
        footprint: Size of a pixel there [m].
    """
    side = tile.shape[1]
    x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
    axis = 0 if x >= y and x >= z else (1 if y >= z else 2)
    if axis == 0:
        facing, across, along = normal[0], own[1], own[2]
    elif axis == 1:
        facing, across, along = normal[1], own[2], own[0]
    else:
        facing, across, along = normal[2], own[0], own[1]
    turn = -1.0 if facing < 0.0 else 1.0
    count, wanted = side, 1.5 * footprint / scale * side
    first = 0
    while count > 1 and wanted > 1.5:
        first += count
        count //= 2
        wanted *= 0.5
    u = (turn * across / scale + 0.5) * count - 0.5
    v = (along / scale + 0.5) * count - 0.5
    i, j = np.int64(np.floor(u)), np.int64(np.floor(v))
    s, t = u - i, v - j
    west, east = i % count, (i + 1) % count
    south, north = first + j % count, first + (j + 1) % count
    a, b, c, d = (1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t
    one, two = tile[south, west], tile[south, east]
    three, four = tile[north, west], tile[north, east]
    rise_u = turn * (a * one[0] + b * two[0] + c * three[0] + d * four[0])
    rise_v = a * one[1] + b * two[1] + c * three[1] + d * four[1]
    value = a * one[2] + b * two[2] + c * three[2] + d * four[2]
    if axis == 0:
        return value, 0.0, rise_u, rise_v
    if axis == 1:
        return value, rise_v, 0.0, rise_u
    return value, rise_u, rise_v, 0.0
