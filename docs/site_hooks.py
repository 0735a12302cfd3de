"""What MkDocs makes besides the pages in docs/: start, changes, decisions, reference, tutorials."""

from __future__ import annotations

import ast
import os
import re
import tempfile
from collections import defaultdict
from pathlib import Path

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient

DOCS = Path(__file__).parent
ROOT = DOCS.parent
_EXECUTED = tempfile.TemporaryDirectory(prefix="tutorials-")
ROOMS = {
    "pipeline": "Building",
    "making": "Planning",
    "recipe": "The recipe",
    "dtm": "Terrain models",
    "terrain": "Ground",
    "rocks": "Rocks",
    "rovers": "Rovers",
    "paths": "Paths",
    "truth": "Truth",
    "sky": "Sun and sky",
    "building": "Results",
    "datasets": "Datasets",
    "model": "Values that stages hand on",
    "base": "Errors and parts",
    "recording": "Recordings",
    "report": "Evaluation of worlds",
    "evaluation": "Evaluation of localisation",
    "variation": "Many worlds",
    "learning": "Learning",
}
"""Rooms with names in `terrain_forge`, as the reference lists them."""


@event_priority(100)  # before the plugin that makes pages of notebooks
def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made here."""
    pages = {
        "index.md": moved((ROOT / "README.md").read_text("utf-8")),
        "changelog.md": moved((ROOT / "CHANGELOG.md").read_text("utf-8")),
        "adr/README.md": decisions(),
        "reference.md": reference(),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    for file in files:
        if file.src_uri.endswith(".ipynb"):
            run(file)
            file.src_dir = _EXECUTED.name
    return files


def run(file: File) -> None:
    """Run a tutorial in an empty folder and keep it with its results; an error ends the build."""
    assert file.abs_src_path
    tutorial = nbformat.read(file.abs_src_path, as_version=4)
    if os.environ.get("TERRAIN_FORGE_TUTORIALS") != "as-they-are":
        with tempfile.TemporaryDirectory() as folder:
            there = {"metadata": {"path": folder}}
            NotebookClient(tutorial, timeout=900, resources=there).execute()
    for cell in tutorial.cells:
        if cell.cell_type == "markdown":  # MkDocs turns links only in pages of Markdown
            cell.source = re.sub(r"\]\((\.\./[\w/-]+)\.md\)", r"](\1.html)", cell.source)
    done = Path(_EXECUTED.name) / file.src_uri
    done.parent.mkdir(exist_ok=True)
    nbformat.write(tutorial, done)


def moved(text: str) -> str:
    """A page of the root as one of docs/; links to what the site does not hold become text."""

    def link(found: re.Match[str]) -> str:
        label, target = found[1], found[2]
        inside = target.removeprefix("docs/")
        if "://" in target or target.startswith("#"):
            return found[0]
        if not target.startswith("docs/"):
            return label
        return f"[{label}]({inside}{'/README.md' * (ROOT / target).is_dir()})"

    return re.sub(r"(?<!!)\[([^\]]*)\]\(([^)\s]*)\)", link, text).replace("](docs/", "](")


def decisions() -> str:
    """The list of decisions."""
    lines = ["# Decisions", "", "Why things are as they are, one page each.", ""]
    for path in sorted((DOCS / "adr").glob("0*.md")):
        title = path.read_text("utf-8").split("\n", 1)[0].lstrip("# ")
        lines.append(f"- [{title}]({path.name})")
    return "\n".join(lines) + "\n"


def reference() -> str:
    """All names of `terrain_forge` by room."""
    rooms: dict[str, list[str]] = defaultdict(list)
    stub = ast.parse((ROOT / "terrain_forge" / "__init__.pyi").read_text("utf-8"))
    for node in stub.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            rooms[node.module] += [alias.asname or alias.name for alias in node.names]
    missing = {*rooms} - {*ROOMS}
    if missing:
        raise ValueError(f"docs/site_hooks.py: rooms without a title: {sorted(missing)}")
    lines = ["# Reference", "", "All names of `import terrain_forge as tf`.", ""]
    for room, title in ROOMS.items():
        lines += [f"## {title}", ""]
        for name in rooms[room]:
            lines += [f"::: terrain_forge.{room}.{name}", "    options: {heading_level: 3}", ""]
    return "\n".join(lines)
