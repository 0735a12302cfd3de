"""What pydantic refuses, in our words: where, what was found, what is allowed."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from terrain_forge.base.arrays import Key
from terrain_forge.base.errors import hint_at

if TYPE_CHECKING:
    from pydantic import TypeAdapter, ValidationError

_SHAPES = ("tuple[", "dict[")
_NO_SHAPE = ("tuple_type", "dict_type", "list_type", "model_type", "dataclass_type")
"""What pydantic calls what is neither a list nor a mapping."""
_MISSING = ("missing", "missing_argument", "missing_keyword_only_argument")
_UNION = (*_SHAPES, "literal[", "function-")
"""How pydantic begins the names of nameless union members in a location."""
_LONGEST = 60
"""Characters of a value that are shown."""
_DEPTH = 3
"""Mappings within mappings in which a misplaced key is sought, and the most places to name."""


class Complaint(NamedTuple):
    """The first thing that is wrong with some data."""

    key: Key
    """Where it stands."""
    words: str
    """What was found, what is allowed."""
    more: int
    """How many other keys are wrong."""

    def __str__(self) -> str:
        place = f"{dotted(self.key)}: " if self.key else ""
        return f"{place}{self.words}{self.rest}"

    @property
    def rest(self) -> str:
        """That more is wrong, in brackets; empty if it is not."""
        return f" (and {self.more} more error{'s' * (self.more > 1)})" if self.more else ""


def complaint(error: ValidationError, adapter: TypeAdapter[Any], data: Any) -> Complaint:
    """What is wrong with data that pydantic refused, and where.

    Args:
        error: What it raised.
        adapter: What the data should have been.
        data: The data, mappings and lists as JSON has them.
    """
    # A misspelt key is also a missing one: the misspelling is what helps.
    unknown = "unexpected_keyword_argument"
    first, *rest = sorted(_meant(error.errors()), key=lambda e: e["type"] != unknown)
    key = _real_key(data, first["loc"])
    there = [error for error in rest if _real_key(data, error["loc"]) == key]
    if first["type"] == unknown:
        words = _unknown_key(adapter.json_schema(), first["loc"])
    elif first["type"] == "tuple_type" and not there:
        words = _no_list(adapter.json_schema(), first)
    else:
        words = _either([_words(error, key) for error in (first, *there)])
    others = [error for error in rest if key[: len(at := _real_key(data, error["loc"]))] != at]
    if first["type"] in _MISSING:
        beside = [e for e in others if e["type"] in _MISSING and e["loc"][:-1] == first["loc"][:-1]]
        words += _named_too([str(error["loc"][-1]) for error in beside])
        others = [error for error in others if error not in beside]
    return Complaint(key, words, len(others))


def _named_too(names: list[str]) -> str:
    """That other keys of a mapping are missing too."""
    if len(names) < 2:
        return "".join(f", and so is {name}" for name in names)
    return f", and so are {', '.join(names[:-1])} and {names[-1]}"


def dotted(key: Key) -> str:
    """A key as users read it: `rocks.populations[0].name`."""
    return "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in key).lstrip(".")


def _either(messages: list[str]) -> str:
    """What one value may be where it may be of several types, each of which says so."""
    wanted = [message.partition(", found ")[0].removeprefix("must be ") for message in messages]
    if len(wanted) < 2 or not all(message.startswith("must be ") for message in messages):
        return messages[0]
    found = messages[0].partition(", found ")[2]
    return f"must be {' or '.join(dict.fromkeys(wanted))}, found {found}"


def _meant(errors: list[Any], start: int = 1) -> list[Any]:
    """The errors without those of union members that the user did not mean.

    `exports` and `sensors` may be a list or a mapping; pydantic reports what is wrong with both.
    Of their locations only what comes from step `start` on is looked at.
    """
    unions: set[tuple[str | int, ...]] = set()
    for error in errors:
        shapes = (n for n, step in enumerate(error["loc"]) if str(step).startswith(_SHAPES))
        unions.update(error["loc"][:n] for n in shapes if n >= start)
    alike: dict[Any, list[Any]] = {}
    for number, error in enumerate(errors):
        outermost = (error["loc"][:n] for n in range(start, len(error["loc"]) + 1))
        key = next((part for part in outermost if part in unions), number)
        alike.setdefault(key, []).append(error)
    found = []
    for key, there in alike.items():
        if isinstance(key, int):
            found += there
            continue
        inside = [error for error in there if len(error["loc"]) > len(key) + 1]
        found += _meant(inside, len(key) + 1) or _whole(there, key)
    return found


def _whole(errors: list[Any], key: tuple[str | int, ...]) -> list[Any]:
    """What is wrong with a value of no member of a union; with a single value where one may be."""
    here = [{**error, "loc": key} for error in errors]
    single = [error for error in here if error["type"] not in _NO_SHAPE]
    return single or [{**here[0], "type": "list_or_mapping"}]


def _real_key(data: Any, loc: tuple[str | int, ...]) -> Key:
    """The key in the file: pydantic's location without the names of union members."""
    key: list[str | int] = []
    inside = False  # of a union's member, whose name is the mapping's `kind` or no key at all
    for n, step in enumerate(loc):
        last = n == len(loc) - 1
        if str(step).startswith(_UNION) or step == "[key]":
            continue
        if isinstance(data, dict) and not inside and data.get("kind") == step:
            inside = True
        elif isinstance(data, dict) and (step in data or (last and isinstance(step, str))):
            key.append(step)
            data, inside = data.get(step), False
        elif isinstance(data, dict):
            inside = True
        elif isinstance(data, list | tuple) and isinstance(step, int):
            key.append(step)
            data = data[step] if step < len(data) else None
    return tuple(key)


def _words(error: Any, key: Key) -> str:
    """What is wrong and what is allowed, of an error of pydantic's at a key."""
    found, context = error["input"], error.get("ctx", {})
    match error["type"]:
        case "list_or_mapping":
            return f"must be a list or a mapping, found {_shown(found)}"
        case "dataclass_type" | "dict_type":
            return f"must be a mapping of keys, found {_shown(found)}"
        case "union_tag_not_found" | "union_tag_invalid" if not isinstance(found, dict):
            return f"must be a mapping of keys, found {_shown(found)}"
        case "tuple_type" | "list_type":
            return f"must be a {_list_for(found)}, found {_shown(found)}"
        case "string_type" if isinstance(found, dict) and _in_list_or_mapping(error["loc"]):
            return (
                "must be a name; for options write a mapping from names to options in place of "
                f"the list, found a mapping of {', '.join(map(str, found)) or 'nothing'}"
            )
        case "path_type":
            return f"must be a path, found {_shown(found)}"
        case "too_short" if "min_length" in context:
            return f"needs at least {context['min_length']}, has {context['actual_length']}"
        case "too_long" if "max_length" in context:
            return f"takes at most {context['max_length']}, has {context['actual_length']}"
        case "string_too_short":
            return "must not be empty"
        case "string_too_long":
            return f"takes at most {context['max_length']} characters, has {len(found)}"
        case kind if kind in _MISSING:
            return "is missing"
        case "union_tag_invalid":
            kinds = context["expected_tags"]
            hint = hint_at(str(context["tag"]), [kind.strip(" '") for kind in kinds.split(",")])
            return f"unknown kind {context['tag']!r}{hint}, allowed: {kinds}"
        case "bool_type" | "bool_parsing":
            return f"must be true or false, found {_shown(found)}"
        case "literal_error":
            allowed = context["expected"]
            words = re.findall("'([^']*)'", allowed)
            hint = hint_at(found, words) if isinstance(found, str) else ""
            return f"must be {allowed}, found {_shown(found)}{hint}"
        case "union_tag_not_found":
            return "needs a `kind`"
        case "predicate_failed" if key[-1:] == ("url",):
            return (
                "must be an address that begins with http:// or https://, without spaces or a "
                f"password, found {_shown(found)}"
            )
        case "predicate_failed":
            return f"must be a name without / \\ : or a leading dot, found {_shown(found)}"
        case "unknown_preset":
            return str(error["msg"])
        case "value_error":
            why = str(error["msg"]).removeprefix("Value error, ")
            # What is wrong with a whole mapping names its keys itself.
            return why if isinstance(found, dict) else f"{why}, found {_shown(found)}"
    return f"must be {error['msg'].removeprefix('Input should be ')}, found {_shown(found)}"


def _in_list_or_mapping(loc: tuple[str | int, ...]) -> bool:
    """Whether a location is an entry of a list that may be a mapping too."""
    return len(loc) > 1 and str(loc[-2]).startswith("tuple[")


def _shown(found: Any) -> str:
    if found is None:
        return "nothing"
    text = json.dumps(found, default=str, ensure_ascii=False)
    if len(text) <= _LONGEST:
        return text
    if isinstance(found, dict):
        return f"a mapping of {', '.join(map(str, found))}"[:_LONGEST]
    if isinstance(found, list | tuple):
        return f"a list of {len(found):,}"
    return f"{text[: _LONGEST - 3]}..."


def _list_for(found: Any) -> str:
    return "tuple" if isinstance(found, list) else "list"


def _no_list(schema: dict[str, Any], error: Any) -> str:
    """What is wrong with something in place of a list, and how long that must be."""
    node = schema
    for step in error["loc"]:
        node = _descend(schema, node, step)
    whole, found = _resolve(schema, node, "array"), error["input"]
    least, most = whole.get("minItems", 0), whole.get("maxItems")
    length = f" of {least}" if least == most else ""
    return f"must be a {_list_for(found)}{length}, found {_shown(found)}"


def _unknown_key(schema: dict[str, Any], loc: tuple[str | int, ...]) -> str:
    """What is wrong with a key, and which keys the JSON Schema allows there."""
    node = schema
    for step in loc[:-1]:
        node = _descend(schema, node, step)
    name, allowed = str(loc[-1]), sorted(_resolve(schema, node).get("properties", {}))
    told = ", ".join(allowed) or "none"
    hint = hint_at(name, allowed) or _elsewhere(schema, name)
    return f"unknown key {name!r}{hint}, allowed: {told}"


def _elsewhere(schema: dict[str, Any], name: str) -> str:
    """Where a key stands that was written in another place, as a question; the outermost places."""
    places: list[tuple[Key, Any]] = [((), schema)]
    for _ in range(_DEPTH):
        inner = []
        for key, node in places:
            whole = _resolve(schema, node)
            for shape in (whole, *(_resolve(schema, one) for one in whole.get("oneOf", ()))):
                inner += [((*key, n), below) for n, below in shape.get("properties", {}).items()]
        meant = sorted({dotted(key) for key, _ in inner if key[-1] == name})
        if meant:
            return f" (is {' or '.join(meant)} meant?)" if len(meant) <= _DEPTH else ""
        places = inner
    return ""


def _resolve(schema: dict[str, Any], node: dict[str, Any], kind: str = "object") -> dict[str, Any]:
    """What a node of the schema refers to; of several shapes that of a kind, if there is one."""
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
    options = [o for o in node.get("anyOf", []) if o.get("type") != "null"]
    meant = sorted(options, key=lambda o: o.get("type", "object") != kind)
    return _resolve(schema, meant[0], kind) if meant else node


def _descend(schema: dict[str, Any], whole: dict[str, Any], step: str | int) -> dict[str, Any]:
    if isinstance(step, int):
        return dict(_resolve(schema, whole, "array").get("items", {}))
    node = _resolve(schema, whole)
    if step in node.get("properties", {}):
        return dict(node["properties"][step])
    if isinstance(more := node.get("additionalProperties"), dict):
        return more
    for option in node.get("oneOf", []):  # a step into a union is the member's kind
        member = _resolve(schema, option)
        kind = member.get("properties", {}).get("kind", {})
        if step in (kind.get("const"), kind.get("default"), member.get("title")):
            return member
    return whole
