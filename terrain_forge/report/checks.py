"""Checks on the report page: every figure with its limit, and how other programs read the world."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from terrain_forge.report.facts import describe, measured
from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import Cell, Html, chip, facts, html, paragraph, plot, table
from terrain_forge.validation import table_rows

_SHOWN_ELSEWHERE = ("checks", "conformance", "paths", "terrain")
_OF_THE_FILE = ("format", "world", "verdict", "passed")

Check = Mapping[str, Any]
"""A check as validation/report.json has it."""


def checks_section(built: Built) -> Section:
    """All checks, those of drives too, then what was measured without a limit."""
    checks = built.validation.get("checks", [])
    if not checks:
        missing = "This world has not been validated: terrain-forge validate does it."
        return Section("Checks", (paragraph(missing),))
    shown = _tables([check for check in checks if not _is_measure(check)])
    measures = measure_facts([check for check in checks if not is_drive(check)])
    pictures = [plot(path, description=path.stem) for path in _other_pictures(built)]
    return Section("Checks", (*shown, *measures, *pictures))


def is_drive(check: Check) -> bool:
    """Whether a check is of a drive."""
    return bool(check.get("group") == "drive")


def _tables(checks: Sequence[Check]) -> Iterator[Html]:
    """The checks of each group under its name, in the order of the report."""
    for group in dict.fromkeys(check.get("group", "") for check in checks):
        rows = [_row(check) for check in checks if check.get("group", "") == group]
        if group:
            yield Html(f"<h3>{html(group[:1].upper() + group[1:])}</h3>")
        yield table(("Check", "Figure", "Limit", ""), rows, figures="lrrl", kind="checks")


def measure_facts(checks: Sequence[Check]) -> list[Html]:
    """What was measured without a limit among these checks, without what all names begin with."""
    subjects = {check["name"].partition(": ")[0] for check in checks if _is_measure(check)}
    beginning = f"{subjects.pop()}: " if len(subjects) == 1 else ""
    measures: list[tuple[str, Cell]] = []
    for check in filter(_is_measure, checks):
        name = check["name"].removeprefix(beginning)
        figure = measured(check.get("figure"), check.get("unit", ""))
        measures.append((name[:1].upper() + name[1:] if beginning else name, figure))
    return [Html("<h3>Measured, without a limit</h3>"), facts(measures)] if measures else []


def _is_measure(check: Check) -> bool:
    return check.get("limit") is None and check["passed"]


def _row(check: Check) -> list[Cell]:
    unit, note = check.get("unit", ""), check.get("note") or ""
    below = f"<small>{html(note)}</small>" if note else ""
    return [
        Html(html(check["name"]) + below),
        measured(check.get("figure"), unit),
        measured(check.get("limit"), unit),
        chip("pass", "good") if check["passed"] else chip("fail", "bad"),
    ]


def conformance_section(built: Built) -> Section | None:
    """Exports by consumers: the largest error of each aspect over its limit."""
    rows = table_rows(built.validation.get("conformance", []))
    if len(rows) == 1:
        return None
    note = (
        "Each export as the programs that read it have it: largest error / limit. A program that "
        "is not installed was not run, which says nothing. – : the format or the program does not "
        "have it."
    )
    shown = table(rows[0], rows[1:], figures="l" * len(rows[0]))
    return Section("In other programs", (paragraph(note, "note"), shown))


def further_section(built: Built) -> Section | None:
    """What else validation/report.json says, whoever wrote it there."""
    known = (*_SHOWN_ELSEWHERE, *_OF_THE_FILE)
    said = {
        name: content
        for name, content in built.validation.items()
        if content and name not in known and not name.startswith("drive")
    }
    return Section("Further figures", tuple(describe(said))) if said else None


def _other_pictures(built: Built) -> list[Path]:
    elsewhere = {*built.pictures("drive", "terrain")}
    return [path for path in built.pictures("") if path not in elsewhere]
