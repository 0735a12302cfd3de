"""The recipe's `worlds` part: what differs among the many worlds that one recipe makes."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal

from annotated_types import Interval, MinLen

from terrain_forge.base import Coordinate, Fraction, Positive, PositivePair, RecipeError, Spec

MOST_WORLDS = 100_000
"""Worlds that one recipe makes at once."""
Fractions = tuple[Fraction, Fraction]
_Cover = Annotated[float, Interval(ge=1e-6, le=0.4)]
_Age = Annotated[float, Interval(ge=0.001, le=4.5)]


@dataclass(frozen=True, kw_only=True)
class Variation(Spec):
    """What the values of a key are drawn from: exactly one of these."""

    uniform: tuple[Coordinate, Coordinate] | None = None
    """Evenly between two numbers."""
    log_uniform: PositivePair | None = None
    """Evenly between the logarithms of two numbers."""
    integers: tuple[int, int] | None = None
    """Whole numbers from the first to the second."""
    choice: Annotated[tuple[Any, ...], MinLen(1)] | None = None
    """One of these values, all as likely."""
    difficulty: tuple[Coordinate, Coordinate] | None = None
    """The first number in a world of difficulty 0, the second in one of 1, in between linearly."""
    log_difficulty: PositivePair | None = None
    """The same, evenly between the logarithms."""

    @property
    def given(self) -> tuple[str, Any]:
        """Which of them it is, and what it says.

        Raises:
            RecipeError: if there is none, or more than one.
        """
        names = [one.name for one in fields(self) if getattr(self, one.name) is not None]
        if len(names) != 1:
            allowed = ", ".join(one.name for one in fields(self))
            raise RecipeError(f"exactly one of {allowed}; found {' and '.join(names) or 'none'}")
        return names[0], getattr(self, names[0])


@dataclass(frozen=True, kw_only=True)
class DifficultySpec(Spec):
    """A difficulty of each world, 0 to 1, and what it changes: from a value at 0 to one at 1.

    Only what the recipe has is changed; null leaves it as the recipe has it. What was measured in
    each world stands beside the difficulty that was wished.
    """

    level: Fraction | Fractions = (0.0, 1.0)
    """The difficulty, or the two between which it is drawn evenly."""
    rock_cover: tuple[_Cover, _Cover] | None = (0.005, 0.2)
    """Part of the ground that the rocks of a population cover, evenly in its logarithm: k of
    Golombek's law; of other laws the numbers are scaled so that the population covers as much."""
    place: Fractions | None = (0.0, 1.0)
    """Where on the DTM the world lies: its rank among 64 random places by the RMS slope of the DTM
    over the world's size, 0 for the gentlest. Only where `vary` does not tell the centre."""
    roughness: PositivePair | None = (0.5, 2.0)
    """Factor on the heights of fractal layers, evenly in its logarithm."""
    crater_age_ga: tuple[_Age, _Age] | None = (0.5, 3.8)
    """Age of the cratered surface [10⁹ years]: the older, the more craters. Ages of resurfacings
    keep their ratio to it."""
    ripple_ratio: PositivePair | None = (0.01, 0.09)
    """Height of ripples over their wavelength."""


@dataclass(frozen=True, kw_only=True)
class ArrivalSpec(Spec):
    """How a world's difficulty is measured: which part of random starts the rover arrives from."""

    starts: Annotated[int, Interval(ge=1, le=100_000)] = 500
    """Random starts, each with a goal that is drawn where the rover can stand."""
    distance_m: Positive | None = None
    """How far the goal is from the start [m], at most half of a world's diagonal; without it half
    of the world's shorter side."""


@dataclass(frozen=True, kw_only=True)
class WorldsSpec(Spec):
    """What `terrain-forge worlds` makes: many worlds that differ in seed, place and figures."""

    count: Annotated[int, Interval(ge=1, le=MOST_WORLDS)] = 100
    """How many; more of them change none of the first ones."""
    vary: dict[Annotated[str, MinLen(1)], Variation | Literal["anywhere"]] = field(
        default_factory=dict
    )
    """What differs, by the key that it has in the recipe, such as
    `rocks.populations.0.size_frequency.k: {uniform: [0.02, 0.1]}`; elements of lists are told by
    their number or their name. `dtm.centre: anywhere` is any place of the DTM. Each world has a
    seed of its own in any case."""
    difficulty: DifficultySpec | None = None
    """A difficulty of each world and what it changes; `{}` for the usual; none if left out."""
    arrival: ArrivalSpec = ArrivalSpec()
    """How the difficulty of each world is measured."""
