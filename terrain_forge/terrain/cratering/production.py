"""Production functions: how many craters of which size a surface gathers."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval, MaxLen

from terrain_forge.base import Array, Positive, PowerPieces, Spec, portable
from terrain_forge.model import BODIES, Body, Chronology, ProductionFunction

OLDEST = 4.4
"""Largest model age [10⁹ years]; the oldest surfaces that calibrate the lunar chronology are a
little younger."""
Age = Annotated[float, Interval(gt=0, le=OLDEST)]
if TYPE_CHECKING:
    BodyFunction = str
else:
    _FUNCTIONS = [one.kind for body in BODIES.values() for one in body.craters.productions]
    BodyFunction = Literal[tuple(dict.fromkeys(_FUNCTIONS))]


@dataclass(frozen=True, kw_only=True)
class Polynomial:
    """log₁₀ N = Σ aₙ (log₁₀ D)ⁿ, N on a km², D in km; a power law beyond the ends of its range."""

    coefficients: tuple[float, ...]
    """a₀, a₁, …"""
    range_km: tuple[float, float]
    """Diameters [km] that it was fitted to."""
    factor: float = 1.0
    """Factor on N."""

    def number(self, diameter: Array) -> Array:
        """N(≥D) [1/m²]."""
        logarithm, inside = self._arguments(diameter)
        value = np.polynomial.polynomial.polyval(inside, self.coefficients)
        value -= self.slope(diameter) * (logarithm - inside)
        return np.asarray(self.factor * 1e-6 * portable.power(10.0, value))

    def slope(self, diameter: Array) -> Array:
        """-d ln N / d ln D."""
        _, inside = self._arguments(diameter)
        derivative = np.polynomial.polynomial.polyder(self.coefficients)
        return np.asarray(-np.polynomial.polynomial.polyval(inside, derivative))

    def _arguments(self, diameter: Array) -> tuple[Array, Array]:
        logarithm = portable.log10(np.asarray(diameter, np.float64)) - 3.0
        return logarithm, np.clip(logarithm, *portable.log10(self.range_km))


@dataclass(frozen=True, kw_only=True)
class Resurfacing(Spec):
    """An event that erased the small craters of a surface."""

    age_ga: Age
    """When it was [10⁹ years ago]."""
    below_m: Positive
    """Craters of less than this diameter were erased [m]; larger ones were left."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Resurfaced:
    """What a surface has gathered of which events erased the small craters."""

    yearly: PowerPieces | Polynomial
    """Craters that come in 10⁹ years."""
    grown: Array
    """Factors on it: of the whole age, and of the time since each event, falling."""
    below: Array
    """Diameter [m] below which each event erased, falling."""

    def number(self, diameter: Array) -> Array:
        """N(≥D) [1/m²]."""
        number = self.yearly.number(diameter)
        erased = np.subtract.outer(number, self.yearly.number(self.below))
        lost = portable.product(np.maximum(erased, 0.0), self.grown[:-1] - self.grown[1:])
        return np.asarray(self.grown[0] * number - lost)

    def slope(self, diameter: Array) -> Array:
        """-d ln N / d ln D."""
        events = np.count_nonzero(np.less.outer(diameter, self.below), axis=-1)
        falling = self.yearly.number(diameter) * self.yearly.slope(diameter)
        return np.asarray(self.grown[events] * falling / self.number(diameter))


Counted = PowerPieces | Polynomial | Resurfaced
"""Numbers of craters by size."""


def gathered(function: ProductionFunction, age: float) -> PowerPieces | Polynomial:
    """Craters that a body's surface of an age [10⁹ years] has gathered by a production function."""
    growth = function.chronology.growth(age)
    if not function.bins:
        return Polynomial(
            coefficients=function.coefficients, range_km=function.range_km, factor=growth
        )
    bins = 1e-6 * growth * np.array(function.bins)
    steps = 0.5 * np.arange(len(bins), dtype=np.float64)
    edges = 1000.0 * portable.power(2.0, steps + function.first_bin)
    return PowerPieces.through(edges, np.cumsum(bins[::-1])[::-1])


@dataclass(frozen=True, kw_only=True)
class CraterProduction(Spec):
    """How many craters a surface has gathered, or shows.

    But for the functions of the bodies, a law is a subclass with a field `kind` (a Literal with its
    default); it must have `law`. It is found if its module lies in
    `terrain_forge.terrain.cratering.productions` or is named by an entry point of the group
    `terrain_forge.crater_productions`.
    """

    if TYPE_CHECKING:
        kind: str
        """Name of the law, as a recipe writes it."""

    age_ga: Age
    """Age of the surface [10⁹ years]; it tells how worn the craters are."""

    counted: ClassVar[bool] = True
    """Whether it says what can be seen; craters are then as old as they can be seen, at most."""

    complete: ClassVar[bool] = False
    """Whether it says so of all sizes, so that no equilibrium limits it but the recipe's own."""

    def oldest(self, diameter: Array) -> Array:
        """Age [10⁹ years] of the surface for craters of diameters [m]."""
        return np.full(np.shape(diameter), self.age_ga)

    def holds_on(self, body: Body) -> bool:  # noqa: ARG002
        """Whether it can be used on a body."""
        return True

    def chronology(self, body: Body) -> Chronology:
        """How the number of craters has grown with time."""
        return body.craters.chronology

    @abstractmethod
    def law(self, body: Body) -> Counted:
        """The number of craters after the whole age."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class BodyProduction(CraterProduction):
    """A production function that was made for the site's body (docs/craters.md).

    The Moon and Mercury have `neukum`, Mars `ivanov` and `hartmann_daubar`.
    A power law continues it to craters smaller than it was fitted to, whose numbers equilibrium
    limits on all but the youngest surfaces.
    """

    kind: BodyFunction
    """Its name."""
    age_ga: Age
    """Model age of the surface [10⁹ years], by the chronology that belongs to it."""
    resurfaced: Annotated[tuple[Resurfacing, ...], MaxLen(20)] = ()
    """Events that erased the small craters since then, the oldest first, each of smaller ones than
    the one before: counts of which the small craters give a younger age than the large ones."""

    counted: ClassVar[bool] = False

    def __post_init__(self) -> None:
        ages = (self.age_ga, *(event.age_ga for event in self.resurfaced))
        sizes = [event.below_m for event in self.resurfaced]
        if np.any(np.diff(ages) >= 0.0) or np.any(np.diff(sizes) >= 0.0):
            raise ValueError(
                "resurfaced: ages must fall from age_ga on, and below_m from event to event"
            )

    def oldest(self, diameter: Array) -> Array:
        """Time [10⁹ years] since the last event that erased craters of diameters [m]."""
        ages = np.array([self.age_ga, *(event.age_ga for event in self.resurfaced)])
        below = [event.below_m for event in self.resurfaced]
        return np.asarray(ages[np.count_nonzero(np.less.outer(diameter, below), axis=-1)])

    def holds_on(self, body: Body) -> bool:
        """Whether the function was made for a body."""
        return any(one.kind == self.kind for one in body.craters.productions)

    def chronology(self, body: Body) -> Chronology:
        """How the number of craters has grown with time."""
        return self._function(body).chronology

    def law(self, body: Body) -> Counted:
        """The production of the whole age."""
        function, events = self._function(body), self.resurfaced
        if not events:
            return gathered(function, self.age_ga)
        ages = (self.age_ga, *(event.age_ga for event in events))
        return Resurfaced(
            yearly=gathered(function, 1.0),
            grown=np.array([function.chronology.growth(age) for age in ages]),
            below=np.array([event.below_m for event in events]),
        )

    def _function(self, body: Body) -> ProductionFunction:
        return next(one for one in body.craters.productions if one.kind == self.kind)
