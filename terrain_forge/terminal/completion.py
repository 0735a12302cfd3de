"""What a shell completes: recipes, exporters, the keys of a recipe."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

_DEEPEST = 8
_RECIPES = ".yaml", ".yml"


def completion_script(command: click.Command, shell: str) -> str:
    """What a shell reads to complete the command's words."""
    found = get_completion_class(shell)
    if found is None:
        raise click.UsageError(f"no completion for {shell}")
    return found(command, {}, "terrain-forge", "_TERRAIN_FORGE_COMPLETE").source()


def complete_recipes(_: Any, __: Any, incomplete: str) -> list[CompletionItem]:
    """Recipes in the folder that is named so far and in those below it, or else any file."""
    start = Path(incomplete)
    folder = start if incomplete.endswith("/") else start.parent
    beginning = "" if incomplete.endswith("/") else start.name
    try:
        found = [
            str(path)
            for near in folder.glob(f"{beginning}*")
            for path in ([near] if near.suffix in _RECIPES else sorted(near.glob("*.y*ml")))
        ]
    except OSError:
        found = []
    return [CompletionItem(name) for name in sorted(found)] or [
        CompletionItem(incomplete, type="file")
    ]


def complete_starters(_: Any, __: Any, incomplete: str) -> list[CompletionItem]:
    """The recipes that `init` writes."""
    from terrain_forge.recipe import starters

    known = starters().items()
    return [
        CompletionItem(name, help=about) for name, about in known if name.startswith(incomplete)
    ]


def complete_exporters(_: Any, __: Any, incomplete: str) -> list[CompletionItem]:
    """The installed exporters, after those that are named already and a comma."""
    from terrain_forge.model import exporter_names

    before, comma, begun = incomplete.rpartition(",")
    named = before.split(",")
    return [
        CompletionItem(f"{before}{comma}{name}")
        for name in exporter_names()
        if name.startswith(begun) and name not in named
    ]


def complete_keys(_: Any, __: Any, incomplete: str) -> list[CompletionItem]:
    """The keys of a recipe with dots between them, up to the next dot or to their `=`."""
    from terrain_forge.recipe import json_schema

    schema = json_schema()
    *steps, begun = incomplete.split(".")
    nodes = [schema]
    for step in steps:
        nodes = [inner for node in nodes for inner in _into(schema, node, step)]
    before = "".join(f"{step}." for step in steps)
    found: dict[str, str] = {}
    for node in nodes:
        for member in _members(schema, node):
            if "items" in member:
                found.setdefault("0", "the first of a list")
            for key, part in member.get("properties", {}).items():
                found.setdefault(key, str(part.get("description", "")))
    return [
        CompletionItem(f"{before}{key}", help=about.partition("\n")[0])
        for key, about in found.items()
        if key.startswith(begun)
    ]


def _into(schema: dict[str, Any], node: dict[str, Any], step: str) -> Iterator[dict[str, Any]]:
    """What may stand under a key of a node, or at a place of a list."""
    for member in _members(schema, node):
        if step in member.get("properties", {}):
            yield member["properties"][step]
        if step.isdecimal() and isinstance(member.get("items"), dict):
            yield member["items"]


def _members(
    schema: dict[str, Any], node: dict[str, Any], depth: int = 0
) -> Iterator[dict[str, Any]]:
    """A node with its references followed, and all of a union."""
    if depth > _DEEPEST:
        return
    if "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
    yield node
    for choice in (*node.get("anyOf", ()), *node.get("oneOf", ())):
        yield from _members(schema, choice, depth + 1)
