"""One thing that was checked."""

from __future__ import annotations

from dataclasses import dataclass

from terrain_forge.base import Record, checked


@dataclass(frozen=True, kw_only=True, eq=False)
class Check(Record):
    """A figure, the limit that it must keep, and whether it does."""

    name: str
    """What was checked."""
    figure: float | None
    """What was found; None where it could not be found."""
    unit: str
    """Unit of figure and limit; empty for counts and ratios."""
    limit: float | None
    """The largest figure that passes, or the smallest where the note says so; None for none."""
    passed: bool
    """Whether it is within its limit."""
    note: str
    """What the figure means or why there is none."""
    group: str = ""
    """What it belongs to, such as `ground`, `rocks` or `drive`: the report page shows it there."""

    @property
    def judged(self) -> bool:
        """Whether it can fail; a figure without a limit is there to be read."""
        return self.limit is not None or not self.passed

    def told(self) -> str:
        """Name, figure and limit in one line, as a message says what failed."""
        unit = f" {self.unit}" if self.unit else ""
        figure = "" if self.figure is None else f" {self.figure:.4g}{unit}"
        limit = "" if self.limit is None else f", limit {self.limit:.4g}{unit}"
        return (
            f"{self.name}:{figure}{limit}{' (' * bool(self.note)}{self.note}{')' * bool(self.note)}"
        )


@checked
def at_most(
    name: str, figure: float, limit: float | None, *, unit: str = "", note: str = ""
) -> Check:
    """A check that passes up to its limit, or always where it has none."""
    passed = limit is None or bool(figure <= limit)
    return Check(name=name, figure=figure, unit=unit, limit=limit, passed=passed, note=note)


@checked
def at_least(name: str, figure: float, limit: float, *, unit: str = "", note: str = "") -> Check:
    """A check that passes from its limit on."""
    note = f"{note}; at least" if note else "at least"
    passed = bool(figure >= limit)
    return Check(name=name, figure=figure, unit=unit, limit=limit, passed=passed, note=note)


def failed(name: str, note: str) -> Check:
    """A check that could not even be made."""
    return Check(name=name, figure=None, unit="", limit=None, passed=False, note=note)
