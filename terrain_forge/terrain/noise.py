"""Coherent noise that is addressed by position: aperiodic, and the same in every window.

Gradient noise (Perlin 2002, doi:10.1145/566654.566636) over a lattice whose gradients come from a
hash of (key, octave, cell), so that it never repeats. Each octave is rotated and shifted, so that
no two lattices share their zeros.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, inner, kernel, mix, over_chunks, uniform, zigzag

_TURN = 1.1071487177940904  # atan 2: no small multiple of it is close to a quarter turn
_ANGLES = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
GRADIENTS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=-1)


@inner
def _gradient(key, i, j):  # type: ignore[no-untyped-def]
    index = mix(mix(key, zigzag(i)), zigzag(j)) >> np.uint64(56)
    return GRADIENTS[index, 0], GRADIENTS[index, 1]


@inner
def _gradients(key, i, j):  # type: ignore[no-untyped-def]
    """Gradients at the corners of a cell: south-west, south-east, north-west, north-east."""
    sw, se = _gradient(key, i, j), _gradient(key, i + 1, j)
    nw, ne = _gradient(key, i, j + 1), _gradient(key, i + 1, j + 1)
    return sw, se, nw, ne


@inner
def _blend(gradients, u, v):  # type: ignore[no-untyped-def]
    """Noise at (u, v) of a cell, 0 to 1."""
    sw, se, nw, ne = gradients
    fade_u = u * u * u * (u * (u * 6.0 - 15.0) + 10.0)
    fade_v = v * v * v * (v * (v * 6.0 - 15.0) + 10.0)
    south = sw[0] * u + sw[1] * v
    south += fade_u * (se[0] * (u - 1.0) + se[1] * v - south)
    north = nw[0] * u + nw[1] * (v - 1.0)
    north += fade_u * (ne[0] * (u - 1.0) + ne[1] * (v - 1.0) - north)
    return south + fade_v * (north - south)


@kernel
def gradient_noise(key, x, y):  # type: ignore[no-untyped-def]
    """Gradient noise of a unit lattice at (x, y), about -0.7 to 0.7, zero at the lattice points."""
    i, j = np.int64(np.floor(x)), np.int64(np.floor(y))
    return _blend(_gradients(key, i, j), x - i, y - j)


@kernel
def _sum_octaves(  # type: ignore[no-untyped-def]
    first, last, key, east, north, wavelengths, amplitudes, turn, total
):
    for row in range(first, last):
        for octave in range(wavelengths.size):
            octave_key = mix(key, np.uint64(octave))
            shift_x = 1024.0 * uniform(mix(octave_key, np.uint64(1)))
            shift_y = 1024.0 * uniform(mix(octave_key, np.uint64(2)))
            cos = np.cos(octave * _TURN) / wavelengths[octave]
            sin = np.sin(octave * _TURN) / wavelengths[octave]
            amplitude = amplitudes[octave]
            cell_x, cell_y = np.int64(0), np.int64(0)
            gradients = _gradients(octave_key, cell_x, cell_y)
            for column in range(east.size):
                e = turn[0, 0] * east[column] + turn[0, 1] * north[row]
                n = turn[1, 0] * east[column] + turn[1, 1] * north[row]
                x = cos * e - sin * n + shift_x
                y = sin * e + cos * n + shift_y
                i, j = np.int64(np.floor(x)), np.int64(np.floor(y))
                if i != cell_x or j != cell_y:  # long octaves hardly ever change their cell
                    cell_x, cell_y = i, j
                    gradients = _gradients(octave_key, i, j)
                total[row, column] += amplitude * _blend(gradients, x - i, y - j)


def octaves(
    key: np.uint64,
    *,
    east: Array,
    north: Array,
    wavelengths: Array,
    amplitudes: Array,
    turn: Array | None = None,
) -> Array:
    """Sum of noise octaves at the nodes of a grid [m], shape [north, east].

    Octaves have lattices of `wavelengths` [m] and factors `amplitudes`, in the unit of the result;
    the 2 × 2 matrix `turn` leads from east and north to coordinates in which the noise is alike in
    all directions.
    """
    total = np.zeros((len(north), len(east)))
    over_chunks(
        _sum_octaves,
        len(north),
        key,
        np.array(east, np.float64, order="C"),
        np.array(north, np.float64, order="C"),
        np.array(wavelengths, np.float64),
        np.array(amplitudes, np.float64),
        np.eye(2) if turn is None else np.array(turn, np.float64),
        total,
    )
    return total
