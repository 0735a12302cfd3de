"""Production functions: how many craters of which size a surface gathers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Array, PowerPieces, Spec, portable
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


Counted = PowerPieces | Polynomial
"""Numbers of craters by size."""


@dataclass(frozen=True, kw_only=True)
class CraterProduction(Spec):
    """How many craters a surface has gathered, or shows.

    But for the functions of the bodies, a law is a subclass with a field `kind` (a Literal with its
    default). It is found if its module lies in `terrain_forge.terrain.cratering.productions` or is
    named by an entry point of the group `terrain_forge.crater_productions`.
    """

    if TYPE_CHECKING:
        kind: str
        """Name of the law, as a recipe writes it."""

    age_ga: Age
    """Age of the surface [10⁹ years]; it tells how worn the craters are."""

    counted: ClassVar[bool] = True
    """Whether it says what can be seen; craters are then as old as they can be seen, at most."""

    def holds_on(self, body: Body) -> bool:  # noqa: ARG002
        """Whether it can be used on a body."""
        return True

    def chronology(self, body: Body) -> Chronology:
        """How the number of craters has grown with time."""
        return body.craters.chronology

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

    counted: ClassVar[bool] = False

    def holds_on(self, body: Body) -> bool:
        """Whether the function was made for a body."""
        return any(one.kind == self.kind for one in body.craters.productions)

    def chronology(self, body: Body) -> Chronology:
        """How the number of craters has grown with time."""
        return self._function(body).chronology

    def law(self, body: Body) -> Counted:
        """The production of the whole age."""
        function = self._function(body)
        growth = function.chronology.growth(self.age_ga)
        if not function.bins:
            return Polynomial(
                coefficients=function.coefficients, range_km=function.range_km, factor=growth
            )
        bins = 1e-6 * growth * np.array(function.bins)
        steps = 0.5 * np.arange(len(bins), dtype=np.float64)
        edges = 1000.0 * portable.power(2.0, steps + function.first_bin)
        return PowerPieces.through(edges, np.cumsum(bins[::-1])[::-1])

    def _function(self, body: Body) -> ProductionFunction:
        return next(one for one in body.craters.productions if one.kind == self.kind)
