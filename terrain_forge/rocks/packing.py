"""Whether rocks of some laws can be packed on the ground.

That is the chance that the last of them still finds a free place. They are
placed at random, the larger ones first, each with some thousand tries. So what counts is
the chance p that a rock overlaps none of those that lie already. Scaled-particle theory tells it
for convex bodies of any sizes (discs: Helfand, Frisch & Lebowitz 1961, J. Chem. Phys. 34, 1037;
other shapes: Boublík 1975, Mol. Phys. 29, 421): with the number Σ1, perimeter ΣP and area φ of all
others on a unit of ground, and a rock's own perimeter P and area A,

    -ln p = -ln(1 - φ) + P ΣP / (2π (1 - φ)) + A [Σ1 / (1 - φ) + (ΣP)² / (4π (1 - φ)²)].
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, pi

import numpy as np

from terrain_forge.base import Array, RecipeError, portable
from terrain_forge.model import RockLibrary
from terrain_forge.rocks.embedding.footprint import footprint
from terrain_forge.rocks.feasibility import ADVICE, Populations, Size, crowded_places
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.rocks.scattering.size_classes import DYNAMIC_SPACE, is_dynamic, shapes_of

LEAST_CHANCE = exp(-3.0)
"""Chance of a free place at which a rock in a thousand is unplaced at most.

Found by placing rocks of the default library at random. Of 0.9 to 1.0 m, 0.5 to 1 m, 0.2 to
0.25 m, 4 to 5 m, exponential cover with and without dynamic rocks, number ∝ D⁻³ and four
populations together, 0.015 % at most were unplaced at this chance, 0.07 % at exp(-3.2), 1 % at
exp(-4)."""

_ALWAYS_FITS = 0.05
_STEPS = 64


def check_packing(populations: Populations, size: Size, library: Callable[[], RockLibrary]) -> None:
    """Refuse rocks that would not all find a free place, by the footprints of their shapes.

    Args:
        populations: The rocks.
        size: The site, east and north [m].
        library: Gives the shapes; called only where the cover makes them matter.

    Raises:
        RecipeError: with the cover, on the whole or where rocks are crowded.
    """
    crowds = [crowd for crowd in crowded_places(populations) if crowd[0] > _ALWAYS_FITS]
    if not crowds:
        return
    rocks = library()
    shapes = _footprints(rocks)
    steps = [
        _steps(population, size, shapes[:, shapes_of(population.families, rocks, ())])
        for population in populations
    ]
    for cover, factors, where, key in crowds:
        if _least_chance(steps, factors) < LEAST_CHANCE:
            raise RecipeError(
                f"the rocks would cover {cover:.3g} of the ground{where}, more than such shapes "
                f"and sizes can be packed without overlap: {ADVICE}",
                key=key,
            )


def _footprints(library: RockLibrary) -> Array:
    """Area, perimeter and reach of shapes of an exposed diameter of 1 m, shape [3, shapes]."""
    support = np.array([footprint(prototype.meshes[0]) for prototype in library.prototypes])
    angle = 2.0 * pi / support.shape[1]
    sides = np.roll(support, 1, axis=1) + np.roll(support, -1, axis=1)
    sides = (sides - 2.0 * np.cos(angle) * support) / np.sin(angle)
    reach = [prototype.reach for prototype in library.prototypes]
    return np.stack([0.5 * (support * sides).sum(axis=1), sides.sum(axis=1), reach])


def _steps(population: PopulationSpec, size: Size, shapes: Array) -> Array:
    """Diameter [m], number [1/m²], perimeter [m] and area [m²] of rocks, shape [4, steps]."""
    smallest, largest = population.diameters
    if largest <= smallest:
        return np.zeros((4, 0))
    ends, law = portable.geomspace(smallest, largest, _STEPS + 1), population.size_frequency
    number, cover = (-np.diff(f(ends)) for f in (law.cumulative_number, law.cumulative_area))
    there = number > 0.0
    number, diameter = number[there], np.sqrt(cover[there] / number[there] / (0.25 * pi))
    space = np.where(is_dynamic(population, diameter), DYNAMIC_SPACE, 1.0) * diameter
    area, perimeter, reach = shapes.mean(axis=1)
    # Nearer than their reach to the site's border there is none: the others stand closer.
    within = (1.0 - reach * space / size[0]) * (1.0 - reach * space / size[1])
    return np.stack([diameter, number / within, perimeter * space, area * space**2])


def _least_chance(steps: list[Array], factors: Array) -> float:
    """Chance of a free place for the rocks that have it hardest, the largest being placed first."""
    crowded = [
        part * [[1.0], [factor], [1.0], [1.0]] for part, factor in zip(steps, factors, strict=True)
    ]
    rocks = np.concatenate(crowded, axis=1)
    _, number, perimeter, area = rocks[:, np.argsort(-rocks[0], kind="stable")]
    numbers = np.cumsum(number)
    perimeters, areas = np.cumsum(number * perimeter), np.cumsum(number * area)
    if areas.max(initial=0.0) >= 1.0:
        return 0.0
    free = 1.0 - areas
    overlap = perimeter * perimeters / (2.0 * pi * free)
    overlap += area * (numbers / free + perimeters**2 / (4.0 * pi * free**2))
    return float((free * portable.exp(-overlap)).min(initial=1.0))
