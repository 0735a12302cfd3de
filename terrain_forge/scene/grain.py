"""Texture finer than the ground's grid, made where a picture needs it: grain, pebbles, slabs.

It is visual only: no height in it is part of the world. All of it is addressed by position,
so that it never repeats and never swims between two pictures.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner, mix

_TURN_COS, _TURN_SIN = 0.4472135954999579, 0.8944271909999159
_COMPONENT = 1.0 / 32768.0
CLAST_CELLS = 0.16, 0.09, 0.05
"""Cells of pebbles, at most one in each [m]."""
LEAST_CLAST, MORE_CLAST = 0.10, 0.12
"""Radii of pebbles in their cells: the smallest, and what the largest have more."""
CLAST_RISE = 1.5
"""Steepness of a pebble's edge, whose height is a third of that over its radius."""
SLAB_CELL = 0.62
"""Size of slabs of bedrock [m]."""
SLAB_JOINT = 0.016
"""Half the width of the joints between them [m]."""
SLAB_WALL = 0.6
"""Steepness of their edges at the joints, which sand has filled."""
SLAB_SHOWN = 1.0, 2.0
"""Sizes of slabs, in pixels, from which on they begin to show, and show in full."""
SOIL_COARSEST = 0.9
"""Longest waves of soil [m]; on a fine grid 1.5 spacings, since its heights hold the longer."""
SOIL_STEEP = 0.038
"""Rise of waves of soil so long, over that of unit noise."""
SOIL_HURST = 0.55
"""Slopes of waves grow as L^(H - 1): soil is rough to the hand and level to the eye. Measured are
0.5 to 0.7 and 15 to 35° RMS at centimetres on the Moon (Helfenstein & Shepard 1999,
doi:10.1006/icar.1999.6160), 0.54 to 0.61 at the Pathfinder site."""
SOIL_STEP = 0.48
"""Length of waves over that of the next longer."""
FAR_COARSEST = SOIL_COARSEST / SOIL_STEP
"""Longest waves of the land beyond the site, whose rings hold none so short [m]."""
SOIL_WARP = 0.5
"""How far the waves before move those after, in their lengths, so that no lattice shows."""
SOIL_SHOWN = 1.8, 3.8
"""Lengths of waves, in pixels, from which on they begin to show, and show in full: what a pixel's
own size leaves of them; optics blur them besides."""
CRUMB_WAVES = 0.004, 0.06
"""Shortest and longest waves of soil out of whose tops crumbs come [m]."""
CRUMB_FEW, CRUMB_MORE = 0.42, 0.5
"""Height of unit noise from which on there are crumbs, where the soil has none, and what of it goes
with the share of places that hold a pebble: at 0.6 a fifth of the ground for each length of waves.
"""
CRUMB_ANY = 10.0
"""How fast crumbs come with that share: soil without pebbles has none."""
CRUMB_RARER = 3.0
"""What is more of that height for each metre of wave: large crumbs are rarer."""
CRUMB_PATCHY = 3.0
"""How much the waves before gather crumbs."""
CRUMB_RISE = 0.11
"""Height of a crumb over the length of its wave."""
CRUMB_SMOOTH = 0.6
"""How much less steep waves are that have crumbs, which are the roughness there."""
CRUMB_EDGE = 0.15
"""Unit noise from a crumb's edge to its top."""
CRUMB_SOFT = 0.04
"""Unit noise over which an edge is drawn."""
CRUMB_SHADOW = 0.3
"""How far the shadow of a crumb falls at most, in lengths of its wave."""
CRUMB_TONE = 4.0
"""How much the waves before brighten or darken a crumb."""
_ROUGHER = SOIL_STEP ** (SOIL_HURST - 1.0)
_PRIMES = (
    np.uint64(0x9E3779B185EBCA87),
    np.uint64(0xC2B2AE3D27D4EB4F),
    np.uint64(0x165667B19E3779F9),
)
# A function compiles anew for each of Python's integers that it is called with, not for NumPy's.
_BITS_0, _BITS_8, _BITS_16, _BITS_24, _BITS_32, _BITS_40, _BITS_48 = (
    np.uint64(bits) for bits in range(0, 49, 8)
)
_SOIL, _STONES, _SLABS = np.int64(0), np.int64(1), np.int64(2)
_HEXAGON = 0.8660254037844386


@inner
def cell_hash(key, i, j, k):  # type: ignore[no-untyped-def]
    """A 64-bit hash of a lattice cell."""
    x, y, z = _PRIMES
    return mix(key, np.uint64(i) * x + np.uint64(j) * y + np.uint64(k) * z)


@inner
def part(hashed, shift):  # type: ignore[no-untyped-def]
    """Sixteen bits of a hash as a number from -1 to 1."""
    return np.float64((hashed >> np.uint64(shift)) & np.uint64(0xFFFF)) * _COMPONENT - 1.0


@inner
def _fade(t):  # type: ignore[no-untyped-def]
    """Perlin's quintic and its derivative."""
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0), 30.0 * t * t * (t * (t - 2.0) + 1.0)


@inner
def noise_2d(key, x, y):  # type: ignore[no-untyped-def]
    """Gradient noise of a unit lattice and its derivatives along x and y."""
    i, j = np.int64(np.floor(x)), np.int64(np.floor(y))
    s, t = x - i, y - j
    (u, du), (v, dv) = _fade(s), _fade(t)
    a, b = cell_hash(key, i, j, _SOIL), cell_hash(key, i + 1, j, _SOIL)
    c, d = cell_hash(key, i, j + 1, _SOIL), cell_hash(key, i + 1, j + 1, _SOIL)
    ax, ay, bx, by = part(a, _BITS_0), part(a, _BITS_16), part(b, _BITS_0), part(b, _BITS_16)
    cx, cy, dx, dy = part(c, _BITS_0), part(c, _BITS_16), part(d, _BITS_0), part(d, _BITS_16)
    sw, se = ax * s + ay * t, bx * (s - 1.0) + by * t
    nw, ne = cx * s + cy * (t - 1.0), dx * (s - 1.0) + dy * (t - 1.0)
    twist = sw - se - nw + ne
    value = sw + u * (se - sw) + v * (nw - sw) + u * v * twist
    slope_x = ax + u * (bx - ax) + v * (cx - ax) + u * v * (ax - bx - cx + dx)
    slope_y = ay + u * (by - ay) + v * (cy - ay) + u * v * (ay - by - cy + dy)
    return value, slope_x + du * (v * twist + se - sw), slope_y + dv * (u * twist + nw - sw)


@inner
def soil(key, x, y, coarsest, grain, footprint):  # type: ignore[no-untyped-def]
    """Fine relief of loose ground below `coarsest` [m], faded out where a pixel cannot show it.

    Crumbs are what of shorter waves stands above a height, so that no two have one outline.
    Returns a value of about -1 to 1 for the albedo, and the rise per metre along x and y.
    """
    value, slope_x, slope_y, warp_u, warp_v = 0.0, 0.0, 0.0, 0.0, 0.0
    wavelength, weight, cos, sin = (
        coarsest,
        (coarsest / SOIL_COARSEST) ** (SOIL_HURST - 1.0),
        1.0,
        0.0,
    )
    for octave in range(12):
        shown = min(1.0, (wavelength / footprint - SOIL_SHOWN[0]) / (SOIL_SHOWN[1] - SOIL_SHOWN[0]))
        if shown <= 0.0 or wavelength < 0.002:
            break
        u = (cos * x - sin * y) / wavelength + 0.37 * octave + warp_u
        v = (sin * x + cos * y) / wavelength + 0.71 * octave + warp_v
        height, rise_u, rise_v = noise_2d(mix(key, np.uint64(octave)), u, v)
        steep = SOIL_STEEP * shown * weight * grain[1]
        value += 0.5 * shown * height
        if CRUMB_WAVES[0] <= wavelength <= CRUMB_WAVES[1]:
            some = grain[0] * min(1.5, max(0.0, 1.0 + CRUMB_PATCHY * value))
            over = height - CRUMB_FEW - CRUMB_RARER * wavelength + CRUMB_MORE * some
            soft = max(CRUMB_SOFT, 0.5 * footprint / wavelength)
            there = shown * min(1.0, CRUMB_ANY * some)
            cover = there * min(1.0, max(0.0, over / soft))
            steep *= max(0.0, 1.0 - CRUMB_SMOOTH * some)
            steep += 2.0 * CRUMB_RISE / CRUMB_EDGE * cover * max(0.0, 1.0 - over / CRUMB_EDGE)
            value += CRUMB_TONE * cover * warp_u
        slope_x += steep * (cos * rise_u + sin * rise_v)
        slope_y += steep * (cos * rise_v - sin * rise_u)
        warp_u, warp_v = SOIL_WARP * height, SOIL_WARP * 0.4 * rise_u
        cos, sin = cos * _TURN_COS - sin * _TURN_SIN, sin * _TURN_COS + cos * _TURN_SIN
        wavelength *= SOIL_STEP
        weight *= _ROUGHER
    return value, slope_x, slope_y


@inner
def clasts(key, x, y, cell, share, footprint):  # type: ignore[no-untyped-def]
    """Pebbles that lie on the soil, at most one to a cell of size `cell` [m].

    Returns the coverage (0 to 1), the rise per metre along x and y, and the stone's own brightness.
    """
    i, j = np.int64(np.floor(x / cell)), np.int64(np.floor(y / cell))
    draw = cell_hash(key, i, j, _STONES)
    wide = 0.5 + 0.5 * part(draw, _BITS_32)
    radius = cell * (LEAST_CLAST + MORE_CLAST * wide * wide)
    if 0.5 + 0.5 * part(draw, _BITS_48) > share or radius < 0.6 * footprint:
        return 0.0, 0.0, 0.0, 0.0
    room = 0.5 - 1.4 * radius / cell
    off_x = (x - cell * (i + 0.5 + room * part(draw, _BITS_0))) / radius
    off_y = (y - cell * (j + 0.5 + room * part(draw, _BITS_16))) / radius
    long, shear = 1.0 + 0.3 * part(draw, _BITS_8), 0.6 * part(draw, _BITS_40)
    p, q = off_x * long + off_y * shear, off_y / long
    away, along_x, along_y = _hexagon(p, q)
    soft = max(0.1, footprint / radius)
    cover = min(1.0, max(0.0, (1.0 - away) / soft))
    steep = CLAST_RISE * cover * min(away * away, 1.0)
    rise_x = -steep * along_x * long
    rise_y = -steep * (along_x * shear + along_y / long)
    return cover, rise_x, rise_y, part(draw, _BITS_24)


@inner
def _hexagon(x, y):  # type: ignore[no-untyped-def]
    """How far out of a blunt hexagon a place is, 1 on its edge, and which way that grows."""
    a, b, c = x, 0.5 * x + _HEXAGON * y, -0.5 * x + _HEXAGON * y
    flat, to_x, to_y = abs(a), np.sign(a), 0.0
    if abs(b) > flat:
        flat, to_x, to_y = abs(b), 0.5 * np.sign(b), _HEXAGON * np.sign(b)
    if abs(c) > flat:
        flat, to_x, to_y = abs(c), -0.5 * np.sign(c), _HEXAGON * np.sign(c)
    round_ = np.sqrt(x * x + y * y) + 1e-9
    return (
        0.6 * flat + 0.4 * round_,
        0.6 * to_x + 0.4 * x / round_,
        0.6 * to_y + 0.4 * y / round_,
    )


@inner
def slabs(key, x, y, footprint):  # type: ignore[no-untyped-def]
    """Bedrock that joints part into slabs.

    Returns the depth of the joint here (0 to 1), the rise per metre along x and y, and the slab's
    own brightness, -1 to 1.
    """
    warp_x, _, _ = noise_2d(mix(key, np.uint64(91)), 2.7 * x, 2.7 * y)
    warp_y, _, _ = noise_2d(mix(key, np.uint64(92)), 2.7 * x, 2.7 * y)
    u, v = x / SLAB_CELL + 0.35 * warp_x, 1.4 * y / SLAB_CELL + 0.35 * warp_y
    i, j = np.int64(np.floor(u)), np.int64(np.floor(v))
    first, second, tone = 9.0, 9.0, 0.0
    first_x, first_y, second_x, second_y, lean_x, lean_y = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(-1, 2):
        for b in range(-1, 2):
            draw = cell_hash(key, i + a, j + b, _SLABS)
            to_x = i + a + 0.5 + 0.42 * part(draw, _BITS_0) - u
            to_y = j + b + 0.5 + 0.42 * part(draw, _BITS_16) - v
            away = np.sqrt(to_x * to_x + to_y * to_y)
            if away < first:
                second, second_x, second_y = first, first_x, first_y
                first, first_x, first_y = away, to_x, to_y
                tone, lean_x, lean_y = (
                    part(draw, _BITS_32), part(draw, _BITS_40), part(draw, _BITS_48)
                )  # fmt: skip
            elif away < second:
                second, second_x, second_y = away, to_x, to_y
    edge_x, edge_y = second_x - first_x, second_y - first_y
    length = np.sqrt(edge_x * edge_x + edge_y * edge_y) + 1e-9
    near = 0.5 * (second * second - first * first) / length * SLAB_CELL  # to the joint [m]
    wide = SLAB_JOINT + 0.5 * footprint
    joint = min(1.0, max(0.0, 2.0 - 2.0 * near / wide)) * SLAB_JOINT / wide
    wall = SLAB_WALL * min(1.0, max(0.0, 2.5 - near / wide)) * (1.0 - joint) * SLAB_JOINT / wide
    return (
        joint,
        -wall * edge_x / length + 0.05 * lean_x * (1.0 - joint),
        -wall * edge_y / length + 0.05 * lean_y * (1.0 - joint),
        tone,
    )


@inner
def ground_grain(key, grain, east, north, spacing, footprint):  # type: ignore[no-untyped-def]
    """Soil, pebbles and slabs at a place of the world [m], down to the size of a pixel [m].

    `grain` are the share of cells that hold a pebble, the soil's roughness and how much of it is
    slabs; `spacing` is that of the ground's grid [m]. Returns brightness, rise per metre along east
    and north.
    """
    coarsest = min(SOIL_COARSEST, 1.5 * spacing)
    tint, rise_x, rise_y = soil(key, east, north, coarsest, grain, footprint)
    bright = 1.0 + 0.22 * tint
    some = grain[0] * min(1.5, max(0.2, 1.0 + 1.2 * tint))
    begin, full = SLAB_SHOWN
    share = grain[2] * min(1.0, max(0.0, (SLAB_CELL / footprint - begin) / (full - begin)))
    if share > 0.0:
        joint, slab_x, slab_y, tone = slabs(key, east, north, footprint)
        rise_x, rise_y = rise_x + share * slab_x, rise_y + share * slab_y
        bright *= 1.0 + share * (0.16 * tone * (1.0 - joint) - 0.3 * joint)
        some *= 1.0 - 0.6 * share * (1.0 - joint)
    for layer in range(len(CLAST_CELLS)):
        cover, stone_x, stone_y, tone = clasts(
            mix(key, np.uint64(layer)), east, north, CLAST_CELLS[layer], some, footprint
        )
        rise_x, rise_y = rise_x * (1.0 - cover) + stone_x, rise_y * (1.0 - cover) + stone_y
        bright *= 1.0 + cover * (0.35 * tone - 0.08)
    return bright, rise_x, rise_y
