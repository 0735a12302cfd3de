"""What a rock's surface looks like close by: a tile of brightness, and where it lies on a mesh."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel, mix, stage_key
from terrain_forge.model import Mesh

TEXTURE_SIDE = 256
"""Pixels of the tile each way."""
MEAN_BRIGHTNESS = 200.0
"""Mean of the tile, of 255, which stands for a population's colour."""

_GRAINS = 52  # cells of the mineral grains across the tile


def box_projection(mesh: Mesh) -> Array:
    """Texture coordinates of a mesh's face corners, one tile per metre, shape [faces, 3, 2].

    Each face is projected along the axis that its normal is nearest to, so that no length is
    stretched more than √3 times; faces that look along different axes meet in a seam. Seen from
    outside, the texture is never mirrored.
    """
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = np.abs(normals).argmax(axis=1)
    across, along = (axis + 1) % 3, (axis + 2) % 3
    u = np.take_along_axis(corners, across[:, None, None], axis=2)[:, :, 0]
    v = np.take_along_axis(corners, along[:, None, None], axis=2)[:, :, 0]
    facing = np.take_along_axis(normals, axis[:, None], axis=1)
    return np.stack([np.where(facing < 0.0, -u, u), v], axis=-1) + 0.5


@cache
def rock_texture() -> NDArray[np.uint8]:
    """Brightness of bare rock that tiles both ways: patches, mineral grains, pores and cracks.

    Returns:
        Linear brightness, 0 to 255, mean `MEAN_BRIGHTNESS`, shape [side, side].
    """
    value: Array = _paint(stage_key(0, "rock-texture"), TEXTURE_SIDE)
    value *= MEAN_BRIGHTNESS / value.mean()
    tile = np.clip(np.round(value), 0, 255).astype(np.uint8)
    tile.setflags(write=False)
    return tile


@kernel
def _paint(key, side):  # type: ignore[no-untyped-def]
    tile = np.empty((side, side))
    for row in range(side):
        for column in range(side):
            x, y = (column + 0.5) / side, (row + 0.5) / side
            bend_x = 0.035 * _noise(key + np.uint64(1), x, y, 6)
            bend_y = 0.035 * _noise(key + np.uint64(2), x, y, 6)
            patches, weight, cells = 0.0, 1.0, 4
            for octave in range(6):
                patches += weight * _noise(key + np.uint64(10 + octave), x, y, cells)
                weight, cells = 0.8 * weight, 2 * cells
            nearest, second, tone = _cells(key + np.uint64(3), x + bend_x, y + bend_y, _GRAINS)
            grain = 0.09 * tone * min(1.0, 2.0 * (second - nearest))
            pore = 0.45 * max(0.0, 1.0 - 2.5 * nearest) if tone < -0.8 else 0.0
            near, next_near, _ = _cells(key + np.uint64(4), x + 2 * bend_x, y + 2 * bend_y, 4)
            gape = min(1.0, max(0.0, 4.0 * _noise(key + np.uint64(5), x, y, 6) - 0.4))
            crack = gape * max(0.0, 1.0 - (next_near - near) / 0.04)
            tile[row, column] = (1.0 + 0.22 * patches + grain) * (1.0 - pore) * (1.0 - 0.4 * crack)
    return tile


@inner
def _hashed(key, i, j, cells):  # type: ignore[no-untyped-def]
    return mix(mix(key, np.uint64(i % cells)), np.uint64(j % cells))


@inner
def _unit_part(hashed, shift):  # type: ignore[no-untyped-def]
    return np.float64((hashed >> np.uint64(shift)) & np.uint64(0xFFFF)) / 65536.0


@inner
def _noise(key, x, y, cells):  # type: ignore[no-untyped-def]
    """Gradient noise of so many cells across the tile, which it fills without a seam."""
    x, y = x * cells, y * cells
    i, j = np.int64(np.floor(x)), np.int64(np.floor(y))
    x, y = x - i, y - j
    u = x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
    v = y * y * y * (y * (y * 6.0 - 15.0) + 10.0)
    value = 0.0
    for corner in range(4):
        a, b = corner & 1, corner >> 1
        angle = 2.0 * np.pi * _unit_part(_hashed(key, i + a, j + b, cells), 8)
        slope = np.cos(angle) * (x - a) + np.sin(angle) * (y - b)
        value += (u if a else 1.0 - u) * (v if b else 1.0 - v) * slope
    return value


@inner
def _cells(key, x, y, cells):  # type: ignore[no-untyped-def]
    """Distances [cells] of the two nearest of the points, one in each cell; the nearer's tone.

    Worley 1996, doi:10.1145/237170.237267. Tones are -1 to 1.
    """
    x, y = x * cells, y * cells
    i, j = np.int64(np.floor(x)), np.int64(np.floor(y))
    nearest = second = 9.0
    tone = 0.0
    for a in range(-1, 2):
        for b in range(-1, 2):
            hashed = _hashed(key, i + a, j + b, cells)
            dx = i + a + _unit_part(hashed, 0) - x
            dy = j + b + _unit_part(hashed, 16) - y
            away = np.sqrt(dx * dx + dy * dy)
            if away < nearest:
                second, nearest = nearest, away
                tone = 2.0 * _unit_part(hashed, 32) - 1.0
            elif away < second:
                second = away
    return nearest, second, tone
