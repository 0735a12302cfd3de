"""Texture finer than the ground's grid for eight pixels at once: soil, clasts, rock faces.

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
    SLAB_CELL,
    SOIL_COARSEST,
    SOIL_ROUGHER,
    SOIL_STEEP,
)
from terrain_forge.scene.packets import LANES
from terrain_forge.scene.words import (
    MIX_1,
    PRIME_I,
    PRIME_J,
    cell32,
    fade32,
    fading32,
    floor32,
    high_half,
    low_half,
    mixed,
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
    COARSEST,
    SHADOWED,
    STONE,
    PEBBLY,
    ROUGH,
    SLABBY,
) = (LANES * row for row in range(15))
"""Where the lanes' numbers begin in a workspace: a place [m], the size of a pixel there [m], the
albedo's noise, the rise per metre, and of pebbles how much of the pixel they cover, their longest
wave [m], the part of sunlight that they keep off, a rock's key, 0 to 2²⁴, and the ground's grain:
share of cells with a pebble, roughness of the soil, how much of it is slabs."""
RELIEF_ROWS = 15

_OCTAVES = 12
_FINEST = 0.002  # shortest waves [m]
_TURN = complex(0.4472135954999579, 0.8944271909999159)

_0, _HALF, _1, _2 = (np.float32(n) for n in (0.0, 0.5, 1.0, 2.0))
_ONE = np.int32(1)
_K = np.uint32(0xC2B2AE3D)
_AGAIN = np.uint32(0x27D4EB2F)
_STEEP, _STONY, _FINE_FACE = np.float32(0.22), np.float32(0.6), np.float32(0.45)
_SHORT = np.float32(_FINEST)


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
    faces: np.uint32
    """Key of the faces of rocks."""
    slabs: NDArray[np.float32]
    """The anchor's place [m] in the repeat of the joints' warp and in its cell of slabs, shape [4].
    """
    slab_keys: NDArray[np.uint32]
    """As `soil_keys`, of the warp and of the slabs, shape [2, 3]."""
    shadow: tuple[np.float32, np.float32]
    """From the end of the shadow of a thing of unit height to its foot, east and north."""


def relief_about(
    anchor: Array, *, key: np.uint64, spacing: float, shadow: tuple[float, float]
) -> Relief:
    """The fine texture about a place of the world [m] of a ground with a spacing of nodes [m]."""
    seed = int(key)
    soil, soil_keys = _octaves(anchor, seed, min(SOIL_COARSEST, 1.5 * spacing))
    far, far_keys = _octaves(anchor, seed + 1, SOIL_COARSEST)
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
        faces=np.uint32(_word(seed + 2)),
        slabs=np.array([*warp_at, *slab_at], np.float32),
        slab_keys=np.array([[_word(seed + 3), *warp], [_word(seed + 4), *slab]], np.uint32),
        shadow=(np.float32(shadow[0]), np.float32(shadow[1])),
    )


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
    weight = (coarsest / SOIL_COARSEST) ** -0.35
    for octave in range(_OCTAVES):
        if wavelength < _FINEST:
            break
        place = turn * complex(*anchor) / wavelength + complex(0.37, 0.71) * octave
        cell, inside = _lattice(place)
        numbers.append([wavelength, turn.real, turn.imag, SOIL_STEEP * weight, *inside])
        keys.append([_word(seed + 7919 * octave), *cell])
        turn, wavelength, weight = turn * _TURN, 0.48 * wavelength, weight * SOIL_ROUGHER
    return np.array(numbers, np.float32), np.array(keys, np.uint32)


@inner
def finest(space):  # type: ignore[no-untyped-def]
    """The smallest pixel of the lanes [m]."""
    least = space[FOOTPRINT]
    for lane in range(1, LANES):
        least = min(least, space[FOOTPRINT + lane])
    return least


@inner
def soil_lanes(space, octaves, keys):  # type: ignore[no-untyped-def]
    """Fine relief of loose ground, faded out where a pixel cannot show it."""
    for lane in range(LANES):
        space[VALUE + lane], space[RISE_X + lane], space[RISE_Y + lane] = _0, _0, _0
    least = finest(space)
    for octave in range(len(octaves)):
        wave, cos, sin = octaves[octave, 0], octaves[octave, 1], octaves[octave, 2]
        steep, start_u, start_v = octaves[octave, 3], octaves[octave, 4], octaves[octave, 5]
        if _HALF * wave <= least:
            break
        key, first_i, first_j = (
            keys[octave, 0], np.int32(keys[octave, 1]), np.int32(keys[octave, 2])
        )  # fmt: skip
        per_metre = _1 / wave
        for lane in range(LANES):
            x, y = space[PLACE_X + lane], space[PLACE_Y + lane]
            u = (cos * x - sin * y) * per_metre + start_u
            v = (sin * x + cos * y) * per_metre + start_v
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
            shown = min(_1, max(_0, _HALF * wave / space[FOOTPRINT + lane] - _1))
            steeper = steep * shown * space[ROUGH + lane]
            space[RISE_X + lane] += steeper * (cos * rise_u + sin * rise_v)
            space[RISE_Y + lane] += steeper * (cos * rise_v - sin * rise_u)
            space[VALUE + lane] += _HALF * shown * height


@inner
def _corner(key, i, j, k, x, y, z, f, df, g, dg, h, dh):  # type: ignore[no-untyped-def]
    """What a corner of a cell adds to the height and its derivatives."""
    word = np.uint32(np.uint32(np.uint32(i) * PRIME_I) ^ np.uint32(np.uint32(j) * PRIME_J))
    word = mixed(np.uint32(np.uint32(word ^ np.uint32(np.uint32(k) * _K)) ^ key))
    p, q, o = low_half(word), high_half(word), low_half(np.uint32(word * MIX_1))
    at = p * x + q * y + o * z
    return (
        f * g * h * at,
        g * h * (df * at + f * p),
        f * h * (dg * at + g * q),
        f * g * (dh * at + h * o),
    )


@inner
def face_lanes(space, whole):  # type: ignore[no-untyped-def]
    """Roughness of rocks at places in their own frames [m].

    VALUE gets the albedo's noise, RISE the relief's gradient, which bends the normal. Lanes whose
    COARSEST wave is 0 get nothing.
    """
    for lane in range(LANES):
        space[VALUE + lane] = _0
        space[RISE_X + lane], space[RISE_Y + lane], space[RISE_Z + lane] = _0, _0, _0
    for octave in range(8):
        widest = _0
        for lane in range(LANES):
            wave = space[COARSEST + lane]
            if wave >= _SHORT:
                widest = max(widest, wave / space[FOOTPRINT + lane])
        if widest <= _2:
            break
        again = np.uint32(np.uint32(np.uint32(octave + 1) * _AGAIN) ^ whole)
        for lane in range(LANES):
            wave = max(space[COARSEST + lane], _SHORT)
            per_metre = _1 / wave
            key = np.uint32(np.uint32(np.int32(space[STONE + lane])) ^ again)
            u, v, w = (
                space[PLACE_X + lane] * per_metre,
                space[PLACE_Y + lane] * per_metre,
                space[PLACE_Z + lane] * per_metre,
            )
            i, j, k = floor32(u), floor32(v), floor32(w)
            r, s, t = u - np.float32(i), v - np.float32(j), w - np.float32(k)
            p, q, o = fade32(r), fade32(s), fade32(t)
            dp, dq, do = fading32(r), fading32(s), fading32(t)
            p_, q_, o_ = _1 - p, _1 - q, _1 - o
            i_, j_, k_ = np.int32(i + _ONE), np.int32(j + _ONE), np.int32(k + _ONE)
            r_, s_, t_ = r - _1, s - _1, t - _1
            a = _corner(key, i, j, k, r, s, t, p_, -dp, q_, -dq, o_, -do)
            b = _corner(key, i_, j, k, r_, s, t, p, dp, q_, -dq, o_, -do)
            c = _corner(key, i, j_, k, r, s_, t, p_, -dp, q, dq, o_, -do)
            d = _corner(key, i_, j_, k, r_, s_, t, p, dp, q, dq, o_, -do)
            e = _corner(key, i, j, k_, r, s, t_, p_, -dp, q_, -dq, o, do)
            f = _corner(key, i_, j, k_, r_, s, t_, p, dp, q_, -dq, o, do)
            g = _corner(key, i, j_, k_, r, s_, t_, p_, -dp, q, dq, o, do)
            h = _corner(key, i_, j_, k_, r_, s_, t_, p, dp, q, dq, o, do)
            height = a[0] + b[0] + c[0] + d[0] + e[0] + f[0] + g[0] + h[0]
            rise_u = a[1] + b[1] + c[1] + d[1] + e[1] + f[1] + g[1] + h[1]
            rise_v = a[2] + b[2] + c[2] + d[2] + e[2] + f[2] + g[2] + h[2]
            rise_w = a[3] + b[3] + c[3] + d[3] + e[3] + f[3] + g[3] + h[3]
            shown = min(_1, max(_0, _HALF * wave / space[FOOTPRINT + lane] - _1))
            shown = shown if space[COARSEST + lane] >= _SHORT else _0
            space[RISE_X + lane] += _STEEP * shown * rise_u
            space[RISE_Y + lane] += _STEEP * shown * rise_v
            space[RISE_Z + lane] += _STEEP * shown * rise_w
            space[VALUE + lane] += _STONY * shown * height
            space[COARSEST + lane] *= _FINE_FACE
