"""The parts of the report page that say how to open a world and what lies where."""

from __future__ import annotations

import logging

from terrain_forge.model import Export, Opening
from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import Cell, Html, command, html, paragraph, table

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


def usage_section(built: Built) -> Section:
    """How to open the exports that lie in a built folder."""
    opened = [words for export in built.exports if (words := _opening(built, export))]
    python = 'from terrain_forge import World\nworld = World.load(".")'
    opened.append(Opening(title="Python", commands=python))
    commands = paragraph("Commands are run in the folder that holds this page.", "note")
    columns = "".join(
        f"<div><h3>{html(words.title)}</h3>{command(words.commands).text}</div>" for words in opened
    )
    return Section("Open it", (commands, Html(f'<div class="pair">{columns}</div>')))


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


def files_section(built: Built) -> Section:
    """What lies in the folder."""
    entries = built.directory.iterdir()
    names = [path.name for path in entries if path.suffix not in (".log", ".html")]
    # The manifest is written last and the timings after it, but whoever reads this has them.
    present = sorted({*names, "manifest.json", "timings.json"})
    rows: list[list[Cell]] = [[name, _FOLDERS.get(name, _EXPORT)] for name in present]
    return Section("Files", (table(("File or folder", "What it holds"), rows, figures="ll"),))
