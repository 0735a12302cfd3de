"""Noise in 32 bits, which the compiler turns into vector instructions: hashes of cells, fades."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner

_1, _2, _6, _10, _15, _30 = (np.float32(n) for n in (1.0, 2.0, 6.0, 10.0, 15.0, 30.0))
_ONE = np.int32(1)
_I, _J = np.uint32(0x9E3779B1), np.uint32(0x85EBCA77)
_MIX_1 = np.uint32(0x7FEB352D)
_MIX_2 = np.uint32(0x846CA68B)
_15_BITS, _16_BITS, _LOW = np.uint32(15), np.uint32(16), np.uint32(0xFFFF)
_COMPONENT = np.float32(1.0 / 32768.0)


@inner
def mixed(h):  # type: ignore[no-untyped-def]
    """A well-mixed word (Wellons 2018, lowbias32)."""
    h = np.uint32(np.uint32(h ^ np.uint32(h >> _16_BITS)) * _MIX_1)
    h = np.uint32(np.uint32(h ^ np.uint32(h >> _15_BITS)) * _MIX_2)
    return np.uint32(h ^ np.uint32(h >> _16_BITS))


@inner
def cell32(key, i, j):  # type: ignore[no-untyped-def]
    """A word of a cell."""
    a, b = np.uint32(np.uint32(i) * _I), np.uint32(np.uint32(j) * _J)
    return mixed(np.uint32(np.uint32(a ^ b) ^ key))


@inner
def low_half(h):  # type: ignore[no-untyped-def]
    """Half of a word as a number from -1 to 1."""
    return np.float32(np.int32(np.uint32(h & _LOW))) * _COMPONENT - _1


@inner
def high_half(h):  # type: ignore[no-untyped-def]
    """The other half."""
    return np.float32(np.int32(np.uint32(h >> _16_BITS))) * _COMPONENT - _1


@inner
def floor32(x):  # type: ignore[no-untyped-def]
    """The whole number below."""
    i = np.int32(x)
    return np.int32(i - _ONE) if np.float32(i) > x else i


@inner
def fade32(t):  # type: ignore[no-untyped-def]
    """Perlin's quintic."""
    return t * t * t * (t * (t * _6 - _15) + _10)


@inner
def fading32(t):  # type: ignore[no-untyped-def]
    """Its derivative."""
    return _30 * t * t * (t * (t - _2) + _1)
