"""What a shell completes: recipes, exporters, the keys of a recipe."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

_DEEPEST = 8
_RECIPES = ".yaml", ".yml"
_MENDED = {
    "bash": {
        "            COMPREPLY+=($value)\n": '            COMPREPLY+=("$value")\n'
        "            [[ -f $value ]] && compopt -o filenames\n",
        "    return 0\n": "    [[ ${COMPREPLY[0]} == *[.=] ]] && compopt -o nospace\n"
        "    return 0\n",
    },
    "zsh": {
        '    if [ -n "$completions_with': "    [[ ${response[2]} == *[.=] ]] && ends=(-S '')\n"
        '    if [ -n "$completions_with',
        "    local -a response\n": "    local -a response ends\n",
        "_descriptions -U\n": '_descriptions -U "${ends[@]}"\n',
        "compadd -U ": 'compadd -U "${ends[@]}" ',
    },
    "fish": {'string split ","': 'string split -m 1 ","'},
}
"""What click's scripts lack: after a key that goes on no space follows, which fish knows; bash
quotes blanks of file names, and fish takes what holds commas."""


def completion_script(command: click.Command, shell: str) -> str:
    """What a shell reads to complete the command's words."""
    found = get_completion_class(shell)
    if found is None:
        raise click.UsageError(f"no completion for {shell}")
    script = found(command, {}, "terrain-forge", "_TERRAIN_FORGE_COMPLETE").source()
    for old, new in _MENDED.get(shell, {}).items():
        script = script.replace(old, new)
    return script


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


def complete_terrain_models(context: Any, parameter: Any, incomplete: str) -> list[CompletionItem]:
    """Places and products by name, and recipes."""
    from terrain_forge.dtm import terrain_models

    known = terrain_models().items()
    named = [CompletionItem(name, help=what) for name, what in known if name.startswith(incomplete)]
    files = complete_recipes(context, parameter, incomplete)
    return [*named, *(file for file in files if file.type == "plain" or not named)]


def complete_keys(_: Any, __: Any, incomplete: str) -> list[CompletionItem]:
    """The keys of a recipe up to their `=`, or to the next dot where they hold others."""
    from terrain_forge.recipe import json_schema

    schema = json_schema(exporters=incomplete.startswith("exports."))
    *steps, begun = incomplete.split(".")
    nodes = [schema]
    for step in steps:
        nodes = [inner for node in nodes for inner in _into(schema, node, step)]
    before = "".join(f"{step}." for step in steps)
    found: dict[str, str] = {}
    for key, part in (pair for node in nodes for pair in _keys(schema, node)):
        if key.startswith(begun):
            for end in _ends(schema, part):
                found.setdefault(f"{before}{key}{end}", str(part.get("description", "")))
    return [CompletionItem(key, help=about.partition("\n")[0]) for key, about in found.items()]


def _keys(schema: dict[str, Any], node: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The keys of a node and what stands under them; of a list its first place."""
    for member in _members(schema, node):
        if "items" in member:
            yield "0", {"description": "the first of a list", **member["items"]}
        yield from member.get("properties", {}).items()


def _ends(schema: dict[str, Any], part: dict[str, Any]) -> Iterator[str]:
    """What may follow a key: a dot where it holds others, `=` where it may be a plain value."""
    for member in _members(schema, part):
        inner = member.get("items") if member.get("type") == "array" else None
        if member.get("type") == "object" or (
            isinstance(inner, dict) and any(_keys(schema, inner))
        ):
            yield "."
        elif not {"$ref", "anyOf", "oneOf"} & set(member) and member.get("type") != "null":
            yield "="


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
