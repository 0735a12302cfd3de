"""Checks on the report page: every figure with its limit, and how other programs read the world."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from terrain_forge.report.blocks import Block, Cell, Shown, facts, heading, paragraph, plot, table
from terrain_forge.report.describe import describe, measured
from terrain_forge.report.section import Built, Section
from terrain_forge.validation import table_rows

_SHOWN_ELSEWHERE = ("checks", "conformance", "paths", "terrain")
_OF_THE_FILE = ("format", "world", "verdict", "passed")

Check = Mapping[str, Any]
"""A check as validation/report.json has it."""


class Checks(Section):
    """All checks but those of drives, then what was measured without a limit."""

    kind, title, place = "checks", "Checks", 90

    def blocks(self, built: Built) -> Sequence[Block]:
        """A table, facts, and the pictures that belong nowhere else."""
        checks = built.validation.get("checks", [])
        if not checks:
            missing = "This world has not been validated: terrain-forge validate does it."
            return [paragraph(missing)]
        shown = check_blocks([check for check in checks if not is_drive(check)])
        elsewhere = built.pictures("drive", "terrain")
        others = [path for path in built.pictures("") if path not in elsewhere]
        return [*shown, *(plot(path, description=path.stem) for path in others)]


def is_drive(check: Check) -> bool:
    """Whether a check is of a drive."""
    return bool(check.get("group") == "drive")


def check_blocks(checks: Sequence[Check]) -> Iterator[Block]:
    """Tables of the checks of each group, in the report's order, then what has no limit."""
    judged = [check for check in checks if not _is_measure(check)]
    groups = dict.fromkeys(check.get("group", "") for check in judged)
    for group in groups:
        rows = [_row(check) for check in judged if check.get("group", "") == group]
        if group and len(groups) > 1:
            yield heading(group[:1].upper() + group[1:])
        yield table(("Check", "Figure", "Limit", ""), rows, figures="lrrl", style="checks")
    measures = [check for check in checks if _is_measure(check)]
    # Without what all their names begin with.
    subjects = {check["name"].partition(": ")[0] for check in measures}
    beginning = f"{subjects.pop()}: " if len(subjects) == 1 else ""
    found: list[tuple[str, Shown]] = []
    for check in measures:
        name = check["name"].removeprefix(beginning)
        figure = measured(check.get("figure"), check.get("unit", ""))
        found.append((name[:1].upper() + name[1:], figure))
    if found:
        yield from (heading("Measured, without a limit"), facts(found))


def _is_measure(check: Check) -> bool:
    return check.get("limit") is None and check["passed"]


def _row(check: Check) -> list[Shown]:
    unit = check.get("unit", "")
    return [
        Cell(check["name"], note=check.get("note") or ""),
        measured(check.get("figure"), unit),
        measured(check.get("limit"), unit),
        Cell("pass", "good") if check["passed"] else Cell("fail", "bad"),
    ]


class Conformance(Section):
    """Exports by consumers: the largest error of each aspect over its limit."""

    kind, title, place = "conformance", "In other programs", 100

    def blocks(self, built: Built) -> Sequence[Block]:
        """The table, where the exports were opened."""
        rows = table_rows(built.validation.get("conformance", []))
        if len(rows) == 1:
            return []
        note = (
            "Each export as the programs that read it have it: largest error / limit. A program "
            "that is not installed was not run, which says nothing. – : the format or the program "
            "does not have it."
        )
        return [paragraph(note, "note"), table(rows[0], rows[1:], figures="l" * len(rows[0]))]


class Further(Section):
    """What else validation/report.json says, whoever wrote it there."""

    kind, title, place = "further", "Further figures", 110

    def blocks(self, built: Built) -> Sequence[Block]:
        """Facts and tables."""
        said = {name: content for name, content in built.validation.items() if content}
        new = said.keys() - {*_SHOWN_ELSEWHERE, *_OF_THE_FILE}
        return describe({n: said[n] for n in said if n in new and not n.startswith("drive")})
