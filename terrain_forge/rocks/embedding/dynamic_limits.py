"""How many dynamic rocks a recipe makes, and how large they are: what can be settled."""

from __future__ import annotations

from terrain_forge.base import RecipeError
from terrain_forge.rocks.populations import PopulationSpec

Populations = tuple[PopulationSpec, ...]

MOST_DYNAMIC = 5000
"""Dynamic rocks of a site; each takes about 50 ms of a processor's core."""
LARGEST_DYNAMIC = 8.0
"""Largest diameter of a dynamic rock, in spacings of the ground: MuJoCo takes 50 contacts between a
rock and the ground, and a wider rock can have more, of which it then loses some."""


def require_dynamic(populations: Populations, *, size: tuple[float, float], spacing: float) -> None:
    """Refuse dynamic rocks that are too large for the ground's lattice, or too many.

    Raises:
        RecipeError: with what was found and what is allowed.
    """
    area, count = size[0] * size[1], 0.0
    for number, low, high in _dynamic_sizes(populations):
        key = ("rocks", "populations", number, "dynamic_m")
        if high > LARGEST_DYNAMIC * spacing:
            raise RecipeError(
                f"dynamic rocks of up to {high:.3g} m, at most {LARGEST_DYNAMIC:g} times the "
                f"ground's "
                f"spacing, {LARGEST_DYNAMIC * spacing:.3g} m: larger ones lose contacts in MuJoCo",
                key=key,
            )
        count += _expected_number(populations[number], area, low, high)
        if count > MOST_DYNAMIC:
            raise RecipeError(
                f"about {count:.3g} dynamic rocks, at most {MOST_DYNAMIC}: settling one takes "
                f"about "
                "50 ms; raise the smallest diameter",
                key=key,
            )


def expected_dynamic(populations: Populations, *, size: tuple[float, float]) -> float:
    """Expected number of dynamic rocks of populations whose laws are resolved, on an area [m]."""
    area = size[0] * size[1]
    return sum(
        _expected_number(populations[number], area, low, high)
        for number, low, high in _dynamic_sizes(populations)
    )


def _dynamic_sizes(populations: Populations) -> list[tuple[int, float, float]]:
    """Numbers of the populations with dynamic rocks, and the smallest and largest of these [m]."""
    sizes = []
    for number, population in enumerate(populations):
        if population.dynamic_m is not None:
            smallest, largest = population.diameters
            low, high = (
                max(smallest, population.dynamic_m[0]),
                min(largest, population.dynamic_m[1]),
            )
            sizes.append((number, low, high))
    return sizes


def _expected_number(population: PopulationSpec, area: float, low: float, high: float) -> float:
    """Expected number of a population's rocks between two diameters [m] on an area [m²]."""
    law = population.size_frequency
    return area * float(law.cumulative_number(low) - law.cumulative_number(high))
