"""Whether a built world's files are as they were built, and its exports hold the world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from terrain_forge.base import read_json
from terrain_forge.model import MANIFEST, MAX_MANIFEST, Check, at_most
from terrain_forge.validation.inspection import BuiltFolder, Inspection
from terrain_forge.validation.measures import Entry
from terrain_forge.validation.suite import conformance, quick_checks


class Files(Inspection):
    """Files that are missing, altered, or not the world's."""

    kind = "files"
    group = "files"

    def checks(self, built: BuiltFolder) -> Iterator[Check]:
        """One check over the world's files, one over what else is there but recordings."""
        added = [name for name in built.foreign if not name.startswith("dataset/")]
        altered = [*_misstated(built), *built.altered]
        for what, names in (("missing or altered", altered), ("added", added)):
            note = ", ".join(names[:3])
            yield at_most(f"files: {what}", float(len(names)), 0.0, note=note)


def _misstated(built: BuiltFolder) -> list[str]:
    """The manifest, where it states another recipe than the saved world's; a build has none yet."""
    path = built.directory / MANIFEST
    told = read_json(path, MANIFEST, most=MAX_MANIFEST) if path.is_file() else None
    wrong = built.world.site.misstated(told) if told else []
    return [f"{MANIFEST}: {' and '.join(wrong)}"] if wrong else []


class Exports(Inspection):
    """Ground, rocks, gravity and replays of each export, read back with a quick sample."""

    kind = "exports"
    group = "exports"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """The quick checks of all exports."""
        return quick_checks(
            built.world,
            built.directory,
            built.exports,
            points=built.spec.points,
            altered=built.altered,
        )


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
                altered=built.altered,
                progress=built.progress,
            )
        return [entry.check for entry in self._entries if entry.check]

    def report(self) -> dict[str, Any]:
        """The table."""
        return {"conformance": [vars(entry) for entry in self._entries]}
