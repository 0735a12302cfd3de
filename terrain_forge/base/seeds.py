"""Randomness addressed by what and where, never by when (docs/conventions.md).

A stage has one 64-bit key. Every element of the stage is drawn by hashing (key, address) with a
counter-based mixer (the finaliser of SplitMix64: Steele, Lea & Flood 2014,
doi:10.1145/2660193.2660195), so the order of drawing, the number of workers and the window do not
matter. Signed lattice cells are zig-zag coded into the address.
"""

from __future__ import annotations

from typing import Annotated
from zlib import crc32

import numpy as np
from annotated_types import Ge
from numba import uint64

from terrain_forge.base.given import checked
from terrain_forge.base.kernels import kernel

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_MEAN_AT_ONCE = 512.0


@checked
def stage_key(root: Annotated[int, Ge(0)], stage: str) -> np.uint64:
    """The 64-bit key of a named stage under the recipe's root seed."""
    sequence = np.random.SeedSequence(root, spawn_key=(crc32(stage.encode()),))
    return np.uint64(sequence.generate_state(1, np.uint64)[0])


@kernel
def zigzag(n):  # type: ignore[no-untyped-def]
    """Code a signed integer as an unsigned one: 0, -1, 1, -2 → 0, 1, 2, 3."""
    return uint64((n << 1) ^ (n >> 63))


@kernel
def mix(key, word):  # type: ignore[no-untyped-def]
    """Hash one more 64-bit word of an address into a key; chain it over the whole address."""
    z = uint64(key) + (uint64(word) + uint64(1)) * _GOLDEN
    z = (z ^ (z >> uint64(30))) * _MIX_1
    z = (z ^ (z >> uint64(27))) * _MIX_2
    return z ^ (z >> uint64(31))


@kernel
def uniform(hashed):  # type: ignore[no-untyped-def]
    """A float64 in the open interval (0, 1) from the upper 53 bits of a hash."""
    return (np.float64(uint64(hashed) >> uint64(11)) + 0.5) * (1.0 / 9007199254740992.0)


@kernel
def normal(hashed):  # type: ignore[no-untyped-def]
    """A standard normal number of a hash, by inversion of one uniform.

    Wichura 1988, algorithm AS 241, PPND7 (doi:10.2307/2347330): right to 7 digits.
    """
    p = uniform(hashed)
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        above = ((59.109374720 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179
        below = ((67.187563600 * r + 78.757757664) * r + 17.895169469) * r + 1.0
        return q * above / below
    r = np.sqrt(-np.log(p if q < 0.0 else 1.0 - p))
    if r <= 5.0:
        r -= 1.6
        above = ((0.17023821103 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777
        below = (0.12021132975 * r + 0.73700164250) * r + 1.0
    else:
        r -= 5.0
        above = ((0.017337203997 * r + 0.42868294337) * r + 3.0812263860) * r + 6.6579051150
        below = (0.012258202635 * r + 0.24197894225) * r + 1.0
    return -above / below if q < 0.0 else above / below


@kernel
def uniforms(key, count):  # type: ignore[no-untyped-def]
    """Uniforms in (0, 1) of the addresses 0 … count - 1 under a key, shape [count]."""
    drawn = np.empty(count)
    for n in range(count):
        drawn[n] = uniform(mix(key, n))
    return drawn


@kernel
def uniforms_at(addresses, word):  # type: ignore[no-untyped-def]
    """Uniforms in (0, 1) of a word after each of some hashed addresses, shape [addresses]."""
    drawn = np.empty(len(addresses))
    for n in range(len(addresses)):
        drawn[n] = uniform(mix(addresses[n], word))
    return drawn


@kernel
def normals(key, count):  # type: ignore[no-untyped-def]
    """Standard normal numbers of the addresses 0 … count - 1 under a key, shape [count]."""
    drawn = np.empty(count)
    for n in range(count):
        drawn[n] = normal(mix(key, n))
    return drawn


@kernel
def poisson(hashed, mean):  # type: ignore[no-untyped-def]
    """A Poisson count; above `_MEAN_AT_ONCE` the sum of several, each hashed by its number."""
    if mean <= _MEAN_AT_ONCE:
        return _poisson(hashed, mean)
    parts, count = int(np.ceil(mean / _MEAN_AT_ONCE)), 0
    for part in range(parts):
        count += _poisson(mix(hashed, part), mean / parts)
    return count


@kernel
def _poisson(hashed, mean):  # type: ignore[no-untyped-def]
    """A Poisson count by inversion of one uniform; `mean` up to 600, where exp underflows."""
    u = uniform(hashed)
    probability = np.exp(-mean)
    cumulative = probability
    count = 0
    while u > cumulative and count < 4096:
        count += 1
        probability *= mean / count
        cumulative += probability
    return count
