"""Whether the files of a built world are as they were built."""

from __future__ import annotations

from collections.abc import Iterator

from terrain_forge.model import Check, at_most
from terrain_forge.validation.inspection import BuiltFolder, Inspection


class Files(Inspection):
    """Files that are missing or altered."""

    kind = "files"
    group = "files"

    def checks(self, built: BuiltFolder) -> Iterator[Check]:
        """One check over all of them."""
        note = ", ".join(built.altered[:3])
        yield at_most("files: missing or altered", float(len(built.altered)), 0.0, note=note)
