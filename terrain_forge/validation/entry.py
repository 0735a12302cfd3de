"""A cell of the conformance table: one aspect of an export in one consumer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from terrain_forge.model import Check

ASPECTS = (
    *("findings", "ground", "rock tops", "rock outlines", "masses", "gravity", "frames", "path"),
    "balls",
)
"""What is compared, in the order of the table's columns."""

Status = Literal["pass", "fail", "not carried", "not run"]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What was found of one aspect; of a consumer that is missing, that it was not run."""

    export: str
    """Folder of the export."""
    kind: str
    """The exporter."""
    consumer: str
    """The program that read it, with its version where it was run."""
    aspect: str
    """One of ASPECTS; empty where the consumer was not run at all."""
    status: Status
    """`pass`, `fail`, `not carried` (the format or the consumer does not have it), `not run`."""
    figure: float | None = None
    """The largest error."""
    unit: str = ""
    """Unit of figure and limit; empty for ratios and counts."""
    limit: float | None = None
    """The largest error that passes."""
    note: str = ""
    """What the figure means, or why there is none."""

    @property
    def check(self) -> Check | None:
        """The entry as a check; None where nothing was measured, which neither passes nor fails."""
        if self.status not in ("pass", "fail"):
            return None
        return Check(
            name=f"{self.export} in {self.consumer}: {self.aspect or 'reading'}",
            figure=self.figure,
            unit=self.unit,
            limit=self.limit,
            passed=self.status == "pass",
            note=self.note,
        )
