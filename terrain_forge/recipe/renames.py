"""Keys of a recipe that were renamed: the old ones are read, with a warning.

To rename a key, rename the field of its spec and add a row here.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terrain_forge.base import Key, OutputError, RecipeError, dotted, warn_user


@dataclass(frozen=True)
class Rename:
    """A key that has another name now."""

    where: str
    """Where its mapping stands, with `*` for any number or name: `rocks.populations.*`."""
    old: str
    """Its name before."""
    new: str
    """Its name now."""
    kind: str = ""
    """Only in mappings of this `kind`, which for exports is the folder's name unless given."""


RENAMES = (
    Rename("rocks", "keep_out", "exclusion_zones"),
    Rename("rocks.populations.*", "loose_m", "dynamic_m"),
    Rename("paths.*.route", "stance", "attitude", kind="file"),
    Rename("exports.*", "loose_modulus_pa", "dynamic_modulus_pa", kind="drake"),
)
"""All of them, oldest first."""


def rename_keys(data: Any) -> list[tuple[Key, Key]]:
    """Rename the old keys in the plain data of a recipe; returns them with what they are now.

    Raises:
        RecipeError: for a key that is given by both names.
    """
    renamed = []
    for rename in RENAMES:
        for place, mapping in _mappings(data, tuple(rename.where.split("."))):
            old, new = (*place, rename.old), (*place, rename.new)
            if rename.old not in mapping or not _is_kind(rename, place, mapping):
                continue
            if rename.new in mapping:
                raise RecipeError(
                    f"{rename.old!r} is the old name of {rename.new!r}: give one of them", key=old
                )
            pairs = [(rename.new if k == rename.old else k, v) for k, v in mapping.items()]
            mapping.clear()
            mapping.update(pairs)
            renamed.append((old, new))
    return renamed


def current_key(data: Any, key: Key) -> Key:
    """A key with the names that its steps have now; `data` has them already."""
    now: Key = ()
    for step in key:
        for rename in RENAMES:
            where = rename.where.split(".")
            fits = len(where) == len(now) and all(
                w in ("*", str(s)) for w, s in zip(where, now, strict=True)
            )
            if fits and step == rename.old and _is_kind(rename, now, value_at(data, now)):
                step = rename.new
        now = (*now, step)
    return now


def members(items: Sequence[Any], word: str) -> list[int]:
    """Which elements of a list a word names: by number, or by their `name` or else their `kind`."""
    if word.isdecimal():
        return [int(word)] if int(word) < len(items) else []
    named = [one.get("name", one.get("kind")) if isinstance(one, dict) else None for one in items]
    return [number for number, name in enumerate(named) if name == word]


def numbered(data: Any, words: Sequence[str]) -> Key:
    """A key's words, with numbers for elements of lists, which may be called by their names."""
    key: list[int | str] = []
    for word in words:
        named = members(data, word) if isinstance(data, list) else []
        step = named[0] if len(named) == 1 else int(word) if word.isdecimal() else word
        inside = isinstance(data, list) and len(named) == 1
        data = data[step] if inside else data.get(word) if isinstance(data, dict) else None
        key.append(step)
    return tuple(key)


def current_json(text: str, file: Path) -> str:
    """The canonical JSON of a saved world's recipe with the names that its keys have now.

    Warns of each that has another one, by the name of the file that it was read from.

    Raises:
        OutputError: for a key that is given by both names.
    """
    data = json.loads(text)
    try:
        renamed = rename_keys(data)
    except RecipeError as error:
        raise OutputError(f"{file}: {dotted(error.key)}: {error}") from None
    lines = file.read_text(encoding="utf-8").splitlines() if renamed else []
    line = next((n for n, text in enumerate(lines, 1) if '"recipe_json":' in text), 1)
    for old, new in renamed:
        warn_renamed(f"{file}:{line}", old, new)
    return json.dumps(data, sort_keys=True, separators=(",", ":")) if renamed else text


def with_current_names(manifest: dict[str, Any]) -> dict[str, Any]:
    """A manifest whose recipe has the names that its keys have now, without a warning."""
    recipe = deepcopy(manifest.get("recipe"))
    with suppress(RecipeError):  # a key that is given by both names is left
        rename_keys(recipe)
    return {**manifest, "recipe": recipe}


def warn_renamed(where: str, old: Key, new: Key) -> None:
    """Warn that a key has another name now; `where` is the file, with its line if that is known."""
    warn_user(f"{where}: {dotted(old)} is now called {new[-1]}")


def _is_kind(rename: Rename, place: Key, mapping: Any) -> bool:
    kind = mapping.get("kind", place[-1]) if isinstance(mapping, dict) else ""
    return rename.kind in ("", kind)


def _mappings(data: Any, where: tuple[str, ...]) -> Iterator[tuple[Key, dict[str, Any]]]:
    """The mappings at all places that a pattern fits, and their keys."""
    if not where:
        if isinstance(data, dict):
            yield (), data
        return
    steps: list[str | int] = [where[0]]
    if where[0] == "*":
        steps = [*data] if isinstance(data, dict) else []
        steps = [*range(len(data))] if isinstance(data, list) else steps
    for step in steps:
        for place, found in _mappings(value_at(data, (step,)), where[1:]):
            yield (step, *place), found


def value_at(data: Any, key: Key) -> Any:
    """What stands at a key; None where nothing does."""
    for step in key:
        try:
            data = data[int(step) if isinstance(data, list) else step]
        except (LookupError, TypeError, ValueError):
            return None
    return data
