"""Texture finer than the ground's grid, made where a picture needs it: grain, clasts, rock faces.

It is visual only: no height in it is part of the world. All of it is addressed by position,
so that it never repeats and never swims between two pictures.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner, mix

_TURN_COS, _TURN_SIN = 0.4472135954999579, 0.8944271909999159
_COMPONENT = 1.0 / 32768.0
CLAST_SHARE = 0.45
"""Share of the cells of small stones that hold one."""
_CLAST_CELL = 0.16  # size of the cells of the largest small stones [m]
SOIL_COARSEST = 0.9
"""Longest waves of soil [m]; on a fine grid 1.5 spacings, since its heights hold the longer."""
SOIL_STEEP = 0.035
"""Rise of waves of soil so long, over that of unit noise."""
SOIL_ROUGHER = 1.28
"""How much steeper waves of half the length are: slopes grow as L^(H - 1), H about 0.65, so that
soil is rough to the hand and level to the eye (Helfenstein & Shepard 1999,
doi:10.1006/icar.1999.6160)."""
_PRIMES = (
    np.uint64(0x9E3779B185EBCA87),
    np.uint64(0xC2B2AE3D27D4EB4F),
    np.uint64(0x165667B19E3779F9),
)
# A function compiles anew for each of Python's integers that it is called with, not for NumPy's.
_BITS_0, _BITS_8, _BITS_16, _BITS_24, _BITS_32, _BITS_40, _BITS_48 = (
    np.uint64(bits) for bits in range(0, 49, 8)
)
_SOIL, _STONES = np.int64(0), np.int64(1)


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
def soil(key, x, y, coarsest, footprint):  # type: ignore[no-untyped-def]
    """Fine relief of loose ground below `coarsest` [m], faded out where a pixel cannot show it.

    Returns a value of about -1 to 1 for the albedo, and the rise per metre along x and y.
    """
    value, slope_x, slope_y = 0.0, 0.0, 0.0
    wavelength, weight, cos, sin = coarsest, (coarsest / SOIL_COARSEST) ** -0.35, 1.0, 0.0
    for octave in range(12):
        shown = min(1.0, 0.5 * wavelength / footprint - 1.0)
        if shown <= 0.0 or wavelength < 0.002:
            break
        u = (cos * x - sin * y) / wavelength + 0.37 * octave
        v = (sin * x + cos * y) / wavelength + 0.71 * octave
        height, rise_u, rise_v = noise_2d(mix(key, np.uint64(octave)), u, v)
        steep = SOIL_STEEP * shown * weight
        slope_x += steep * (cos * rise_u + sin * rise_v)
        slope_y += steep * (cos * rise_v - sin * rise_u)
        value += 0.5 * shown * height
        cos, sin = cos * _TURN_COS - sin * _TURN_SIN, sin * _TURN_COS + cos * _TURN_SIN
        wavelength *= 0.48
        weight *= SOIL_ROUGHER
    return value, slope_x, slope_y


@inner
def clasts(key, x, y, cell, share, sun_x, sun_y, footprint):  # type: ignore[no-untyped-def]
    """Small stones that lie on the soil, at most one to a cell of size `cell` [m].

    Returns the coverage (0 to 1), the rise per metre along x and y, the stone's own brightness, and
    the depth of its shadow on the soil (0 to 1). (sun_x, sun_y) leads from the end of a shadow to
    the foot of a thing of unit height.
    """
    i, j = np.int64(np.floor(x / cell)), np.int64(np.floor(y / cell))
    draw = cell_hash(key, i, j, _STONES)
    radius = cell * (0.10 + 0.09 * (0.5 + 0.5 * part(draw, _BITS_32)) ** 2)
    if 0.5 + 0.5 * part(draw, _BITS_48) > share or radius < 0.6 * footprint:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    room = 0.5 - radius / cell
    off_x = x - cell * (i + 0.5 + room * part(draw, _BITS_0))
    off_y = y - cell * (j + 0.5 + room * part(draw, _BITS_16))
    long, shear = 1.0 + 0.3 * part(draw, _BITS_8), 0.5 * part(draw, _BITS_40)
    reach = radius
    soft = max(0.1, footprint / reach)
    off_x, off_y = off_x * long + off_y * shear, off_y / long
    r = np.sqrt(off_x * off_x + off_y * off_y) / reach
    cover = min(1.0, max(0.0, (1.0 - r) / soft))
    steep = 0.9 * cover * r * r / reach
    behind_x, behind_y = off_x + sun_x * reach, off_y + sun_y * reach
    far = np.sqrt(behind_x * behind_x + behind_y * behind_y) / reach
    shadow = min(1.0, max(0.0, (1.1 - far) / max(0.35, soft)))
    return cover, -steep * off_x, -steep * off_y, part(draw, _BITS_24), shadow * (1.0 - cover)


@inner
def ground_grain(key, share, sun_x, sun_y, east, north, spacing, footprint):  # type: ignore[no-untyped-def]
    """Soil and small stones at a place of the world [m], down to the size of a pixel [m].

    Such a `share` of cells holds a stone, `spacing` is that of the ground's grid [m], and (sun_x,
    sun_y) leads from the end of a shadow to the foot of a thing of unit height. Returns brightness,
    depth of the stones' shadows (0 to 1), rise per metre along east and north.
    """
    coarsest = min(SOIL_COARSEST, 1.5 * spacing)
    tint, rise_x, rise_y = soil(key, east, north, coarsest, footprint)
    bright, shade = 1.0 + 0.22 * tint, 0.0
    some = share * min(1.5, max(0.2, 1.0 + 1.2 * tint))
    cell = _CLAST_CELL
    for scale in range(3):
        cover, stone_x, stone_y, tone, dark = clasts(
            mix(key, np.uint64(scale)), east, north, cell, some, sun_x, sun_y, footprint
        )
        rise_x, rise_y = rise_x * (1.0 - cover) + stone_x, rise_y * (1.0 - cover) + stone_y
        bright *= 1.0 + cover * (0.25 * tone - 0.08)
        shade = max(shade, dark)
        cell *= 0.42
    return bright, shade, rise_x, rise_y


@inner
def noise_3d(key, x, y, z):  # type: ignore[no-untyped-def]
    """Gradient noise of a unit lattice in space and its gradient."""
    i, j, k = np.int64(np.floor(x)), np.int64(np.floor(y)), np.int64(np.floor(z))
    r, s, t = x - i, y - j, z - k
    (u, du), (v, dv), (w, dw) = _fade(r), _fade(s), _fade(t)
    total, along_x, along_y, along_z = 0.0, 0.0, 0.0, 0.0
    for corner in range(8):
        a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
        hashed = cell_hash(key, i + a, j + b, k + c)
        p, q, o = part(hashed, _BITS_0), part(hashed, _BITS_16), part(hashed, _BITS_32)
        height = p * (r - a) + q * (s - b) + o * (t - c)
        f, df = (u, du) if a else (1.0 - u, -du)
        g, dg = (v, dv) if b else (1.0 - v, -dv)
        h, dh = (w, dw) if c else (1.0 - w, -dw)
        total += f * g * h * height
        along_x += g * h * (df * height + f * p)
        along_y += f * h * (dg * height + g * q)
        along_z += f * g * (dh * height + h * o)
    return total, along_x, along_y, along_z


@inner
def face(key, x, y, z, coarsest, footprint):  # type: ignore[no-untyped-def]
    """Roughness of a rock's surface at a place in its own frame [m].

    Returns a value of about -1 to 1 for the albedo, and the gradient of the relief, which bends the
    normal.
    """
    value, slope_x, slope_y, slope_z = 0.0, 0.0, 0.0, 0.0
    wavelength = coarsest
    for octave in range(8):
        shown = min(1.0, 0.5 * wavelength / footprint - 1.0)
        if shown <= 0.0 or wavelength < 0.002:
            break
        u, v, w = x / wavelength, y / wavelength, z / wavelength
        height, rise_u, rise_v, rise_w = noise_3d(mix(key, np.uint64(octave)), u, v, w)
        steep = 0.22 * shown
        slope_x += steep * rise_u
        slope_y += steep * rise_v
        slope_z += steep * rise_w
        value += 0.6 * shown * height
        wavelength *= 0.45
    return value, slope_x, slope_y, slope_z
