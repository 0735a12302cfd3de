"""The ground close by: a tile of soil texture that repeats both ways without a seam.

It holds nothing that is large or that stands out, so that it does not show at first sight that it
repeats; what is larger is in the ground's colours and heights. It is visual only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Annotated

import numpy as np
from annotated_types import Interval, MinLen

from terrain_forge.base import Array, InputFile, Spec, inner, kernel, mix, over_chunks, stage_key
from terrain_forge.model import GroundDetail, Site

_SIDE, _SIZE = 512, 1.536
"""Pixels and metres [m] of the tile each way: 3 mm a pixel."""
_COARSEST = 13  # lattice cells across the tile: waves of about 0.2 m and less
_OCTAVES = 5
_WARP = 0.02  # part of the tile that the noise is pushed by noise, which hides its lattice
_RISE = 0.10  # height of each octave's noise, in its cells
_STONES = ((23, 0.15), (47, 0.35), (97, 0.4))  # cells across the tile, part of them with a stone
_CONTRAST = 0.16


@dataclass(frozen=True, kw_only=True)
class DetailSpec(Spec):
    """A picture of soil that is laid in tiles, instead of the procedural one."""

    image: Annotated[str, MinLen(1), InputFile(kind="image")]
    """The image, which must tile both ways. Its brightness over its mean counts, and makes the
    normal map: bright is high."""
    size_m: Annotated[float, Interval(ge=0.05, le=100)]
    """Side of a tile on the ground [m]."""
    relief_m: Annotated[float, Interval(ge=0, le=1)] = 0.004
    """Height that the normal map gives white over black [m]."""


def ground_detail(spec: DetailSpec | None, site: Site) -> GroundDetail:
    """The tile that a recipe asks for, or the procedural one of its body."""
    if spec is None:
        return _procedural(airless=site.body.airless)
    values = _squared(site.image(spec.image))
    return _detail(
        size=spec.size_m,
        brightness=values / values.mean(),
        height=spec.relief_m * values,
    )


@cache
def _procedural(*, airless: bool) -> GroundDetail:
    """Grain and small stones; ground without wind has more small stones and no ripples' order."""
    height, tone = np.zeros((_SIDE, _SIDE)), np.zeros((_SIDE, _SIDE))
    key = stage_key(0, "ground-detail/airless" if airless else "ground-detail/airy")
    stones = np.array(_STONES) * (1.0, 1.5 if airless else 1.0)
    over_chunks(_fill, _SIDE, key, _SIDE, _SIZE, stones, height, tone)
    hollow = np.roll(height, 1, 0) + np.roll(height, -1, 0)
    hollow += np.roll(height, 1, 1) + np.roll(height, -1, 1) - 4.0 * height
    tone -= 0.25 * hollow / hollow.std()
    tone -= tone.mean()
    brightness = np.clip(1.0 + _CONTRAST * tone / tone.std(), 0.3, 1.9)
    return _detail(size=_SIZE, brightness=brightness / brightness.mean(), height=height)


def _detail(*, size: float, brightness: Array, height: Array) -> GroundDetail:
    step = size / len(height)
    normals = np.empty((*height.shape, 3))
    normals[..., 0] = (np.roll(height, 1, 1) - np.roll(height, -1, 1)) / (2.0 * step)
    normals[..., 1] = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) / (2.0 * step)
    normals[..., 2] = 1.0
    normals /= np.sqrt(np.einsum("ijk,ijk->ij", normals, normals))[..., None]
    middle = GroundDetail.MIDDLE
    return GroundDetail(
        size=size,
        brightness=np.clip(np.rint(middle * brightness), 0, 255),
        normals=np.rint(127.5 + 127.5 * normals),
    )


def _squared(values: Array) -> Array:
    """The image with as many rows as columns, its longer side thinned out."""
    side = min(values.shape)
    row, column = (np.arange(side) * count // side for count in values.shape)
    return values[np.ix_(row, column)]


@inner
def _hashed(key, i, j, cells):  # type: ignore[no-untyped-def]
    return mix(mix(key, i if i < cells else i - cells), j if j < cells else j - cells)


@inner
def _part(drawn, shift):  # type: ignore[no-untyped-def]
    """Sixteen bits of a hash as a number from -1 to 1."""
    return np.float64((drawn >> np.uint64(shift)) & np.uint64(0xFFFF)) / 32768.0 - 1.0


@inner
def _noise(key, x, y, cells):  # type: ignore[no-untyped-def]
    """Gradient noise of so many cells across a tile of side 1, which it fills without a seam."""
    x, y = x * cells, y * cells
    i, j = np.int64(x), np.int64(y)
    x, y = x - i, y - j
    u, v = x * x * x * (x * (x * 6.0 - 15.0) + 10.0), y * y * y * (y * (y * 6.0 - 15.0) + 10.0)
    value = 0.0
    for corner in range(4):
        a, b = corner & 1, corner >> 1
        drawn = _hashed(key, i + a, j + b, cells)
        slope = _part(drawn, 0) * (x - a) + _part(drawn, 16) * (y - b)
        value += (u if a else 1.0 - u) * (v if b else 1.0 - v) * slope
    return value


@inner
def _stone(key, x, y, cells, share):  # type: ignore[no-untyped-def]
    """Height and tone of the stone over a place, in cells; 0 where there is none."""
    x, y = x * cells, y * cells
    i, j = np.int64(x), np.int64(y)
    drawn = _hashed(key, i, j, cells)
    if 0.5 + 0.5 * _part(drawn, 0) > share:
        return 0.0, 0.0
    more = mix(drawn, 1)
    radius = 0.10 + 0.16 * (0.5 + 0.5 * _part(drawn, 16)) ** 2
    free = 0.5 - 1.45 * radius
    off_x, off_y = x - i - 0.5 - free * _part(drawn, 32), y - j - 0.5 - free * _part(drawn, 48)
    # Long, sheared and flattened to an angular outline.
    long, shear = 1.0 + 0.25 * _part(more, 0), 0.5 * _part(more, 16)
    off_x, off_y = (off_x * long + shear * off_y) / radius, off_y / (long * radius)
    corner = max(abs(off_x + 0.3 * off_y), abs(off_y - 0.4 * off_x))
    away = max(0.85 * (off_x * off_x + off_y * off_y), corner * corner)
    if away >= 1.0:
        return 0.0, 0.0
    tilt = 0.25 * (_part(more, 32) * off_x + _part(more, 48) * off_y)
    return radius * (0.45 + tilt) * min(1.0, 2.0 * np.sqrt(1.0 - away)), _part(more, 8)


@kernel
def _fill(first, last, key, side, size, stones, height, tone):  # type: ignore[no-untyped-def]
    """Height [m] and tone of a tile."""
    for row in range(first, last):
        for column in range(side):
            x, y = (column + 0.5) / side, (row + 0.5) / side
            push_x = _WARP * _noise(mix(key, 50), x, y, 9)
            push_y = _WARP * _noise(mix(key, 51), x, y, 9)
            p, q = (x + push_x) % 1.0, (y + push_y) % 1.0
            z, bright, cells = 0.0, 0.0, _COARSEST
            for octave in range(_OCTAVES):
                value = _noise(mix(key, octave), p, q, cells)
                z += _RISE * size / cells * value
                bright += 0.5 * (1.0 + min(octave, 1)) * value
                cells = 2 * cells + 1 - 2 * (octave & 1)  # so that no lattices share nodes
            for kind in range(len(stones)):
                across = np.int64(stones[kind, 0])
                over, own = _stone(mix(key, 100 + kind), x, y, across, stones[kind, 1])
                if over > 0.0:
                    z += over * size / across
                    bright += 0.5 * own
            height[row, column], tone[row, column] = z, bright
