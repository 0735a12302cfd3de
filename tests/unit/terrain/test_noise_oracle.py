"""Our gradient noise against the `noise` package, through one reference that can be either."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.base import mix, stage_key, zigzag
from terrain_forge.terrain import noise as ours


def reference(x, y, gradient):
    """Perlin's improved noise in two dimensions; `gradient(i, j)` gives a corner's (gx, gy)."""
    i, j = int(np.floor(x)), int(np.floor(y))
    u, v = x - i, y - j
    fade_u, fade_v = (t**3 * (t * (t * 6 - 15) + 10) for t in (u, v))

    def corner(a, b):
        gx, gy = gradient(i + a, j + b)
        return gx * (u - a) + gy * (v - b)

    south = corner(0, 0) + fade_u * (corner(1, 0) - corner(0, 0))
    north = corner(0, 1) + fade_u * (corner(1, 1) - corner(0, 1))
    return south + fade_v * (north - south)


POINTS = np.random.default_rng(4).uniform(0.0, 200.0, (400, 2))


def test_reference_with_our_gradients_is_our_noise():
    key = int(stage_key(3, "oracle"))

    def gradient(i, j):
        mixed = mix(np.uint64(mix(np.uint64(key), np.uint64(zigzag(i)))), np.uint64(zigzag(j)))
        return ours.GRADIENTS[mixed >> 56]

    for x, y in POINTS - 100.0:
        expected = reference(x, y, gradient)
        assert ours.gradient_noise(np.uint64(key), x, y) == pytest.approx(expected, abs=1e-12)


def test_reference_with_perlins_gradients_is_pnoise2():
    perlin = pytest.importorskip("noise", reason="the package `noise` needs a compiler")
    from noise.perlin import BaseNoise

    table = np.array(BaseNoise.permutation[:256])
    table[np.flatnonzero(table == 9)[1]] = 19  # a slip of the package's Python table, not of its C
    edges = [(1, 1), (-1, 1), (1, -1), (-1, -1), (1, 0), (-1, 0), (1, 0), (-1, 0)]
    edges += [(0, 1), (0, -1), (0, 1), (0, -1), (1, 0), (-1, 0), (0, -1), (0, 1)]

    def gradient(i, j):
        inner = table[(table[i & 255] + (j & 255)) & 255]
        return edges[table[inner & 255] & 15]

    for x, y in POINTS:
        expected = perlin.pnoise2(x, y, repeatx=256, repeaty=256)
        assert reference(x, y, gradient) == pytest.approx(expected, abs=2e-4)
