"""Writes what is made from the code: docs/recipe.md and docs/recipe.schema.json.

`python docs/make_pages.py` writes them, `--check` only tells whether they are current.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from terrain_forge.base import FARTHEST, LEAST, MOST
from terrain_forge.model import exporter, exporter_names
from terrain_forge.recipe import RENAMES, json_schema

HERE = Path(__file__).parent

HEAD = """# The recipe

A recipe is a YAML file with the keys below. It is checked before any data is read; unknown keys are
refused. Lengths end in `_m`, angles in `_deg`. Paths are relative to the recipe.
`recipe.schema.json` is the same as JSON Schema: in VS Code, put `# yaml-language-server:
$schema=…/docs/recipe.schema.json` on the first line. `recipes/hello.yaml` is an example with
comments. What every number, name and file may be at most stands in [limits](limits.md).

This page is made from the code by `python docs/make_pages.py`.
"""

RENAMED = """## Renamed keys

A key that was renamed is still read by its old name, in recipes, after `--set` and in saved worlds,
with a warning that names file and line: `recipe.yaml:12: rocks.populations[0].loose_m is now called
dynamic_m`. To give both names is an error.
"""


def main() -> None:
    """Write or check the pages."""
    schema = json_schema()
    pages = {
        HERE / "recipe.schema.json": json.dumps(schema, indent=1, ensure_ascii=False) + "\n",
        HERE / "recipe.md": recipe_page(schema),
    }
    stale = [p for p, text in pages.items() if not p.exists() or p.read_text("utf-8") != text]
    if "--check" in sys.argv:
        sys.exit(f"stale, run docs/make_pages.py: {[p.name for p in stale]}" if stale else 0)
    for path in stale:
        path.write_text(pages[path], encoding="utf-8")
        print(f"wrote {path.name}")


def recipe_page(schema: dict[str, Any]) -> str:
    """docs/recipe.md."""
    root = dict(schema)
    parts = [HEAD, section("recipe", root, schema)]
    for name, part in sorted(schema["$defs"].items()):
        if "properties" in part:
            parts.append(section(name, part, schema))
    for name in exporter_names():
        from pydantic import TypeAdapter

        options = TypeAdapter(exporter(name).Options).json_schema()
        parts.append(section(f"Options of the exporter {name}", options, options))
    parts.append(renamed_keys())
    return "\n".join(parts)


def renamed_keys() -> str:
    """The keys that had another name before."""
    rows = [
        f"| `{one.where}.{one.old}`{f' (kind `{one.kind}`)' * bool(one.kind)} | `{one.new}` |"
        for one in RENAMES
    ]
    return "\n".join([RENAMED, "| old | new |", "|---|---|", *rows, ""])


def section(name: str, part: dict[str, Any], schema: dict[str, Any]) -> str:
    """One mapping as a table of its keys."""
    description = " ".join(part.get("description", "").split())
    if name == "recipe":
        description = "The top level."
    lines = [f"## {name}", "", description, ""]
    if not part.get("properties"):
        return "\n".join([*lines, "No keys.", ""])
    lines += ["| key | value | default | meaning |", "|---|---|---|---|"]
    required = part.get("required", [])
    for key, value in part["properties"].items():
        default = "**required**" if key in required else f"`{shown(value.get('default'))}`"
        meaning = " ".join(value.get("description", "").split())
        lines.append(
            f"| `{key}` | {kind(value, schema)} | {default} | {meaning} |".replace("||", "|")
        )
    return "\n".join([*lines, ""])


def shown(value: Any) -> str:
    """A default, short."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) < 40 else "…"


def kind(value: dict[str, Any], schema: dict[str, Any]) -> str:
    """What a value may be, in words and links."""
    if "$ref" in value:
        name = value["$ref"].rsplit("/", 1)[-1]
        return f"[{name}](#{name.lower()})"
    if "const" in value:
        return f"`{value['const']}`"
    if "enum" in value:
        return " or ".join(f"`{option}`" for option in value["enum"])
    for union in ("anyOf", "oneOf"):
        if union in value:
            return " or ".join(kind(option, schema) for option in value[union])
    if value.get("type") == "array":
        if "prefixItems" in value:
            return "[" + ", ".join(kind(item, schema) for item in value["prefixItems"]) + "]"
        return f"list of {kind(value.get('items', {}), schema)}"
    if value.get("type") == "object":
        return "mapping"
    return limits(value)


def limits(value: dict[str, Any]) -> str:
    """A number's or text's type with its limits."""
    names = {"number": "number", "integer": "whole number", "string": "text", "null": "nothing"}
    text = names.get(value.get("type", ""), value.get("type", "anything"))
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    everyones = {"minimum": (-FARTHEST,), "maximum": (FARTHEST, MOST)}  # in limits.md
    bounds = [
        "> 0" if value[key] == LEAST else f"{sign} {value[key]:g}"
        for key, sign in signs.items()
        if key in value and value[key] not in everyones.get(key, ())
    ]
    return " ".join([text, ", ".join(bounds)]).strip()


if __name__ == "__main__":
    main()
