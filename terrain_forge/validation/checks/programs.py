"""Whether each export holds the world in the programs that read it."""

from __future__ import annotations

from typing import Any

from terrain_forge.model import Check
from terrain_forge.validation.entry import Entry
from terrain_forge.validation.inspection import BuiltFolder, Inspection
from terrain_forge.validation.suite import conformance


class Programs(Inspection):
    """The conformance table, where all consumers are asked for."""

    kind = "programs"
    group = "other programs"

    def __init__(self) -> None:
        self._entries: list[Entry] = []

    def checks(self, built: BuiltFolder) -> list[Check]:
        """The entries of the table that were measured."""
        if built.spec.consumers == "all":
            self._entries = conformance(
                built.world,
                built.directory,
                built.exports,
                points=built.spec.points,
                progress=built.progress,
            )
        return [entry.check for entry in self._entries if entry.check]

    def report(self) -> dict[str, Any]:
        """The table."""
        return {"conformance": [vars(entry) for entry in self._entries]}
