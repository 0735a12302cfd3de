"""Dynamic rocks: how many and how large they may be, and how they touch the ground.

A rock that was settled with one set of contact parameters rolls away under another, so settling,
exporters and checks all take them from here.
"""

from __future__ import annotations

from dataclasses import dataclass

from terrain_forge.base import RecipeError, Record
from terrain_forge.rocks.populations import PopulationSpec

Populations = tuple[PopulationSpec, ...]

SLIDING = 0.7
"""Coefficient of sliding friction with which rocks are settled."""
ROLLING = 0.05
"""Torsional and rolling friction of a dynamic rock, as a part of its diameter."""
MOST_DYNAMIC = 5000
"""Dynamic rocks of a site; each takes about 50 ms of a processor's core."""
LARGEST_DYNAMIC = 8.0
"""Largest diameter of a dynamic rock, in spacings of the ground: MuJoCo takes 50 contacts between a
rock and the ground, and a wider rock can have more, of which it then loses some."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DynamicContact(Record):
    """Contact parameters of a dynamic rock, in MuJoCo's terms."""

    condim: int
    """Dimensions of a contact: 6 for sliding, torsional and rolling friction."""
    sliding: float
    """Coefficient of sliding friction."""
    torsional: float
    """Torsional friction [m]."""
    rolling: float
    """Rolling friction [m]: what keeps a rock on edges that a real one would crush."""
    solref: tuple[float, float]
    """Time constant [s] and damping ratio of the contact."""
    impratio: float
    """Friction's stiffness over that of the normal force; an option of the whole model."""

    @property
    def friction(self) -> tuple[float, float, float]:
        """Sliding, torsional and rolling friction, as MuJoCo lists them."""
        return self.sliding, self.torsional, self.rolling


def dynamic_contact(diameter: float, *, sliding: float = SLIDING) -> DynamicContact:
    """Contact parameters of a dynamic rock of an exposed diameter [m]."""
    return DynamicContact(
        condim=6,
        sliding=sliding,
        torsional=ROLLING * diameter,
        rolling=ROLLING * diameter,
        solref=(0.02, 1.0),
        impratio=10.0,
    )


def require_dynamic(populations: Populations, *, size: tuple[float, float], spacing: float) -> None:
    """Refuse dynamic rocks that are too large for the ground's lattice, or too many.

    Raises:
        RecipeError: with what was found and what is allowed.
    """
    for number, population in enumerate(populations):
        key = ("rocks", "populations", number, "dynamic_m")
        _, high = population.dynamic_diameters or (0.0, 0.0)
        if high > LARGEST_DYNAMIC * spacing:
            raise RecipeError(
                f"dynamic rocks of up to {high:.3g} m, at most {LARGEST_DYNAMIC:g} times the "
                f"ground's spacing, {LARGEST_DYNAMIC * spacing:.3g} m: larger ones lose contacts "
                "in MuJoCo",
                key=key,
            )
        count = expected_dynamic(populations[: number + 1], size=size)
        if count > MOST_DYNAMIC:
            raise RecipeError(
                f"about {count:.3g} dynamic rocks, at most {MOST_DYNAMIC}: settling one takes "
                "about 50 ms; raise the smallest diameter",
                key=key,
            )


def expected_dynamic(populations: Populations, *, size: tuple[float, float]) -> float:
    """Expected number of dynamic rocks of populations whose laws are resolved, on an area [m]."""
    ranges = ((population, population.dynamic_diameters) for population in populations)
    return sum(size[0] * size[1] * one.density(*sizes) for one, sizes in ranges if sizes)
