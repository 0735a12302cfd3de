"""How colours differ from rock to rock: some darker or fresher, some under more dust."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, linear_from_srgb
from terrain_forge.dtm import patch_pixels
from terrain_forge.model import Appearance, RockField, Site, World

_TINTS = np.array(
    [(0.78, 0.06), (0.92, 0.28), (1.06, 0.12), (1.0, 0.45), (1.16, 0.2), (0.86, 0.36)]
)
"""Brightness of a rock over its population's, and how much of the soil's colour lies on all of it.
Both are assumptions: what a few pictures of Mars and the Moon show."""
TINTS = len(_TINTS)
"""How many colours a population's rocks have."""


TOP_DUST, TOP_DUST_AIRLESS = 0.55, 0.25
"""How much of the soil's colour lies on what looks up, with air and without: assumptions."""
DUST_FROM, DUST_OVER = 0.35, 0.5
"""Rise of a face's normal from which dust lies on it, and what more it takes for all of it."""
DUST_VALUE = 1.0
"""What a place's brightness over the texture's mean, less 1, adds to that rise."""
_SAMPLES = 65
"""Places each way at which the mean of an orthoimage is taken."""
SOILED = 0.4
"""How much of the texture's contrast shows on what dust lies on."""


def rock_tints(ids: NDArray[np.int32], seed: int) -> NDArray[np.int64]:
    """Which of its population's colours each of some rocks has; it is the same in any window."""
    return (_spread(ids, seed) * TINTS).astype(np.int64)


def tint_colours(world: World) -> Array:
    """Linear colours of the populations' rocks, shape [populations, TINTS, 3]."""
    bare = linear_from_srgb(world.appearance.rock_rgb / 255.0)[:, None, :]
    return tints_of(bare, soil_colour(world))


def tints_of(bare: Array, soil: Array) -> Array:
    """The colours that rocks of a linear colour have on such soil, shape [..., TINTS, 3].

    `bare` has the shape [..., 1, 3].
    """
    tone, dust = _TINTS[:, :1], _TINTS[:, 1:]
    colours = tone * bare
    return np.asarray(np.minimum(colours + dust * (soil - colours), 1.0))


def dusty_tints(world: World, population: int, up: Array) -> Array:
    """What dust makes of the colours of a population's rocks, shape [TINTS, faces, 3].

    `up` is how far the faces' normals rise, -1 to 1, shape [faces].
    """
    bare, share = tint_colours(world)[population][:, None, :], dust_share(world, up)[:, None]
    return np.asarray(bare + share * (soil_colour(world) - bare))


def dust_share(world: World, up: Array) -> Array:
    """How much of the soil's colour lies on what rises so far, 0 to 1."""
    return dust_on(up, airless=world.site.body.airless)


def dust_on(up: Array, *, airless: bool) -> Array:
    """As `dust_share`, on a body without air or with some, however clear it is today."""
    return np.asarray(top_dust(airless) * np.clip((up - DUST_FROM) / DUST_OVER, 0.0, 1.0))


def top_dust(airless: bool) -> float:
    """How much of the soil's colour lies on what looks up."""
    return TOP_DUST_AIRLESS if airless else TOP_DUST


def soil_colour(world: World) -> Array:
    """Linear colour of the regolith, shape [3]; of all of a site, so the same in its tiles."""
    return soil_of(world.site, world.appearance)


def soil_of(site: Site, looks: Appearance) -> Array:
    """As `soil_colour`: what an orthoimage shows on average, where it has colours."""
    picture = site.orthoimage
    if picture is not None and picture.albedo.shape[2] == 3:
        steps = np.linspace(-0.5, 0.5, _SAMPLES)
        places = np.meshgrid(steps * site.size[0], steps * site.size[1])
        column, row = (
            np.clip(np.rint(index), 0, length - 1).astype(np.int64)
            for index, length in zip(
                patch_pixels(picture, site.crs, *places), picture.albedo.shape[1::-1], strict=True
            )
        )
        return np.asarray(picture.albedo[row, column].mean(axis=(0, 1), dtype=np.float64))
    return linear_from_srgb(looks.materials[0].rgb if looks.materials else site.body.ground_rgb)


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
