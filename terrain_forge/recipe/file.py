"""Reading a recipe from YAML: data only, and every complaint with file, line and key."""

from __future__ import annotations

import json
import re
from copy import deepcopy
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.composer import MaxDepthExceededError
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from terrain_forge.base import (
    MAX_DEPTH,
    DataError,
    Key,
    OutputError,
    RecipeError,
    TerrainForgeError,
    checked,
    complaint,
    dotted,
    hint_at,
    is_text,
    read_text,
    resolved,
    warn_user,
    write_whole,
    yaml_reader,
)
from terrain_forge.recipe.idle import idle_keys, remove_idle
from terrain_forge.recipe.renames import current_key, numbered, rename_keys, warn_renamed
from terrain_forge.recipe.schema import Recipe, adapter

MAX_RECIPE = 2**18
"""Bytes of a recipe."""
_OCTAL = re.compile(r"[-+]?0[\d_]")
MAX_DIGITS = 400
"""Digits of a whole number in a recipe."""
_MOST_TOLD = 8
"""Elements of a list that a message names."""
_TOO_DEEP = f"mappings and lists are nested more than {MAX_DEPTH} deep"
_PLAIN_TAGS = {
    f"tag:yaml.org,2002:{n}"
    for n in ("map", "seq", "str", "int", "float", "bool", "null", "timestamp")
}


Lines = dict[Key, int | str]
"""Line of every key, from 1; of those that the command line sets, what it says."""


@dataclass(frozen=True, kw_only=True)
class RecipeFile:
    """A recipe and where its parts stand, so that later errors can name file and line."""

    path: Path
    """The file."""
    recipe: Recipe
    """What it says, validated."""
    lines: Lines
    """Where every key stands."""

    def __repr__(self) -> str:
        return f"<RecipeFile {str(self.path)!r}: {self.recipe!r}>"

    def _repr_html_(self) -> str:
        return self.recipe._repr_html_()

    @property
    def folder(self) -> Path:
        """What the recipe's paths are relative to."""
        return self.path.parent

    def locate(self, error: TerrainForgeError) -> str:
        """The error as one line with file, line and key, where it has a key."""
        return _locate(self.path, self.lines, error.key, str(error)) if error.key else str(error)


def given_recipe(
    recipe: Recipe | RecipeFile | Path | str, folder: Path | str
) -> tuple[Recipe, Path]:
    """A recipe, checked, whoever made it, and what its paths are relative to.

    Those of a file are relative to its own folder.

    Raises:
        RecipeError: if it is no recipe, or the file holds none.
    """
    if isinstance(recipe, Path | str):
        recipe = load_recipe(recipe)
    if isinstance(recipe, RecipeFile):
        return recipe.recipe.sound(), recipe.folder
    return recipe.sound(), Path(folder)


@checked
def load_recipe(
    path: Path | str,
    *,
    changes: tuple[str, ...] = (),
    mapping: tuple[dict[str, Any], Lines] | None = None,
) -> RecipeFile:
    """Read and check a recipe.

    Args:
        path: the YAML file.
        changes: `key=value` with dots for nested keys (`terrain.spacing_m=0.25`,
            `rocks.populations.0.diameter_m=[0.1, 0.4]`), values in YAML.
        mapping: what `read_mapping` read of the file, where that was done before.

    Raises:
        RecipeError: `file:line: key: what was found, what is allowed`.
    """
    path = Path(path)
    data, lines = deepcopy(mapping) if mapping else read_mapping(path)
    try:
        renamed = rename_keys(data)
    except RecipeError as error:
        raise RecipeError(_locate(path, lines, error.key, str(error))) from None
    for old, new in renamed:
        warn_renamed(f"{path}:{lines[old]}" if old in lines else str(path), old, new)
        for key in [key for key in lines if key[: len(old)] == old]:
            lines[*new, *key[len(new) :]] = lines.pop(key)
    plain = deepcopy(data) if changes else None
    for change in changes:
        key = _apply(data, change)
        if isinstance(told := lines.get(key), str) and told != f"--set {change}":
            raise RecipeError(f"{told} and --set {change}: give {dotted(key)} once")
        lines = {known: line for known, line in lines.items() if known[: len(key)] != key}
        lines[key] = f"--set {change}"
    try:
        recipe = adapter().validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        raise RecipeError(_explain(path, lines, data, error)) from None
    _tell_idle(path, recipe, data, lines, plain)
    return RecipeFile(path=path, recipe=recipe, lines=lines)


def _tell_idle(path: Path, recipe: Recipe, data: Any, lines: Lines, plain: Any) -> None:
    """Refuse keys that contradict others, and warn of others that have no effect.

    Of the file's own keys not of those that the command line leaves without one: that is what
    switching things off does.

    Args:
        path: The file.
        recipe: What was read.
        data: The plain data of that.
        lines: Where the keys stand.
        plain: What the file says without the command line; None where that adds nothing.
    """
    found = sorted(idle_keys(recipe, data), key=lambda one: not one.refused)
    if not found:
        return
    known = {one.key for one in found}
    if plain is not None:
        try:
            alone = adapter().validate_json(json.dumps(plain, default=str), strict=True)
            known = {one.key for one in idle_keys(alone, plain)}
        except ValidationError:
            known = set()
    for key, why, refused in found:
        told = _locate(path, lines, key, f"has no effect: {why}")
        if refused:
            raise RecipeError(told)
        if key in known or not told.startswith(f"{path}:"):
            warn_user(told)


@checked
def save_recipe(recipe: Recipe, path: Path | str) -> Path:
    """Write a recipe as YAML that `load_recipe` reads back equal; returns the file.

    All keys are written, defaults too but for those that have no effect. The paths in it are
    relative to the folder that it is in.

    Raises:
        OutputError: if the file cannot be written.
    """
    path = Path(path)
    yaml = YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.default_flow_style = None
    yaml.allow_unicode, yaml.width = True, 100
    text = StringIO()
    yaml.dump(remove_idle(recipe, json.loads(adapter().dump_json(recipe))), text)
    try:
        write_whole(resolved(path), text.getvalue())
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}") from None
    return path


def read_mapping(path: Path, *, what: str = "a recipe") -> tuple[dict[str, Any], Lines]:
    """The plain data of a YAML file that holds a mapping, and where its keys stand.

    Raises:
        RecipeError: `file:line: what is wrong`: tags, aliases, depth, no mapping.
    """
    try:
        text = read_text(path, str(path), most=MAX_RECIPE)
    except DataError as error:
        raise RecipeError(str(error)) from None
    lines: Lines = {}
    try:
        yaml = yaml_reader(_Constructor)
        node = yaml.compose(text)
        _collect(path, node, (), lines, set())
        data = node and yaml.constructor.construct_document(node)
    except MaxDepthExceededError as error:
        raise RecipeError(f"{path}:{error.problem_mark.line + 1}: {_TOO_DEEP}") from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        problem = " ".join(str(error.problem or error.context).split())
        problem += ": indent with spaces" * ("'\\t'" in problem)
        raise RecipeError(f"{path}{line}: not YAML: {problem}") from None
    except ReaderError as error:
        character = chr(error.character) if isinstance(error.character, int) else ""
        number = text.count("\n", 0, max(text.find(character), 0)) + 1
        raise RecipeError(f"{path}:{number}: not YAML: {error.reason}") from None
    except (YAMLError, ValueError) as error:
        raise RecipeError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict):
        raise RecipeError(f"{path}:1: {what} is a mapping of keys, found {_kind(data)}")
    return data, lines


def _collect(path: Path, node: Node, key: Key, lines: Lines, seen: set[int]) -> None:
    """Note the line of every key; refuse tags and aliases, which are more than data."""
    if node is None:
        return
    line = node.start_mark.line + 1
    lines.setdefault(key, line)
    if str(node.tag) not in _PLAIN_TAGS:
        raise RecipeError(_locate(path, lines, key, f"YAML tag {node.tag}: recipes are plain data"))
    if node.anchor is not None and id(node) not in seen:
        raise RecipeError(_locate(path, lines, key, "YAML anchor: recipes are plain data"))
    if isinstance(node, ScalarNode) and not is_text(node.value):
        message = "half of a UTF-16 character (\\ud800 to \\udfff) is no text"
        raise RecipeError(_locate(path, lines, key, message))
    if str(node.tag).endswith(":int") and _OCTAL.match(node.value):
        message = f"{node.value} may be read as octal: write it without the leading 0"
        raise RecipeError(_locate(path, lines, key, message))
    if id(node) in seen:
        raise RecipeError(_locate(path, lines, key, "YAML alias: recipes are plain data"))
    if str(node.tag).endswith(":int") and len(node.value) > MAX_DIGITS:
        message = f"a number of {len(node.value):,} digits, at most {MAX_DIGITS}"
        raise RecipeError(_locate(path, lines, key, message))
    seen.add(id(node))
    if isinstance(node, MappingNode):
        for name, value in node.value:
            plain = isinstance(name, ScalarNode) and str(name.tag) in _PLAIN_TAGS
            if not plain or not is_text(name.value):
                raise RecipeError(f"{path}:{name.start_mark.line + 1}: a key must be a word")
            inner = (*key, str(name.value))
            lines[inner] = name.start_mark.line + 1
            _collect(path, value, inner, lines, seen)
    elif isinstance(node, SequenceNode):
        for index, value in enumerate(node.value):
            _collect(path, value, (*key, index), lines, seen)


class _Constructor(SafeConstructor):
    """What makes data of YAML: a date is the text that stands there."""


_Constructor.add_constructor("tag:yaml.org,2002:timestamp", SafeConstructor.construct_yaml_str)


def _apply(data: Any, change: str) -> Key:
    """Put one `key=value` of the command line into the data; returns the key."""
    name, equals, text = change.partition("=")
    words = name.strip().replace("[", ".").replace("]", "").split(".")
    if not equals or not all(words):
        raise RecipeError(f"--set {change}: must be key=value, such as terrain.spacing_m=0.25")
    given = numbered(data, words)
    keys = current_key(data, given)
    for n, (old, new) in enumerate(zip(given, keys, strict=True)):
        if old != new:
            warn_renamed("--set", given[: n + 1], keys[: n + 1])
    value = _value(change, text)
    target: Any = data
    for n, key in enumerate(keys):
        named = isinstance(target, dict)
        if not named and not (isinstance(target, list) and key in range(len(target))):
            why = f"in the recipe: {dotted(keys[:n])} {_beside(target, str(key))}"
            raise RecipeError(f"--set {change}: there is no place {name.strip()!r} {why}")
        step = str(key) if named else key
        if n + 1 == len(keys):
            target[step] = value
        else:
            target = target.setdefault(step, {}) if named else target[step]
    try:
        renamed = rename_keys(data)  # in a value that is a mapping
    except RecipeError as error:
        raise RecipeError(f"--set {change}: {dotted(error.key)}: {error}") from None
    for old_key, new_key in renamed:
        warn_renamed("--set", old_key, new_key)
    return tuple(keys)


def _kind(found: Any) -> str:
    """What a value is, if it is no mapping."""
    told = {type(None): "nothing", str: "a text", list: "a list", bool: "true or false"}
    return told.get(type(found), "a number")


def _beside(found: Any, word: str) -> str:
    """What stands where a key leads on to a word that is not there."""
    if not isinstance(found, list):
        return f"is {_kind(found)}, which has no keys"
    names = [one.get("name", one.get("kind", "")) if isinstance(one, dict) else "" for one in found]
    told = [f"{n} ({name})" if name else str(n) for n, name in enumerate(names[:_MOST_TOLD])]
    more = f" and {len(names) - _MOST_TOLD} more" * (len(names) > _MOST_TOLD)
    return f"has {', '.join(told) or 'no elements'}{more}{hint_at(word, map(str, names))}"


def _value(change: str, text: str) -> Any:
    """The value of one `key=value` of the command line."""
    try:
        return yaml_reader(_Constructor).load(text)
    except MaxDepthExceededError:
        why = _TOO_DEEP
    except MarkedYAMLError as error:
        why = str(error.problem or error.context)
    except (YAMLError, ValueError) as error:
        why = str(error)
    raise RecipeError(f"--set {change}: the value is not YAML: {' '.join(why.split())}")


def _locate(path: Path, lines: Lines, key: Key, message: str) -> str:
    known = key
    while known and known not in lines:
        known = known[:-1]
    line, name = _set_below(lines, key) or lines.get(known, ""), dotted(key)
    place = line if isinstance(line, str) and line else f"{path}:{line}".rstrip(":")
    return f"{place}: {name}: {message}" if name else f"{place}: {message}"


def _set_below(lines: Lines, key: Key) -> int | str:
    """What the command line has set below a key that is wrong by that, as by its `kind`."""
    depths = [len(key) + 1] if key in lines else range(len(key) + 1, MAX_DEPTH)
    told = (
        line
        for known, line in lines.items()
        if isinstance(line, str) and known[: len(key)] == key and len(known) in depths
    )
    return next(told, "") if key else ""


def _explain(path: Path, lines: Lines, data: Any, error: ValidationError) -> str:
    told = complaint(error, adapter(), data)
    return _locate(path, lines, told.key, told.words) + told.rest
