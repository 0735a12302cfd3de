"""Texture finer than the ground's grid for eight pixels at once: soil.

What `grain.py` makes for one place, made for the lanes of a packet in 32 bits, which the compiler
turns into vector instructions: fifteen times faster. Places count from an anchor near the camera;
each octave knows where its lattice lies there, so that the texture hangs on the place in the world
alone and is as exact a kilometre away.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner
from terrain_forge.scene.grain import (
    CLAST_CELLS,
    CRUMB_ANY,
    CRUMB_EDGE,
    CRUMB_FEW,
    CRUMB_MORE,
    CRUMB_PATCHY,
    CRUMB_RARER,
    CRUMB_RISE,
    CRUMB_SHADOW,
    CRUMB_SMOOTH,
    CRUMB_SOFT,
    CRUMB_TONE,
    CRUMB_WAVES,
    FAR_COARSEST,
    SLAB_CELL,
    SOIL_COARSEST,
    SOIL_HURST,
    SOIL_SHOWN,
    SOIL_STEEP,
    SOIL_STEP,
    SOIL_WARP,
)
from terrain_forge.scene.packets import LANES
from terrain_forge.scene.words import (
    cell32,
    fade32,
    fading32,
    floor32,
    high_half,
    low_half,
)

(
    PLACE_X,
    PLACE_Y,
    PLACE_Z,
    FOOTPRINT,
    VALUE,
    RISE_X,
    RISE_Y,
    RISE_Z,
    COVER,
    SHADOWED,
    PEBBLY,
    ROUGH,
    SLABBY,
    SHADED,
) = (LANES * row for row in range(14))
"""Where the lanes' numbers begin in a workspace: a place [m], the size of a pixel there [m], the
albedo's noise, the rise per metre, and of pebbles how much of the pixel they cover and the part
of sunlight that they keep off, the ground's grain (share of cells with a pebble, roughness of
the soil, how much of it is slabs), and the part of sunlight that crumbs of soil keep off."""
WARP_U, WARP_V = COVER, SHADOWED  # free until there are pebbles
RELIEF_ROWS = 14

_OCTAVES = 12
_FINEST = 0.002  # shortest waves [m]
_NOISE_RISE = 0.504  # RMS rise of unit noise along an axis
_STEEPEST = 4.0  # how much steeper than usual the land beyond may be
_TURN = complex(0.4472135954999579, 0.8944271909999159)

_0, _HALF, _1, _2 = (np.float32(n) for n in (0.0, 0.5, 1.0, 2.0))
_BEGIN, _GROW = np.float32(SOIL_SHOWN[0]), np.float32(1.0 / (SOIL_SHOWN[1] - SOIL_SHOWN[0]))
_WARP, _ACROSS = np.float32(SOIL_WARP), np.float32(0.4 * SOIL_WARP)
_ONE = np.int32(1)
_SHORT, _LONG, _FEW, _MORE, _SOFT, _TONE = (
    np.float32(n) for n in (*CRUMB_WAVES, CRUMB_FEW, CRUMB_MORE, CRUMB_SOFT, CRUMB_TONE)
)
_HIGH, _FAR, _EDGE = np.float32(CRUMB_RISE), np.float32(CRUMB_SHADOW), np.float32(1 / CRUMB_EDGE)
_MOST, _ANY, _RARER, _PATCHY, _SMOOTH, _NONE = (
    np.float32(n) for n in (1.5, CRUMB_ANY, CRUMB_RARER, CRUMB_PATCHY, CRUMB_SMOOTH, 1e-9)
)


class Relief(NamedTuple):
    """Lattices of the fine texture about an anchor."""

    soil: NDArray[np.float32]
    """Wavelength [m], cosine and sine of the turn, steepness, and the anchor's place in its cell of
    each octave of soil, shape [octaves, 6]."""
    soil_keys: NDArray[np.uint32]
    """Key and the anchor's cell of each octave, shape [octaves, 3]."""
    far: NDArray[np.float32]
    """As `soil`, of the land beyond the site, whose heights hold no waves so short."""
    far_keys: NDArray[np.uint32]
    """As `soil_keys`."""
    clasts: NDArray[np.float32]
    """Size of a cell [m] and the anchor's place in its cell of each layer, shape [layers, 3]."""
    clast_keys: NDArray[np.uint32]
    """As `soil_keys`, shape [layers, 3]."""
    slabs: NDArray[np.float32]
    """The anchor's place [m] in the repeat of the joints' warp and in its cell of slabs, shape [4].
    """
    slab_keys: NDArray[np.uint32]
    """As `soil_keys`, of the warp and of the slabs, shape [2, 3]."""
    shadow: tuple[np.float32, np.float32]
    """From the end of the shadow of a thing of unit height to its foot, east and north."""


def relief_about(
    anchor: Array, *, key: np.uint64, spacing: float, rough: float, shadow: tuple[float, float]
) -> Relief:
    """The fine texture about a place of the world [m] of a ground with a spacing of nodes [m].

    Its heights are so `rough`, see `roughness`; the land beyond, whose heights are not, is made so
    by waves coarser than those of the soil, which are as steep on both.
    """
    seed, coarsest, held = int(key), min(SOIL_COARSEST, 1.5 * spacing), 0
    soil, soil_keys = _octaves(anchor, seed, coarsest)
    while coarsest / SOIL_STEP <= 1.001 * FAR_COARSEST:
        coarsest, held = coarsest / SOIL_STEP, held + 1
    far, far_keys = _octaves(anchor, seed + 1, coarsest)
    usual = _NOISE_RISE * float(np.sqrt(np.square(far[:held, 3], dtype=np.float64).sum()))
    far[:held, 3] *= min(rough / max(usual, 1e-6), _STEEPEST)
    cells = [_lattice(complex(*anchor) / cell) for cell in CLAST_CELLS]
    warp, warp_at = _lattice(complex(*anchor) * 2.7)
    slab, slab_at = _lattice(complex(anchor[0], 1.4 * anchor[1]) / SLAB_CELL)
    return Relief(
        soil=soil,
        soil_keys=soil_keys,
        far=far,
        far_keys=far_keys,
        clasts=np.array(
            [[cell, *place] for cell, (_, place) in zip(CLAST_CELLS, cells, strict=True)],
            np.float32,
        ),
        clast_keys=np.array(
            [[_word(seed + 77 * n), *cell] for n, (cell, _) in enumerate(cells)], np.uint32
        ),
        slabs=np.array([*warp_at, *slab_at], np.float32),
        slab_keys=np.array([[_word(seed + 3), *warp], [_word(seed + 4), *slab]], np.uint32),
        shadow=(np.float32(shadow[0]), np.float32(shadow[1])),
    )


def roughness(slope_x: NDArray[np.float32], slope_y: NDArray[np.float32], spacing: float) -> float:
    """RMS slope along an axis of a ground's waves shorter than about `FAR_COARSEST` [m].

    Of the middle one of square blocks half as wide, so that craters and banks do not count.
    """
    side = max(4, round(0.5 * FAR_COARSEST / spacing))
    rows, columns = (count // side for count in slope_x.shape)
    if not rows or not columns:
        return 0.0
    blocks = [
        np.asarray(slope[: rows * side, : columns * side], np.float64)
        .reshape(rows, side, columns, side)
        .var(axis=(1, 3))
        for slope in (slope_x, slope_y)
    ]
    return round(float(np.sqrt(0.5 * np.median(blocks[0] + blocks[1]))), 3)


def _word(number: int) -> int:
    """Bits of a key."""
    return (number * 0x9E3779B97F4A7C15 >> 24) & 0xFFFFFFFF


def _lattice(place: complex) -> tuple[tuple[int, int], tuple[float, float]]:
    """The cell of a place, as words, and the place in it."""
    i, j = int(np.floor(place.real)), int(np.floor(place.imag))
    return (i & 0xFFFFFFFF, j & 0xFFFFFFFF), (place.real - i, place.imag - j)


def _octaves(
    anchor: Array, seed: int, coarsest: float
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Octaves of soil, each turned against the last and shifted."""
    numbers, keys = [], []
    wavelength, turn = coarsest, complex(1.0, 0.0)
    weight = (coarsest / SOIL_COARSEST) ** (SOIL_HURST - 1.0)
    for octave in range(_OCTAVES):
        if wavelength < _FINEST:
            break
        place = turn * complex(*anchor) / wavelength + complex(0.37, 0.71) * octave
        cell, inside = _lattice(place)
        numbers.append([wavelength, turn.real, turn.imag, SOIL_STEEP * weight, *inside])
        keys.append([_word(seed + 7919 * octave), *cell])
        turn, wavelength = turn * _TURN, SOIL_STEP * wavelength
        weight *= SOIL_STEP ** (SOIL_HURST - 1.0)
    return np.array(numbers, np.float32), np.array(keys, np.uint32)


@inner
def finest(space):  # type: ignore[no-untyped-def]
    """The smallest pixel of the lanes [m]."""
    least = space[FOOTPRINT]
    for lane in range(1, LANES):
        least = min(least, space[FOOTPRINT + lane])
    return least


@inner
def soil_lanes(space, relief, octaves, keys):  # type: ignore[no-untyped-def]
    """Fine relief of loose ground, faded out where a pixel cannot show it, and its crumbs."""
    sun_x, sun_y = relief.shadow
    to_sun = min(_HIGH, _FAR / (np.sqrt(sun_x * sun_x + sun_y * sun_y) + _NONE))
    for lane in range(LANES):
        space[SHADED + lane] = _0
        space[VALUE + lane], space[RISE_X + lane], space[RISE_Y + lane] = _0, _0, _0
        space[WARP_U + lane], space[WARP_V + lane] = _0, _0
    least = finest(space)
    for octave in range(len(octaves)):
        wave, cos, sin = octaves[octave, 0], octaves[octave, 1], octaves[octave, 2]
        steep, start_u, start_v = octaves[octave, 3], octaves[octave, 4], octaves[octave, 5]
        if wave <= _BEGIN * least:
            break
        key, first_i, first_j = (
            keys[octave, 0], np.int32(keys[octave, 1]), np.int32(keys[octave, 2])
        )  # fmt: skip
        per_metre = _1 / wave
        crumbly = _1 if _SHORT <= wave <= _LONG else _0
        to_u, to_v = to_sun * (cos * sun_x - sin * sun_y), to_sun * (sin * sun_x + cos * sun_y)
        for lane in range(LANES):
            x, y = space[PLACE_X + lane], space[PLACE_Y + lane]
            u = (cos * x - sin * y) * per_metre + start_u + space[WARP_U + lane]
            v = (sin * x + cos * y) * per_metre + start_v + space[WARP_V + lane]
            i, j = floor32(u), floor32(v)
            s, t = u - np.float32(i), v - np.float32(j)
            i, j = np.int32(i + first_i), np.int32(j + first_j)
            right, above = np.int32(i + _ONE), np.int32(j + _ONE)
            a, b = cell32(key, i, j), cell32(key, right, j)
            c, d = cell32(key, i, above), cell32(key, right, above)
            ax, ay, bx, by = low_half(a), high_half(a), low_half(b), high_half(b)
            cx, cy, dx, dy = low_half(c), high_half(c), low_half(d), high_half(d)
            sw, se = ax * s + ay * t, bx * (s - _1) + by * t
            nw, ne = cx * s + cy * (t - _1), dx * (s - _1) + dy * (t - _1)
            p, q, twist = fade32(s), fade32(t), sw - se - nw + ne
            height = sw + p * (se - sw) + q * (nw - sw) + p * q * twist
            rise_u = ax + p * (bx - ax) + q * (cx - ax) + p * q * (ax - bx - cx + dx)
            rise_v = ay + p * (by - ay) + q * (cy - ay) + p * q * (ay - by - cy + dy)
            rise_u += fading32(s) * (q * twist + se - sw)
            rise_v += fading32(t) * (p * twist + nw - sw)
            shown = min(_1, max(_0, (wave / space[FOOTPRINT + lane] - _BEGIN) * _GROW))
            value = space[VALUE + lane] + _HALF * shown * height
            some = space[PEBBLY + lane] * min(_MOST, max(_0, _1 + _PATCHY * value))
            over = height - _FEW - _RARER * wave + _MORE * some
            sharp = _1 / max(_SOFT, _HALF * space[FOOTPRINT + lane] * per_metre)
            there = crumbly * shown * min(_1, _ANY * some)
            cover = there * min(_1, max(_0, over * sharp))
            ahead = over + rise_u * to_u + rise_v * to_v
            dark = there * min(_1, max(_0, ahead * sharp)) - cover
            space[SHADED + lane] = max(space[SHADED + lane] * (_1 - cover), dark)
            space[VALUE + lane] = value + _TONE * cover * space[WARP_U + lane]
            steeper = steep * shown * space[ROUGH + lane]
            steeper *= max(_0, _1 - crumbly * _SMOOTH * some)
            steeper += _2 * _HIGH * _EDGE * cover * max(_0, _1 - over * _EDGE)
            space[RISE_X + lane] += steeper * (cos * rise_u + sin * rise_v)
            space[RISE_Y + lane] += steeper * (cos * rise_v - sin * rise_u)
            space[WARP_U + lane], space[WARP_V + lane] = _WARP * height, _ACROSS * rise_u
