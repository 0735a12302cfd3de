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
from terrain_forge.scene.grain import SOIL_COARSEST, SOIL_ROUGHER, SOIL_STEEP
from terrain_forge.scene.packets import LANES

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
) = (LANES * row for row in range(12))
"""Where the lanes' numbers begin in a workspace: a place [m], the size of a pixel there [m], the
albedo's noise, the rise per metre, and of small stones how much of the pixel they cover, their
longest wave [m], the part of sunlight that they keep off, and a rock's key, 0 to 2²⁴."""
RELIEF_ROWS = 12

_OCTAVES = 12
_FINEST = 0.002  # shortest waves [m]
_CLAST_CELLS = 0.16, 0.0672, 0.028224  # cells of small stones, at most one in each [m]
_TURN = complex(0.4472135954999579, 0.8944271909999159)

_0, _HALF, _1, _2 = (np.float32(n) for n in (0.0, 0.5, 1.0, 2.0))
_6, _10, _15, _30 = (np.float32(n) for n in (6.0, 10.0, 15.0, 30.0))
_ONE = np.int32(1)
_I, _J, _K = np.uint32(0x9E3779B1), np.uint32(0x85EBCA77), np.uint32(0xC2B2AE3D)
_MIX_1, _MIX_2 = np.uint32(0x7FEB352D), np.uint32(0x846CA68B)
_15_BITS, _16_BITS, _LOW = np.uint32(15), np.uint32(16), np.uint32(0xFFFF)
_AGAIN = np.uint32(0x27D4EB2F)
_COMPONENT = np.float32(1.0 / 32768.0)
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
    share: np.float32
    """Share of cells that hold a small stone."""
    shadow: tuple[np.float32, np.float32]
    """From the end of the shadow of a thing of unit height to its foot, east and north."""


def relief_about(
    anchor: Array, *, key: np.uint64, spacing: float, share: float, shadow: tuple[float, float]
) -> Relief:
    """The fine texture about a place of the world [m] of a ground with a spacing of nodes [m]."""
    seed = int(key)
    soil, soil_keys = _octaves(anchor, seed, min(SOIL_COARSEST, 1.5 * spacing))
    far, far_keys = _octaves(anchor, seed + 1, SOIL_COARSEST)
    cells = [_lattice(complex(*anchor) / cell) for cell in _CLAST_CELLS]
    return Relief(
        soil=soil,
        soil_keys=soil_keys,
        far=far,
        far_keys=far_keys,
        clasts=np.array(
            [[cell, *place] for cell, (_, place) in zip(_CLAST_CELLS, cells, strict=True)],
            np.float32,
        ),
        clast_keys=np.array(
            [[_word(seed + 77 * n), *cell] for n, (cell, _) in enumerate(cells)], np.uint32
        ),
        faces=np.uint32(_word(seed + 2)),
        share=np.float32(share),
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
def _mixed(h):  # type: ignore[no-untyped-def]
    """A well-mixed word (Wellons 2018, lowbias32)."""
    h = np.uint32(np.uint32(h ^ np.uint32(h >> _16_BITS)) * _MIX_1)
    h = np.uint32(np.uint32(h ^ np.uint32(h >> _15_BITS)) * _MIX_2)
    return np.uint32(h ^ np.uint32(h >> _16_BITS))


@inner
def _cell(key, i, j):  # type: ignore[no-untyped-def]
    a, b = np.uint32(np.uint32(i) * _I), np.uint32(np.uint32(j) * _J)
    return _mixed(np.uint32(np.uint32(a ^ b) ^ key))


@inner
def _low(h):  # type: ignore[no-untyped-def]
    """Half of a word as a number from -1 to 1."""
    return np.float32(np.int32(np.uint32(h & _LOW))) * _COMPONENT - _1


@inner
def _high(h):  # type: ignore[no-untyped-def]
    """The other half."""
    return np.float32(np.int32(np.uint32(h >> _16_BITS))) * _COMPONENT - _1


@inner
def _floor(x):  # type: ignore[no-untyped-def]
    i = np.int32(x)
    return np.int32(i - _ONE) if np.float32(i) > x else i


@inner
def _fade(t):  # type: ignore[no-untyped-def]
    """Perlin's quintic."""
    return t * t * t * (t * (t * _6 - _15) + _10)


@inner
def _fading(t):  # type: ignore[no-untyped-def]
    """Its derivative."""
    return _30 * t * t * (t * (t - _2) + _1)


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
            i, j = _floor(u), _floor(v)
            s, t = u - np.float32(i), v - np.float32(j)
            i, j = np.int32(i + first_i), np.int32(j + first_j)
            right, above = np.int32(i + _ONE), np.int32(j + _ONE)
            a, b = _cell(key, i, j), _cell(key, right, j)
            c, d = _cell(key, i, above), _cell(key, right, above)
            ax, ay, bx, by = _low(a), _high(a), _low(b), _high(b)
            cx, cy, dx, dy = _low(c), _high(c), _low(d), _high(d)
            sw, se = ax * s + ay * t, bx * (s - _1) + by * t
            nw, ne = cx * s + cy * (t - _1), dx * (s - _1) + dy * (t - _1)
            p, q, twist = _fade(s), _fade(t), sw - se - nw + ne
            height = sw + p * (se - sw) + q * (nw - sw) + p * q * twist
            rise_u = ax + p * (bx - ax) + q * (cx - ax) + p * q * (ax - bx - cx + dx)
            rise_v = ay + p * (by - ay) + q * (cy - ay) + p * q * (ay - by - cy + dy)
            rise_u += _fading(s) * (q * twist + se - sw)
            rise_v += _fading(t) * (p * twist + nw - sw)
            shown = min(_1, max(_0, _HALF * wave / space[FOOTPRINT + lane] - _1))
            steeper = steep * shown
            space[RISE_X + lane] += steeper * (cos * rise_u + sin * rise_v)
            space[RISE_Y + lane] += steeper * (cos * rise_v - sin * rise_u)
            space[VALUE + lane] += _HALF * shown * height


_HASH_LONG, _HASH_TONE = np.uint32(0xB5297A4D), np.uint32(0x68E31DA4)
_R0, _R1, _FADE_FROM, _FADE_OVER = (np.float32(n) for n in (0.10, 0.09, 0.6, 0.6))
_LONG, _SHEAR, _SOFT, _DOME, _DARK_REACH, _DARK_SOFT = (
    np.float32(n) for n in (0.3, 0.5, 0.1, 0.9, 1.1, 0.35)
)
_TONE, _DULL, _TINT, _MORE, _LEAST, _MOST = (
    np.float32(n) for n in (0.25, 0.08, 0.22, 1.2, 0.2, 1.5)
)


@inner
def clast_lanes(space, relief):  # type: ignore[no-untyped-def]
    """Lay small stones on the soil that `soil_lanes` made; VALUE becomes the brightness."""
    share, sun_x, sun_y = relief.share, relief.shadow[0], relief.shadow[1]
    for lane in range(LANES):
        tint = space[VALUE + lane]
        space[COVER + lane] = share * min(_MOST, max(_LEAST, _1 + _MORE * tint))
        space[VALUE + lane], space[SHADOWED + lane] = _1 + _TINT * tint, _0
    least = finest(space)
    for layer in range(len(relief.clasts)):
        cell, start_u, start_v = (
            relief.clasts[layer, 0], relief.clasts[layer, 1], relief.clasts[layer, 2]
        )  # fmt: skip
        if (_R0 + _R1) * cell <= _FADE_FROM * least:
            break
        key = relief.clast_keys[layer, 0]
        first_i, first_j = (
            np.int32(relief.clast_keys[layer, 1]), np.int32(relief.clast_keys[layer, 2])
        )  # fmt: skip
        per_metre = _1 / cell
        for lane in range(LANES):
            u = space[PLACE_X + lane] * per_metre + start_u
            v = space[PLACE_Y + lane] * per_metre + start_v
            i, j = _floor(u), _floor(v)
            draw = _cell(key, np.int32(i + first_i), np.int32(j + first_j))
            more, form = _mixed(np.uint32(draw ^ _HASH_LONG)), _mixed(np.uint32(draw ^ _HASH_TONE))
            wide = _HALF + _HALF * _low(more)
            radius = _R0 + _R1 * wide * wide  # in cells
            pixel = space[FOOTPRINT + lane] * per_metre
            there = _1 if _HALF + _HALF * _high(more) <= space[COVER + lane] else _0
            there *= min(_1, max(_0, (radius / pixel - _FADE_FROM) / _FADE_OVER))
            free = _HALF - radius
            x = u - np.float32(i) - _HALF - free * _low(draw)
            y = v - np.float32(j) - _HALF - free * _high(draw)
            long, shear = _1 + _LONG * _low(form), _SHEAR * _high(form)
            x, y = x * long + y * shear, y / long
            soft = max(_SOFT, pixel / radius)
            r = np.sqrt(x * x + y * y) / radius
            cover = there * min(_1, max(_0, (_1 - r) / soft))
            steep = _DOME * cover * r * r / radius
            back_x, back_y = x + sun_x * radius, y + sun_y * radius
            far = np.sqrt(back_x * back_x + back_y * back_y) / radius
            dark = there * min(_1, max(_0, (_DARK_REACH - far) / max(_DARK_SOFT, soft)))
            space[RISE_X + lane] = space[RISE_X + lane] * (_1 - cover) - steep * x
            space[RISE_Y + lane] = space[RISE_Y + lane] * (_1 - cover) - steep * y
            tone = _low(np.uint32(form ^ more))
            space[VALUE + lane] *= _1 + cover * (_TONE * tone - _DULL)
            space[SHADOWED + lane] = max(space[SHADOWED + lane], dark * (_1 - cover))


@inner
def _corner(key, i, j, k, x, y, z, f, df, g, dg, h, dh):  # type: ignore[no-untyped-def]
    """What a corner of a cell adds to the height and its derivatives."""
    word = np.uint32(np.uint32(np.uint32(i) * _I) ^ np.uint32(np.uint32(j) * _J))
    word = _mixed(np.uint32(np.uint32(word ^ np.uint32(np.uint32(k) * _K)) ^ key))
    p, q, o = _low(word), _high(word), _low(np.uint32(word * _MIX_1))
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
            i, j, k = _floor(u), _floor(v), _floor(w)
            r, s, t = u - np.float32(i), v - np.float32(j), w - np.float32(k)
            p, q, o = _fade(r), _fade(s), _fade(t)
            dp, dq, do = _fading(r), _fading(s), _fading(t)
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
