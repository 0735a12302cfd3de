"""The craters on the report page: their numbers against the laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from terrain_forge.report.blocks import Block, Shown, paragraph, signed, table, thousands
from terrain_forge.report.section import Built, Section

_HEADINGS = ("Diameter", "Expected", "95 %", "Observed")


class Craters(Section):
    """The numbers of craters that truth/crater_counts.json has."""

    kind, title, place = "craters", "The craters", 50

    def blocks(self, built: Built) -> Sequence[Block]:
        """A line and a table for each layer."""
        shown = []
        for layer in built.json("truth/crater_counts.json").get("layers", ()):
            shown.append(paragraph(_summary(layer)))
            if "cumulative" in layer:
                shown.append(table(_HEADINGS, _rows(layer["cumulative"]), figures="lrrr"))
        return shown


def _summary(layer: dict[str, Any]) -> str:
    text = f"{layer['name']}: {thousands(layer['listed'])} listed one by one."
    if "number" not in layer:
        return text
    number, sizes = layer["number"], layer["sizes"]
    smallest, largest = layer["diameter_m"]
    text += (
        f" Of {layer['production']} production, {layer['age_ga']:g}·10⁹ years, equilibrium "
        f"{layer['equilibrium']}, from {smallest:g} to {largest:g} m: "
        f"{thousands(number['found'])} in the area, {number['expected']:.1f} expected "
        f"(z = {signed(number['z'])})"
    )
    return text + (f", sizes p = {sizes['p_value']:.3f}." if sizes else ".")


def _rows(cumulative: dict[str, list[float]]) -> list[list[Shown]]:
    columns = (cumulative[name] for name in ("diameter_m", "expected", "low", "high", "found"))
    return [
        [f"≥ {diameter:g} m", f"{expected:.1f}", f"{low:.0f}–{high:.0f}", thousands(found)]
        for diameter, expected, low, high, found in zip(*columns, strict=True)
    ]
