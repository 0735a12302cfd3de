"""Whether each export holds the world, read back with a quick sample."""

from __future__ import annotations

from terrain_forge.model import Check
from terrain_forge.validation.inspection import BuiltFolder, Inspection
from terrain_forge.validation.suite import quick_checks


class Exports(Inspection):
    """Ground, rocks, gravity and replays of each export."""

    kind = "exports"
    group = "exports"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """The quick checks of all exports."""
        return quick_checks(built.world, built.directory, built.exports, points=built.spec.points)
