"""The craters on the report page: their numbers against the laws."""

from __future__ import annotations

from typing import Any

from terrain_forge.report.style import Cell, Html, paragraph, signed, table, thousands

_HEADINGS = ("Diameter", "Expected", "95 %", "Found")


def craters_section(counts: dict[str, Any]) -> list[Html]:
    """What a page says of a world's craters.

    Args:
        counts: Content of truth/crater_counts.json.
    """
    parts = []
    for layer in counts["layers"]:
        parts.append(paragraph(_summary(layer)))
        if "cumulative" in layer:
            parts.append(table(_HEADINGS, _rows(layer["cumulative"]), figures="lrrr"))
    return parts


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


def _rows(cumulative: dict[str, list[float]]) -> list[list[Cell]]:
    columns = (cumulative[name] for name in ("diameter_m", "expected", "low", "high", "found"))
    return [
        [f"≥ {diameter:g} m", f"{expected:.1f}", f"{low:.0f}–{high:.0f}", thousands(found)]
        for diameter, expected, low, high, found in zip(*columns, strict=True)
    ]
