"""Writes what is made from the code: docs/recipe.md, docs/recipe.schema.json and docs/cli.md.

`python docs/make_pages.py` writes them, `--check` only tells whether they are current.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from terrain_forge.base import FARTHEST, LEAST, MOST, documented
from terrain_forge.cli import cli
from terrain_forge.model import exporter, exporter_names
from terrain_forge.recipe import RENAMES, json_schema

HERE = Path(__file__).parent

HEAD = """# The recipe

A recipe is a YAML file with the keys below. It is checked before any data is read; unknown keys are
refused, and so are keys that contradict others. A key that has no effect because of others, such as
`sky.star_gain` without stars, is told with its line. Lengths end in `_m`, angles in `_deg`. Paths
are relative to the recipe. `recipe.schema.json` is the same as JSON Schema: in VS Code, put
`# yaml-language-server: $schema=…/docs/recipe.schema.json` on the first line. `recipes/hello.yaml`
is an example with comments. What every number, name and file may be at most stands in
[limits](limits.md).

This page is made from the code by `python docs/make_pages.py`.
"""

COMMANDS = """# The command line

`terrain-forge` without a command shows its help. `--debug` before the command logs more and shows
tracebacks.

**Exit status**: 0 done; 1 built, but a validation check failed; 2 the input is wrong; 3 the disk
or the system refused, code of another package failed, or an internal error; 130 interrupted. An
`export` is failed by the checks of what it wrote and by those that passed before, not by what
failed before and has nothing to do with it. `evaluate` ends with 1 where no run of any system
could be scored, with 2 where one of its files could not; `study` with 1 where a system has no
score in one of its worlds, and `worlds` where one was not made. A server that is not reached is
status 2, and the line says what to do offline.

**Progress** is one line on the error stream, with the stage, what it is busy with, a clock and
the time left, which goes at the end. Where the error stream is no terminal, or `TERM=dumb`, each
stage is a line as it begins; `NO_COLOR` takes the colours away. What a command says of its result
goes to the standard output, complaints to the error stream.

**A picture before a build**: `terrain-forge preview RECIPE` draws ground, rocks and paths from
above as they will be, but for dynamic rocks, which it does not settle, and says how many rocks
there are, how steep the ground is and how long the paths are. Rocks smaller than a pixel of the
ground are counted, not drawn.

**Completion** of commands, recipes, installed exporters after `--only`, keys after `--set`, and
places and products after `fetch`, for bash, zsh or fish:

```sh
terrain-forge completion bash >> ~/.bashrc
terrain-forge completion zsh >> ~/.zshrc
terrain-forge completion fish > ~/.config/fish/completions/terrain-forge.fish
```

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
        HERE / "cli.md": command_page(),
    }
    stale = [p for p, text in pages.items() if not p.exists() or p.read_text("utf-8") != text]
    if "--check" in sys.argv:
        sys.exit(f"stale, run docs/make_pages.py: {[p.name for p in stale]}" if stale else 0)
    for path in stale:
        path.write_text(pages[path], encoding="utf-8")
        print(f"wrote {path.name}")


def command_page() -> str:
    """docs/cli.md."""
    parts = [COMMANDS]
    above = click.Context(cli, info_name="terrain-forge", help_option_names=["-h", "--help"])
    for name, command in cli.commands.items():
        context = click.Context(command, info_name=name, parent=above, terminal_width=90)
        parts.append(f"## {name}\n\n```text\n{command.get_help(context)}\n```\n")
    return "\n".join(parts)


def recipe_page(schema: dict[str, Any]) -> str:
    """docs/recipe.md."""
    root = dict(schema)
    parts = [HEAD, section("recipe", root, schema)]
    for name, part in sorted(schema["$defs"].items()):
        if "properties" in part and name.partition("_")[0] not in exporter_names():
            parts.append(section(name, part, schema))
    for name in exporter_names():
        from pydantic import TypeAdapter

        with documented():
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
        default = "**required**" if key in required else default_of(value)
        meaning = " ".join(value.get("description", "").split())
        lines.append(
            f"| `{key}` | {kind(value, schema)} | {default} | {meaning} |".replace("||", "|")
        )
    return "\n".join([*lines, ""])


def default_of(value: dict[str, Any]) -> str:
    """What stands where a key is left out; the schema does not tell a mapping's."""
    if "default" in value:
        return f"`{shown(value['default'])}`"
    return "`{}`" if value.get("type") == "object" else "its defaults"


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
