"""Anything that a JSON report says, as blocks: for what no section of its own was made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from terrain_forge.report.blocks import Block, Shown, facts, heading, table, thousands

_UNITS = {
    "m2": "m²",
    "m3": "m³",
    "m_s": "m/s",
    "m_s2": "m/s²",
    "rad_s": "rad/s",
    "n_m": "N m",
    "wh": "Wh",
    "kg": "kg",
    "deg": "°",
    "rad": "rad",
    "m": "m",
    "s": "s",
    "n": "N",
    "j": "J",
    "w": "W",
}
_LISTED = 8
_FOLDED = 12


def measured(value: Any, unit: str = "") -> str:
    """A figure or a limit as people write it."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    digits = f"{value:.4g}".replace("-", "\u2212")
    text = thousands(value) if isinstance(value, int) else digits
    shown = {"deg": "°"}.get(unit, f" {unit}" if unit else "")
    return f"{text}{shown}"


def named(key: str) -> tuple[str, str]:
    """A key such as `mean_slip_deg` as words and a unit."""
    for suffix, unit in _UNITS.items():
        if key.endswith(f"_{suffix}"):
            return _words(key.removesuffix(f"_{suffix}")), unit
    return _words(key), ""


def describe(content: Mapping[str, Any]) -> list[Block]:
    """Single values as facts, lists of like objects as tables, objects under a heading.

    An object of like objects is a table whose first column has their names. Long tables are folded
    away; long lists of numbers are left out, being there to be plotted.
    """
    single: list[tuple[str, Shown]] = []
    below: list[Block] = []
    for key, value in content.items():
        words, unit = named(key)
        if isinstance(value, Mapping):
            parts = value.values()
            if value and all(isinstance(part, Mapping) for part in parts):
                below += [heading(words), _rows([{"name": n, **p} for n, p in value.items()])]
            else:
                below += [heading(words), *describe(value)]
        elif isinstance(value, Sequence) and not isinstance(value, str):
            if value and all(isinstance(row, Mapping) for row in value):
                below += [heading(words), _rows(value)]
            elif short := _list(value, unit):
                single.append((words, short))
        else:
            single.append((words, measured(value, unit)))
    return [*([facts(single)] if single else []), *below]


def _rows(rows: Sequence[Mapping[str, Any]]) -> Block:
    keys = list(dict.fromkeys(key for row in rows for key in row))
    headings = [f"{words} [{unit}]" if unit else words for words, unit in map(named, keys)]
    cells = [[_cell(row.get(key)) for key in keys] for row in rows]
    figures = "".join("r" if _numbers([row.get(key) for row in rows]) else "l" for key in keys)
    return table(headings, cells, figures=figures, folded=len(rows) > _FOLDED)


def _cell(value: Any) -> str:
    return _list(value, "") if isinstance(value, list | tuple) else measured(value)


def _numbers(values: Sequence[Any]) -> bool:
    return all(v is None or (isinstance(v, int | float) and v is not True) for v in values)


def _list(values: Sequence[Any], unit: str) -> str:
    if not values:
        return "none"
    if len(values) > _LISTED:
        return "" if _numbers(values) else f"{len(values)}: {', '.join(map(str, values[:3]))}, …"
    return ", ".join(measured(value, unit) for value in values)


def _words(key: str) -> str:
    words = key.replace("_", " ").strip()
    return words[:1].upper() + words[1:]
