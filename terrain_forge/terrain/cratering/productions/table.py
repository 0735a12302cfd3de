"""A table."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import MinLen

from terrain_forge.base import InputFile, Positive, PowerPieces
from terrain_forge.model import Body, Table
from terrain_forge.terrain.cratering.production import Age, Counted, CraterProduction

_COLUMNS = ("diameter_m", "number_per_km2")


@dataclass(frozen=True, kw_only=True)
class CraterTable(CraterProduction):
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

    complete: ClassVar[bool] = True

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
