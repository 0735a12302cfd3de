"""The parts of the report page that say how to open a world and what lies where."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from terrain_forge.model import Export, Opening
from terrain_forge.report.blocks import Block, Shown, heading, paragraph, table
from terrain_forge.report.section import Built, Section

_log = logging.getLogger(__name__)


_FOLDERS = {
    "preview.png": "the picture above",
    "world": "the world itself; World.load reads it back",
    "truth": "GeoTIFFs of ground, top surface and rock ids; rocks.csv; size-frequency verification",
    "paths": "trajectories as CSV and in the TUM format",
    "validation": "every check with its figure, the driven path, pictures",
    "manifest.json": "the resolved recipe, versions, SHA-256 of every file",
    "timings.json": "wall times",
}

_EXPORT = "an export: world.* is the place, scene.* adds what moves in it"


class Usage(Section):
    """How to open the exports that lie in a built folder."""

    kind, title, place = "usage", "Open it", 20

    def blocks(self, built: Built) -> Sequence[Block]:
        """Commands for each export, and for Python."""
        opened = [words for export in built.exports if (words := _opening(built, export))]
        python = 'from terrain_forge import World\nworld = World.load(".")'
        opened.append(Opening(title="Python", commands=python))
        columns = [
            [heading(words.title), Block(kind="command", text=words.commands)] for words in opened
        ]
        note = paragraph("Commands are run in the folder that holds this page.", "note")
        return [note, Block(kind="pair", columns=columns)]


def _opening(built: Built, export: Export) -> Opening | None:
    """The words of an export's exporter, if it has any; the validation's own exports have none."""
    if "/" in export.folder:
        return None
    try:
        module, options = export.opened()
        words = getattr(module, "opening", None)
        found: Opening | None = words and words(built.directory / export.folder, options)
        return found
    except Exception as error:  # whatever a foreign exporter raises must not break the page
        _log.warning("how to open %s is not known: %s", export.folder, error)
        return None


class Files(Section):
    """What lies in the folder."""

    kind, title, place = "files", "Files", 120

    def blocks(self, built: Built) -> Sequence[Block]:
        """A table of files and folders."""
        entries = built.directory.glob("[!.]*")
        names = [path.name for path in entries if path.suffix not in (".log", ".html")]
        # The manifest is written last and the timings after it, but whoever reads this has them.
        present = sorted({*names, "manifest.json", "timings.json"})
        rows: list[list[Shown]] = [[name, _FOLDERS.get(name, _EXPORT)] for name in present]
        return [table(("File or folder", "What it holds"), rows, figures="ll")]
