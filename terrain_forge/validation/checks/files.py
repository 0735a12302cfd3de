"""Whether the files of a built world are as they were built."""

from __future__ import annotations

from collections.abc import Iterator

from terrain_forge.model import Check, at_most
from terrain_forge.validation.inspection import BuiltFolder, Inspection


class Files(Inspection):
    """Files that are missing, altered, or not the world's."""

    kind = "files"
    group = "files"

    def checks(self, built: BuiltFolder) -> Iterator[Check]:
        """One check over the world's files, one over what else is in its folder."""
        for what, names in (("missing or altered", built.altered), ("added", built.foreign)):
            note = ", ".join(names[:3])
            yield at_most(f"files: {what}", float(len(names)), 0.0, note=note)
