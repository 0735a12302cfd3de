"""How colours differ from rock to rock: some darker or fresher, some under more dust."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, linear_from_srgb
from terrain_forge.model import RockField, World

_TINTS = np.array(
    [(0.78, 0.06), (0.92, 0.28), (1.06, 0.12), (1.0, 0.45), (1.16, 0.2), (0.86, 0.36)]
)
"""Brightness of a rock over its population's, and how much of the soil's colour lies on all of it.
Both are assumptions: what a few pictures of Mars and the Moon show."""
TINTS = len(_TINTS)
"""How many colours a population's rocks have."""


def rock_tints(ids: NDArray[np.int32], seed: int) -> NDArray[np.int64]:
    """Which of its population's colours each of some rocks has; it is the same in any window."""
    return (_spread(ids, seed) * TINTS).astype(np.int64)


def tint_colours(world: World) -> Array:
    """Linear colours of the populations' rocks, shape [populations, TINTS, 3]."""
    looks = world.appearance
    bare = linear_from_srgb(looks.rock_rgb / 255.0)[:, None, :]
    known = looks.materials[0].rgb if looks.materials else world.site.body.ground_rgb
    tone, dust = _TINTS[:, :1], _TINTS[:, 1:]
    colours = tone * bare
    return np.asarray(np.minimum(colours + dust * (linear_from_srgb(known) - colours), 1.0))


def rock_colours(world: World, rocks: RockField) -> Array:
    """Linear colours of some rocks, shape [rocks, 3]."""
    tints = rock_tints(rocks.id, world.site.seed)
    return np.asarray(tint_colours(world)[rocks.population, tints])


def tones(ids: NDArray[np.int32], seed: int) -> Array:
    """How much lighter or darker than the next each of some things is, 0.75 to 1.25."""
    return 0.75 + 0.5 * _spread(ids, seed)


def _spread(ids: NDArray[np.int32], seed: int) -> Array:
    """A number of each thing, evenly from 0 to 1."""
    tone = np.random.SeedSequence(seed).generate_state(1)[0]
    spread = ((ids.astype(np.uint64) + tone) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    return np.asarray(spread, np.float64) / 2.0**24
