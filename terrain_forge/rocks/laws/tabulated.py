"""A law that is given as a table of cumulative numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from annotated_types import MaxLen, MinLen
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import (
    Array,
    InputFile,
    Key,
    Positive,
    PowerPieces,
    RecipeError,
    kernel,
    mix,
    portable,
    uniform,
)
from terrain_forge.rocks.laws.law import SizeLaw, above_zero
from terrain_forge.rocks.laws.power_law import moment_above

if TYPE_CHECKING:
    from terrain_forge.model import Table

MAX_ROWS = 10_000
"""Rows of a table."""

_COLUMNS = ("diameter_m", "number_per_m2")


@dataclass(frozen=True, kw_only=True)
class Tabulated(SizeLaw):
    """A table of N(>D), used as it is: a power law from row to row, and on beyond the last one."""

    kind: Literal["table"] = "table"
    """Name of the law."""
    file: (
        Annotated[
            str,
            MinLen(1),
            InputFile(kind="table", columns=_COLUMNS, positive=_COLUMNS, most=MAX_ROWS),
        ]
        | None
    ) = None
    """CSV with the columns `diameter_m` and `number_per_m2`, instead of the two lists."""
    diameters_m: Annotated[tuple[Positive, ...], MinLen(2), MaxLen(MAX_ROWS)] | None = None
    """Diameters [m], rising."""
    numbers_per_m2: Annotated[tuple[Positive, ...], MinLen(2), MaxLen(MAX_ROWS)] | None = None
    """Rocks larger than each diameter on a square metre [1/m²], falling."""

    @property
    def smallest_known(self) -> float:
        """The table's first diameter [m]."""
        return float(self._pieces.diameters[0])

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) [1/m²], log-log linear between the rows."""
        return self._pieces.number(above_zero(diameter))

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D), exact for the pieces; up to a constant if the last one's exponent is ≤ 2."""
        return 0.25 * np.pi * self._moment_above(np.asarray(diameter, np.float64), 2)

    def cover_variance(self, smallest: float, largest: float, area: Positive) -> float:
        """(π/4)² ∫ D⁴ n(D) dD / area, exact for the pieces."""
        moment = self._moment_above(np.array([smallest, largest]), 4)
        return float((0.25 * np.pi) ** 2 * (moment[0] - moment[1]) / area)

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] by inversion of the truncated law."""
        ends, own = self.cumulative_number(np.array([smallest, largest])), self._pieces
        pieces = own.diameters, own.numbers, own.exponents
        diameters: Array = _sample(hashes, ends[0], ends[1], *pieces)
        return np.clip(diameters, smallest, largest)

    def with_table(self, table: Table) -> Tabulated:
        """The law with the numbers of its file."""
        diameters, numbers = (tuple(table.column(name).tolist()) for name in _COLUMNS)
        return replace(self, file=None, diameters_m=diameters, numbers_per_m2=numbers)

    def check(self, key: Key) -> None:
        """Refuse a table that is missing, doubled, ragged, or whose numbers do not fall."""
        wanted = "diameters_m and numbers_per_m2, or file"
        self.require_one(key, wanted, ("diameters_m", "numbers_per_m2"), ("file",))
        if self.diameters_m is None or self.numbers_per_m2 is None:
            return
        rows, numbers = len(self.diameters_m), len(self.numbers_per_m2)
        if rows != numbers:
            raise RecipeError(f"{rows} diameters, {numbers} numbers: as many of both", key=key)
        if rows < 2:
            raise RecipeError(f"{rows} row, a table needs at least 2", key=key)
        for name, way, sign in (("diameters_m", "rise", 1.0), ("numbers_per_m2", "fall", -1.0)):
            for row, (before, after) in enumerate(pairwise(getattr(self, name)), 1):
                if sign * (after - before) <= 0.0:
                    raise RecipeError(
                        f"{before:g} in row {row} and {after:g} in the next: they must {way}",
                        key=(*key, name),
                    )

    def report(self) -> dict[str, Any]:
        """The table's ends."""
        pieces = self._pieces
        return {
            "kind": self.kind,
            "rows": len(pieces.diameters),
            "diameter_m": [float(pieces.diameters[n]) for n in (0, -1)],
            "number_per_m2": [float(pieces.numbers[n]) for n in (0, -1)],
        }

    @cached_property
    def _pieces(self) -> PowerPieces:
        if self.diameters_m is None or self.numbers_per_m2 is None:
            raise RecipeError("table needs diameters_m and numbers_per_m2")
        return PowerPieces.through(self.diameters_m, self.numbers_per_m2)

    def _moment_above(self, diameter: Array, power: int) -> Array:
        """∫ D^power n(D) dD from each diameter on: its piece's rest, and the pieces above."""
        own = self._pieces
        start, scale = own.diameters, own.numbers * portable.power(own.diameters, power)

        def above(at: Array, row: NDArray[np.intp]) -> Array:
            ratio = at / start[row]
            return scale[row] * moment_above(ratio, own.exponents[row], power)

        every, row = np.arange(len(start)), own.row(diameter)
        at_ends = np.append(above(start[1:], every[:-1]), 0.0)
        whole = above(start, every) - at_ends
        beyond = np.append(np.cumsum(whole[::-1])[::-1], 0.0)[row + 1]
        found: Array = above(diameter, row) - at_ends[row] + beyond
        return found


@kernel
def _sample(hashes, most, least, diameter, number, exponent):  # type: ignore[no-untyped-def]
    diameters = np.empty(len(hashes))
    for n in range(len(hashes)):
        wanted = most - uniform(mix(hashes[n], 0)) * (most - least)
        low, high = 0, len(number)
        while high - low > 1:  # the last row whose number is not below the wanted one
            middle = (low + high) // 2
            if number[middle] >= wanted:
                low = middle
            else:
                high = middle
        diameters[n] = diameter[low] * (wanted / number[low]) ** (-1.0 / exponent[low])
    return diameters
