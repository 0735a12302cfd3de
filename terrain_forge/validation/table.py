"""The conformance table as text: a row per export and consumer, a column per aspect."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from terrain_forge.model import Check
from terrain_forge.validation.inspection import content_of
from terrain_forge.validation.measures import ASPECTS

_MARKS = {"pass": "", "fail": " FAIL", "not carried": "–"}


def table_rows(entries: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """The cells of the table, the headings first.

    Args:
        entries: The report's `conformance`: entries as they are in report.json.
    """
    rows = [["export", "consumer", *ASPECTS]]
    found: dict[tuple[str, str], dict[str, Mapping[str, Any]]] = {}
    for entry in entries:
        found.setdefault((entry["export"], entry["consumer"]), {})[entry["aspect"]] = entry
    for (export, consumer), aspects in found.items():
        if "" in aspects:
            only = aspects[""]
            word = "not run" if only["status"] == "not run" else "FAIL"
            rows.append([export, consumer, f"{word}: {only['note']}", *[""] * (len(ASPECTS) - 1)])
        else:
            rows.append([export, consumer, *(_cell(aspects.get(aspect)) for aspect in ASPECTS)])
    return rows


def report_text(report: Path) -> str:
    """The table of a report.json, for a terminal."""
    return table_text(json.loads(report.read_text(encoding="utf-8"))["conformance"])


def checks_of(directory: Path) -> list[Check]:
    """The checks of a built folder that a limit judges, as it was last validated.

    None before, nor where its report is damaged.
    """
    try:
        found = read_checks(directory / "validation" / "report.json")
    except ValueError:
        return []
    return [check for check in found if check.judged]


def read_checks(path: Path) -> list[Check]:
    """The checks of a report, or none where there is no such file.

    Raises:
        ValueError: if what it calls checks are none.
    """
    return TypeAdapter(list[Check]).validate_python(content_of(path).get("checks", []))


def failed_checks(directory: Path) -> list[Check]:
    """The checks of a built folder that failed."""
    return [check for check in checks_of(directory) if not check.passed]


def table_text(entries: Sequence[Mapping[str, Any]]) -> str:
    """The table in columns, for a terminal; empty where there are no entries."""
    if not entries:
        return ""
    rows = table_rows(entries)
    # What was not run says why in place of figures, and may be long.
    whole = [row for row in rows if any(row[3:])]
    widths = [max(len(row[column]) for row in whole) for column in range(len(rows[0]))]
    widths[:2] = [max(len(row[column]) for row in rows) for column in range(2)]
    lines = (
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    )
    return "\n".join(line.rstrip() for line in lines)


def _cell(entry: Mapping[str, Any] | None) -> str:
    """The largest error over its limit."""
    if entry is None:
        return ""
    mark = _MARKS[entry["status"]]
    if entry["figure"] is None:
        return mark.strip() or "pass"
    unit = f" {entry['unit']}" if entry["unit"] else ""
    return f"{entry['figure']:.2g}/{entry['limit']:.2g}{unit}{mark}"
