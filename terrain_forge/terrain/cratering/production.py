"""Production functions: how many craters of which size a surface gathers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Protocol

import numpy as np
from annotated_types import Interval, MinLen
from numpy.typing import NDArray

from terrain_forge.base import BY_KIND, Array, InputFile, Positive, Spec
from terrain_forge.terrain.cratering.chronology import MARS, MARS_HARTMANN, MOON, OLDEST, Chronology

if TYPE_CHECKING:
    from terrain_forge.model import Table

_COLUMNS = ("diameter_m", "number_per_km2")

Age = Annotated[float, Interval(gt=0, le=OLDEST)]


class SizeLaw(Protocol):
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
class Pieces:
    """A cumulative law known at some diameters, a power law between them and beyond."""

    diameters: Array
    """Rising diameters [m]."""
    numbers: Array
    """N(≥D) [1/m²], falling."""

    def number(self, diameter: Array) -> Array:
        """N(≥D) [1/m²]."""
        row, slope = self._piece(diameter)
        found: Array = self.numbers[row] * (diameter / self.diameters[row]) ** -slope
        return found

    def slope(self, diameter: Array) -> Array:
        """-d ln N / d ln D of the piece."""
        return self._piece(diameter)[1]

    def _piece(self, diameter: Array) -> tuple[NDArray[np.intp], Array]:
        row = np.searchsorted(self.diameters, diameter, side="right") - 1
        row = np.clip(row, 0, len(self.diameters) - 2)
        slopes = -np.diff(np.log(self.numbers)) / np.diff(np.log(self.diameters))
        return row, slopes[row]


@dataclass(frozen=True, kw_only=True)
class Neukum(Spec):
    """The Moon's production function (Neukum et al. 2001, doi:10.1023/A:1011989004263).

    Fitted from 10 m up; a power law continues it to smaller craters, whose numbers equilibrium
    limits on all but the youngest surfaces.
    """

    kind: Literal["neukum"] = "neukum"
    age_ga: Age
    """Model age of the surface [10⁹ years]."""

    counted: ClassVar[bool] = False
    body: ClassVar[str | None] = "moon"
    chronology: ClassVar[Chronology] = MOON
    # a₀ as Craterstats has it; -3.0876 as printed does not fit the function's own N(1 km).
    _COEFFICIENTS: ClassVar[tuple[float, ...]] = (
        *(-3.0768, -3.557528, 0.781027, 1.021521, -0.156012, -0.444058),
        *(0.019977, 0.086850, -0.005874, -0.006809, 8.25e-4, 5.54e-5),
    )

    def law(self) -> SizeLaw:
        """The production of the whole age."""
        return Polynomial(
            coefficients=self._COEFFICIENTS,
            range_km=(0.01, 100.0),
            factor=self.chronology.growth(self.age_ga),
        )


@dataclass(frozen=True, kw_only=True)
class Ivanov(Spec):
    """A production function of Mars (Ivanov 2001, doi:10.1023/A:1011941121102).

    Fitted from 15 m up; a power law continues it to smaller craters.
    """

    kind: Literal["ivanov"] = "ivanov"
    age_ga: Age
    """Model age of the surface [10⁹ years], by the chronology of Hartmann & Neukum 2001."""

    counted: ClassVar[bool] = False
    body: ClassVar[str | None] = "mars"
    chronology: ClassVar[Chronology] = MARS
    _COEFFICIENTS: ClassVar[tuple[float, ...]] = (
        *(-3.383677, -3.197453, 1.256814, 0.7915374, -0.4860814, -0.3630098),
        *(0.1015683, 0.06755923, -0.01180639, -0.004753462, 6.232845e-4, 5.805492e-5),
    )

    def law(self) -> SizeLaw:
        """The production of the whole age."""
        return Polynomial(
            coefficients=self._COEFFICIENTS,
            range_km=(0.015, 362.0),
            factor=self.chronology.growth(self.age_ga),
        )


@dataclass(frozen=True, kw_only=True)
class HartmannDaubar(Spec):
    """A production function of Mars from 1 m up.

    Hartmann & Daubar 2016, Meteoritics & Planetary Science. Its craters are new impacts of 1 to 30
    m too, and secondaries.
    """

    kind: Literal["hartmann_daubar"] = "hartmann_daubar"
    age_ga: Age
    """Model age of the surface [10⁹ years], by the chronology of Hartmann 2005."""

    counted: ClassVar[bool] = False
    body: ClassVar[str | None] = "mars"
    chronology: ClassVar[Chronology] = MARS_HARTMANN
    # Craters on a km² after 10⁹ years in bins of a factor √2, the first from 2⁻¹⁰ km.
    _BINS: ClassVar[tuple[float, ...]] = (
        *(1.10e5, 7.50e4, 4.50e4, 2.40e4, 1.10e4, 4.20e3, 1.60e3, 6.00e2, 1.90e2, 6.70e1),
        *(2.40e1, 9.44, 3.30, 1.22, 4.37e-1, 1.47e-1, 4.70e-2, 1.38e-2, 4.02e-3, 1.15e-3),
        *(3.08e-4, 1.28e-4, 6.85e-5, 3.67e-5, 1.98e-5, 1.06e-5, 5.68e-6, 3.04e-6, 1.62e-6),
        *(8.71e-7, 4.67e-7, 2.40e-7, 1.12e-7, 5.21e-8, 2.43e-8, 1.13e-8, 5.28e-9, 2.47e-9),
        *(1.15e-9, 5.37e-10),
    )

    def law(self) -> SizeLaw:
        """The production of the whole age."""
        bins = 1e-6 * self.chronology.growth(self.age_ga) * np.array(self._BINS)
        edges = 1000.0 * 2.0 ** (0.5 * np.arange(len(bins), dtype=np.float64) - 10.0)
        return Pieces(diameters=edges, numbers=np.cumsum(bins[::-1])[::-1])


@dataclass(frozen=True, kw_only=True)
class CraterPowerLaw(Spec):
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

    counted: ClassVar[bool] = True
    body: ClassVar[str | None] = None
    chronology: ClassVar[Chronology] = MOON

    def law(self) -> SizeLaw:
        """The law itself."""
        ends = np.array([1.0, 2.0])
        return Pieces(diameters=ends, numbers=self.number_per_m2 * ends**-self.exponent)


@dataclass(frozen=True, kw_only=True)
class CraterTable(Spec):
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

    counted: ClassVar[bool] = True
    body: ClassVar[str | None] = None
    chronology: ClassVar[Chronology] = MOON

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

    def law(self) -> SizeLaw:
        """The law itself."""
        return Pieces(
            diameters=np.array(self.diameters_m), numbers=1e-6 * np.array(self.numbers_per_km2)
        )


Production = Annotated[Neukum | Ivanov | HartmannDaubar | CraterPowerLaw | CraterTable, BY_KIND]
"""The laws that a recipe can name by their `kind`."""
