"""Whether rocks can be packed: the chance that the last of them still finds a free place.

Rocks are placed at random, the larger ones first, each with some thousand tries. So what counts is
the chance p that a rock overlaps none of those that lie already. Scaled-particle theory tells it
for convex bodies of any sizes (discs: Helfand, Frisch & Lebowitz 1961, J. Chem. Phys. 34, 1037;
other shapes: Boublík 1975, Mol. Phys. 29, 421): with the number Σ1, perimeter ΣP and area φ of all
others on a unit of ground, and a rock's own perimeter P and area A,

    -ln p = -ln(1 - φ) + P ΣP / (2π (1 - φ)) + A [Σ1 / (1 - φ) + (ΣP)² / (4π (1 - φ)²)].
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, pi

import numpy as np

from terrain_forge.base import Array
from terrain_forge.rocks.library import LibrarySpec
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.rocks.scattering.size_classes import DYNAMIC_SPACE, is_dynamic

LEAST_CHANCE = exp(-3.0)
"""Chance of a free place at which a rock in a thousand is unplaced at most.

Found by placing rocks of the default library at random. Of 0.9 to 1.0 m, 0.5 to 1 m, 0.2 to
0.25 m, 4 to 5 m, exponential cover with and without dynamic rocks, number ∝ D⁻³ and four
populations together, 0.015 % at most were unplaced at this chance, 0.07 % at exp(-3.2), 1 % at
exp(-4)."""
MAX_COVER = 0.4
"""Part of the ground that all rocks may cover, whatever their sizes: more was not tried."""

_FOOTPRINTS = {
    "block": (1.80, 1.37),
    "slab": (1.55, 1.30),
    "cobble": (1.53, 1.26),
    "vesicular": (1.82, 1.38),
    "ventifact": (2.21, 1.54),
    "breccia": (1.70, 1.33),
}
"""Mean area and perimeter of a family's footprints, which hold a rock's buried parts too, over
those of a disc of the exposed diameter; of 24 shapes each."""
_OWN_FOOTPRINT = 1.80, 1.37
"""The same for the user's own shapes, which are not known yet: as of blocks."""
_REACH = 0.85
"""Radius of the circle that keeps rocks off the site's border, over the exposed diameter."""
_STEPS = 64
_HALVINGS = 40


def packable(
    populations: Sequence[PopulationSpec],
    *,
    size: tuple[float, float],
    library: LibrarySpec,
    crowding: Sequence[float],
) -> float:
    """The largest factor up to 1 that all densities may have, so that the rocks find their places.

    Args:
        populations: The rocks.
        size: The site, east and north [m].
        library: The shapes.
        crowding: How many times denser than its law each population lies.
    """
    steps = [
        _steps(population, size=size, library=library, crowding=factor)
        for population, factor in zip(populations, crowding, strict=True)
    ]
    rocks = np.concatenate([np.zeros((4, 0)), *steps], axis=1)
    rocks = rocks[:, np.argsort(-rocks[0], kind="stable")]
    low, high = 0.0, 1.0
    if _least_chance(rocks, high) >= LEAST_CHANCE:
        return high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        fits = _least_chance(rocks, middle) >= LEAST_CHANCE
        low, high = (middle, high) if fits else (low, middle)
    return low


def _steps(
    population: PopulationSpec,
    *,
    size: tuple[float, float],
    library: LibrarySpec,
    crowding: float,
) -> Array:
    """Diameter [m], number [1/m²], perimeter [m] and area [m²] of rocks, shape [4, steps]."""
    smallest, largest = population.diameters
    if largest <= smallest:
        return np.zeros((4, 0))
    ends, law = np.geomspace(smallest, largest, _STEPS + 1), population.size_frequency
    number, cover = (-np.diff(f(ends)) for f in (law.cumulative_number, law.cumulative_area))
    there = number > 0.0
    number, diameter = number[there], np.sqrt(cover[there] / number[there] / (0.25 * pi))
    room = np.where(is_dynamic(population, diameter), DYNAMIC_SPACE, 1.0) * diameter
    # Nearer than their circle to the site's border there is none: the others stand closer.
    within = (1.0 - _REACH * room / size[0]) * (1.0 - _REACH * room / size[1])
    area, perimeter = _footprint(population, library)
    return np.stack(
        [
            diameter,
            crowding * number / within,
            perimeter * pi * room,
            area * 0.25 * pi * room**2,
        ]
    )


def _footprint(population: PopulationSpec, library: LibrarySpec) -> tuple[float, float]:
    """Mean area and perimeter of a population's footprints over those of discs."""
    made = [library.families[n % len(library.families)] for n in range(library.shapes)]
    families = [*made, *(mesh.family_name for mesh in library.meshes)]
    chosen = [
        name for name in families if population.families is None or name in population.families
    ]
    area, perimeter = np.mean([_FOOTPRINTS.get(name, _OWN_FOOTPRINT) for name in chosen], axis=0)
    return float(area), float(perimeter)


def _least_chance(rocks: Array, factor: float) -> float:
    """Chance of a free place for the rocks that have it hardest, if all are `factor` as dense.

    Args:
        rocks: Diameter, number, perimeter and area, the largest rocks first, shape [4, steps].
        factor: What multiplies the numbers.
    """
    _, number, perimeter, area = rocks
    numbers = np.cumsum(factor * number)
    perimeters, areas = np.cumsum(factor * number * perimeter), np.cumsum(factor * number * area)
    if areas.max(initial=0.0) >= 1.0:
        return 0.0
    free = 1.0 - areas
    overlap = perimeter * perimeters / (2.0 * pi * free)
    overlap += area * (numbers / free + perimeters**2 / (4.0 * pi * free**2))
    return float((free * np.exp(-overlap)).min(initial=1.0))
