"""What a rock's surface looks like close by: a tile of relief that all rocks share.

It is one relief: facets that fractures left, roughness, pits and cracks. Its normals, its
brightness and how rough it shines all follow from that; it tiles both ways.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner, kernel, mix, stage_key

TEXTURE_SIDE = 512
"""Pixels of the tile each way, of one mean axis of a rock: 2 mm on a rock of a metre."""
MEAN_BRIGHTNESS = 200.0
"""Mean of the tile, of 255, which stands for a population's colour."""

_FACETS, _JOINTS = 9, 3  # cells across the tile
_PITS = ((22, 0.30), (45, 0.4))  # cells across, share of them with a pit
_STEEP = 0.20
"""Rise of each octave of roughness, as the preview's is that of rocks without a tile."""
_OCTAVES = 6


class RockSurface(NamedTuple):
    """The tile; rows run up."""

    brightness: NDArray[np.uint8]
    """Linear, mean `MEAN_BRIGHTNESS`, shape [side, side]."""
    normals: NDArray[np.uint8]
    """Unit normals towards u, v and outwards, -1 to 1 as 0 to 255, shape [side, side, 3]."""
    roughness: NDArray[np.uint8]
    """Roughness of a microfacet model, 0 to 1 as 0 to 255, shape [side, side]."""


@cache
def rock_surface() -> RockSurface:
    """The tile of bare rock."""
    height, tone = _paint(stage_key(0, "rock-texture"), TEXTURE_SIDE)
    step = 1.0 / TEXTURE_SIDE
    normals = np.empty((*height.shape, 3))
    for axis, column in ((1, 0), (0, 1)):
        rise = (np.roll(height, -1, axis) - np.roll(height, 1, axis)) / (2.0 * step)
        normals[..., column] = -rise
    normals[..., 2] = 1.0
    normals /= np.sqrt(np.einsum("ijk,ijk->ij", normals, normals))[..., None]
    tone = np.maximum(tone, 0.05)
    tone *= MEAN_BRIGHTNESS / 255.0 / tone.mean()
    surface = RockSurface(
        brightness=np.clip(np.rint(255.0 * tone), 0, 255).astype(np.uint8),
        normals=np.rint(127.5 + 127.5 * normals).astype(np.uint8),
        roughness=np.clip(np.rint(255.0 * (1.15 - 0.35 * tone)), 0, 255).astype(np.uint8),
    )
    for array in surface:
        array.setflags(write=False)
    return surface


@kernel
def _paint(key, side):  # type: ignore[no-untyped-def]
    """Height [tiles] and brightness of the tile."""
    height, tone = np.empty((side, side)), np.empty((side, side))
    for row in range(side):
        for column in range(side):
            x, y = (column + 0.5) / side, (row + 0.5) / side
            bend_x = 0.03 * _noise(key + np.uint64(1), x, y, 6)
            bend_y = 0.03 * _noise(key + np.uint64(2), x, y, 6)
            z, patches, cells = 0.0, 0.0, 4
            for octave in range(_OCTAVES):
                value = _noise(key + np.uint64(10 + octave), x + bend_x, y + bend_y, cells)
                z += _STEEP / cells * value
                patches += value
                cells = 2 * cells + (octave & 1)
            # Facets: each leans its own way, between blunt edges.
            near, second, lean = _cells(key + np.uint64(3), x + bend_x, y + bend_y, _FACETS)
            z += 0.35 / _FACETS * lean * min(second - near, 0.35)
            # Open joints.
            near, second, _ = _cells(
                key + np.uint64(4), x + 2.0 * bend_x, y + 2.0 * bend_y, _JOINTS
            )
            gape = min(1.0, max(0.0, 4.0 * _noise(key + np.uint64(5), x, y, 5)))
            crack = gape * max(0.0, 1.0 - (second - near) / 0.035)
            z -= 0.008 * crack
            hollow = crack
            for kind in range(2):
                across, share = _PITS[kind]
                near, _, draw = _cells(key + np.uint64(6 + kind), x, y, across)
                wide = 0.16 + 0.14 * abs(draw)
                if abs(draw) < share and near < wide:
                    depth = 1.0 - (near / wide) ** 2
                    z -= 0.5 * wide / across * depth
                    hollow = max(hollow, 0.8 * depth)
            height[row, column] = z
            tone[row, column] = (1.0 + 0.16 * patches + 0.05 * lean) * (1.0 - 0.35 * hollow)
    return height, tone


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
