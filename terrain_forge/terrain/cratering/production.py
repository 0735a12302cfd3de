"""Production functions: how many craters of which size a surface gathers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Protocol

import numpy as np
from annotated_types import Interval, MinLen

from terrain_forge.base import BY_KIND, Array, InputFile, Positive, PowerPieces, RecipeError, Spec
from terrain_forge.model import BODIES, Body, Chronology, ProductionFunction
from terrain_forge.terrain.cratering.chronology import OLDEST

if TYPE_CHECKING:
    from terrain_forge.model import Table

_COLUMNS = ("diameter_m", "number_per_km2")

Age = Annotated[float, Interval(gt=0, le=OLDEST)]
if TYPE_CHECKING:
    BodyFunction = str
else:
    _FUNCTIONS = [one.kind for body in BODIES.values() for one in body.craters.productions]
    BodyFunction = Literal[tuple(dict.fromkeys(_FUNCTIONS))]


class Counted(Protocol):
    """Numbers of craters by size."""

    def number(self, diameter: Array) -> Array:
        """N(≥D) on a square metre [1/m²] for diameters [m]."""
        ...

    def slope(self, diameter: Array) -> Array:
        """-d ln N / d ln D at diameters [m]."""
        ...


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
        return np.asarray(self.factor * 1e-6 * 10.0**value)

    def slope(self, diameter: Array) -> Array:
        """-d ln N / d ln D."""
        _, inside = self._arguments(diameter)
        derivative = np.polynomial.polynomial.polyder(self.coefficients)
        return np.asarray(-np.polynomial.polynomial.polyval(inside, derivative))

    def _arguments(self, diameter: Array) -> tuple[Array, Array]:
        logarithm = np.log10(np.asarray(diameter, np.float64)) - 3.0
        return logarithm, np.clip(logarithm, *np.log10(self.range_km))


@dataclass(frozen=True, kw_only=True)
class Production(Spec):
    """How many craters a surface has gathered, or shows."""

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
class BodyProduction(Production):
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
        return body.craters.production(self.kind) is not None

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
        edges = 1000.0 * 2.0 ** (steps + function.first_bin)
        return PowerPieces.through(edges, np.cumsum(bins[::-1])[::-1])

    def _function(self, body: Body) -> ProductionFunction:
        found = body.craters.production(self.kind)
        if found is None:
            raise RecipeError(f"{self.kind} is no production function of {body.name}")
        return found


@dataclass(frozen=True, kw_only=True)
class CraterPowerLaw(Production):
    """N(≥D) = number · (D / 1 m)^-exponent: craters that can be seen on the surface.

    They are as old as they can be seen, at most.
    """

    kind: Literal["power_law"] = "power_law"
    number_per_m2: Positive
    """Craters of 1 m and more on a square metre [1/m²]."""
    exponent: Annotated[float, Interval(gt=0, le=8)]
    """How steeply the number falls."""
    age_ga: Age
    """Age of the surface [10⁹ years]; it tells how worn the craters are."""

    def law(self, body: Body) -> Counted:  # noqa: ARG002
        """The law itself."""
        one, number, exponent = (np.array([v]) for v in (1.0, self.number_per_m2, self.exponent))
        return PowerPieces(diameters=one, numbers=number, exponents=exponent)


@dataclass(frozen=True, kw_only=True)
class CraterTable(Production):
    """N(≥D) as tabulated, a power law from row to row and beyond: craters that can be seen.

    They are as old as they can be seen, at most.
    """

    kind: Literal["table"] = "table"
    file: (
        Annotated[
            str,
            MinLen(1),
            InputFile(kind="table", columns=_COLUMNS, positive=_COLUMNS, most=10_000),
        ]
        | None
    ) = None
    """CSV with the columns `diameter_m` and `number_per_km2`, instead of the two lists."""
    diameters_m: tuple[Positive, ...] = ()
    """Rising diameters [m]."""
    numbers_per_km2: tuple[Positive, ...] = ()
    """Craters of at least these diameters on a square kilometre [1/km²], falling."""
    age_ga: Age
    """Age of the surface [10⁹ years]; it tells how worn the craters are."""

    def __post_init__(self) -> None:
        diameters, numbers = self.diameters_m, self.numbers_per_km2
        if self.file is not None:
            if diameters or numbers:
                raise ValueError("a file, or diameters_m and numbers_per_km2, not both")
            return
        if len(diameters) != len(numbers):
            raise ValueError(f"{len(diameters)} diameters but {len(numbers)} numbers")
        if len(diameters) < 2:
            raise ValueError("a table needs a file, or two diameters and numbers at least")
        if np.any(np.diff(diameters) <= 0.0) or np.any(np.diff(numbers) >= 0.0):
            raise ValueError("diameters must rise from row to row, and numbers fall")

    def with_table(self, table: Table) -> CraterTable:
        """The law with the numbers of its file."""
        diameters, numbers = (tuple(table.column(name).tolist()) for name in _COLUMNS)
        return replace(self, file=None, diameters_m=diameters, numbers_per_km2=numbers)

    def law(self, body: Body) -> Counted:  # noqa: ARG002
        """The law itself."""
        return PowerPieces.through(self.diameters_m, 1e-6 * np.array(self.numbers_per_km2))


AnyProduction = Annotated[BodyProduction | CraterPowerLaw | CraterTable, BY_KIND]
"""The laws that a recipe can name by their `kind`."""
