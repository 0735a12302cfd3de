"""Pebbles on the soil and slabs of bedrock for eight pixels at once, as `grain.py` for one."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner
from terrain_forge.scene.grain import (
    CLAST_RISE,
    LEAST_CLAST,
    MORE_CLAST,
    SLAB_CELL,
    SLAB_JOINT,
    SLAB_SHOWN,
    SLAB_WALL,
)
from terrain_forge.scene.packets import LANES
from terrain_forge.scene.relief import (
    COVER,
    FOOTPRINT,
    PEBBLY,
    PLACE_X,
    PLACE_Y,
    RISE_X,
    RISE_Y,
    SHADED,
    SHADOWED,
    SLABBY,
    VALUE,
    finest,
)
from terrain_forge.scene.words import cell32, fade32, floor32, high_half, low_half, mixed

_0, _HALF, _1, _2 = (np.float32(n) for n in (0.0, 0.5, 1.0, 2.0))
_ONE = np.int32(1)
_HASH_LONG, _HASH_TONE = np.uint32(0xB5297A4D), np.uint32(0x68E31DA4)
_R0, _R1, _FADE_FROM, _FADE_OVER = (np.float32(n) for n in (LEAST_CLAST, MORE_CLAST, 0.6, 0.6))
_LONG, _SHEAR, _SOFT, _DOME, _DARK_REACH, _DARK_SOFT = (
    np.float32(n) for n in (0.3, 0.6, 0.1, CLAST_RISE, 1.1, 0.25)
)
_TONE, _DULL, _TINT, _MORE, _LEAST, _MOST = (
    np.float32(n) for n in (0.35, 0.08, 0.22, 1.2, 0.2, 1.5)
)
_HEXAGON, _FLAT, _ROUND, _FREE, _BEHIND, _NONE = (
    np.float32(n) for n in (0.8660254, 0.6, 0.4, 1.4, 0.25, 1e-9)
)


@inner
def clast_lanes(space, relief):  # type: ignore[no-untyped-def]
    """Lay pebbles on the soil that `soil_lanes` made; VALUE becomes the brightness."""
    sun_x, sun_y = _BEHIND * relief.shadow[0], _BEHIND * relief.shadow[1]
    slabby = _0
    for lane in range(LANES):
        tint = space[VALUE + lane]
        space[COVER + lane] = space[PEBBLY + lane] * min(_MOST, max(_LEAST, _1 + _MORE * tint))
        space[VALUE + lane], space[SHADOWED + lane] = _1 + _TINT * tint, space[SHADED + lane]
        slabby = max(slabby, space[SLABBY + lane])
    if slabby > _0:
        _slab_lanes(space, relief)
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
            i, j = floor32(u), floor32(v)
            draw = cell32(key, np.int32(i + first_i), np.int32(j + first_j))
            more, form = mixed(np.uint32(draw ^ _HASH_LONG)), mixed(np.uint32(draw ^ _HASH_TONE))
            wide = _HALF + _HALF * low_half(more)
            radius = _R0 + _R1 * wide * wide  # in cells
            pixel = space[FOOTPRINT + lane] * per_metre
            there = _1 if _HALF + _HALF * high_half(more) <= space[COVER + lane] else _0
            there *= min(_1, max(_0, (radius / pixel - _FADE_FROM) / _FADE_OVER))
            free = _HALF - _FREE * radius
            x = (u - np.float32(i) - _HALF - free * low_half(draw)) / radius
            y = (v - np.float32(j) - _HALF - free * high_half(draw)) / radius
            long, shear = _1 + _LONG * low_half(form), _SHEAR * high_half(form)
            p, q = x * long + y * shear, y / long
            # A blunt hexagon: how far out of it, and which way that grows.
            b, c = _HALF * p + _HEXAGON * q, _HEXAGON * q - _HALF * p
            flat, to_x, to_y = abs(p), _1 if p > _0 else -_1, _0
            sign = _1 if b > _0 else -_1
            further = abs(b) > flat
            flat, to_x, to_y = (
                abs(b) if further else flat, _HALF * sign if further else to_x,
                _HEXAGON * sign if further else to_y,
            )  # fmt: skip
            sign = _1 if c > _0 else -_1
            further = abs(c) > flat
            flat, to_x, to_y = (
                abs(c) if further else flat, -_HALF * sign if further else to_x,
                _HEXAGON * sign if further else to_y,
            )  # fmt: skip
            round_ = np.sqrt(p * p + q * q) + _NONE
            r = _FLAT * flat + _ROUND * round_
            to_x, to_y = _FLAT * to_x + _ROUND * p / round_, _FLAT * to_y + _ROUND * q / round_
            soft = max(_SOFT, pixel / radius)
            cover = there * min(_1, max(_0, (_1 - r) / soft))
            steep = _DOME * cover * min(_1, r * r)
            back_x, back_y = x + sun_x, y + sun_y
            far = np.sqrt(back_x * back_x + back_y * back_y)
            dark = there * min(_1, max(_0, (_DARK_REACH - far) / max(_DARK_SOFT, soft)))
            space[RISE_X + lane] = space[RISE_X + lane] * (_1 - cover) - steep * to_x * long
            space[RISE_Y + lane] = space[RISE_Y + lane] * (_1 - cover) - steep * (
                to_x * shear + to_y / long
            )
            tone = low_half(np.uint32(form ^ more))
            space[VALUE + lane] *= _1 + cover * (_TONE * tone - _DULL)
            space[SHADOWED + lane] = max(space[SHADOWED + lane], dark) * (_1 - cover)


_WARP, _WARPED, _ACROSS, _SLAB, _JOINT, _JITTER, _FAR, _WALL, _LEAN = (
    np.float32(n) for n in (2.7, 0.35, 1.4, SLAB_CELL, SLAB_JOINT, 0.42, 9.0, SLAB_WALL, 0.05)
)
_BEGIN, _GROW = np.float32(SLAB_SHOWN[0]), np.float32(1.0 / (SLAB_SHOWN[1] - SLAB_SHOWN[0]))
_TWO_AND_HALF, _SLAB_TONE, _JOINT_DARK, _BARE = (np.float32(n) for n in (2.5, 0.16, 0.3, 0.6))


@inner
def _slab_lanes(space, relief):  # type: ignore[no-untyped-def]
    """Part the bedrock of the lanes that see some into slabs, as `grain.slabs` does."""
    warp_i, warp_j = np.int32(relief.slab_keys[0, 1]), np.int32(relief.slab_keys[0, 2])
    slab_i, slab_j = np.int32(relief.slab_keys[1, 1]), np.int32(relief.slab_keys[1, 2])
    warp_key, slab_key = relief.slab_keys[0, 0], relief.slab_keys[1, 0]
    for lane in range(LANES):
        shown = (_SLAB / space[FOOTPRINT + lane] - _BEGIN) * _GROW
        share = space[SLABBY + lane] * min(_1, max(_0, shown))
        if share <= _0:
            continue
        x, y = space[PLACE_X + lane], space[PLACE_Y + lane]
        u, v = x * _WARP + relief.slabs[0], y * _WARP + relief.slabs[1]
        i, j = floor32(u), floor32(v)
        s, t = fade32(u - np.float32(i)), fade32(v - np.float32(j))
        i, j = np.int32(i + warp_i), np.int32(j + warp_j)
        right, above = np.int32(i + _ONE), np.int32(j + _ONE)
        a, b = cell32(warp_key, i, j), cell32(warp_key, right, j)
        c, d = cell32(warp_key, i, above), cell32(warp_key, right, above)
        south, north = (
            low_half(a) + s * (low_half(b) - low_half(a)),
            low_half(c) + s * (low_half(d) - low_half(c)),
        )
        warp_x = _HALF * (south + t * (north - south))
        south, north = (
            high_half(a) + s * (high_half(b) - high_half(a)),
            high_half(c) + s * (high_half(d) - high_half(c)),
        )
        warp_y = _HALF * (south + t * (north - south))
        u = x / _SLAB + relief.slabs[2] + _WARPED * warp_x
        v = _ACROSS * y / _SLAB + relief.slabs[3] + _WARPED * warp_y
        i, j = floor32(u), floor32(v)
        first, second, tone, lean_x, lean_y = _FAR, _FAR, _0, _0, _0
        first_x, first_y, second_x, second_y = _0, _0, _0, _0
        for near in range(9):
            column, row = np.int32(i + near % 3 - 1), np.int32(j + near // 3 - 1)
            draw = cell32(slab_key, np.int32(column + slab_i), np.int32(row + slab_j))
            to_x = np.float32(column) + _HALF + _JITTER * low_half(draw) - u
            to_y = np.float32(row) + _HALF + _JITTER * high_half(draw) - v
            away = np.sqrt(to_x * to_x + to_y * to_y)
            if away < first:
                second, second_x, second_y = first, first_x, first_y
                first, first_x, first_y = away, to_x, to_y
                more = mixed(np.uint32(draw ^ _HASH_TONE))
                tone, lean_x, lean_y = (
                    low_half(np.uint32(more ^ draw)),
                    low_half(more),
                    high_half(more),
                )
            elif away < second:
                second, second_x, second_y = away, to_x, to_y
        edge_x, edge_y = second_x - first_x, second_y - first_y
        length = np.sqrt(edge_x * edge_x + edge_y * edge_y) + _NONE
        near_joint = _HALF * (second * second - first * first) / length * _SLAB
        wide = _JOINT + _HALF * space[FOOTPRINT + lane]
        joint = min(_1, max(_0, _2 - _2 * near_joint / wide)) * _JOINT / wide
        wall = _WALL * min(_1, max(_0, _TWO_AND_HALF - near_joint / wide)) * (_1 - joint)
        wall *= _JOINT / wide
        space[RISE_X + lane] += share * (_LEAN * lean_x * (_1 - joint) - wall * edge_x / length)
        space[RISE_Y + lane] += share * (_LEAN * lean_y * (_1 - joint) - wall * edge_y / length)
        space[VALUE + lane] *= _1 + share * (_SLAB_TONE * tone * (_1 - joint) - _JOINT_DARK * joint)
        space[COVER + lane] *= _1 - _BARE * share * (_1 - joint)
