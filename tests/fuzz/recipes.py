"""Recipes that nobody would write: from the JSON schema, and from the text of good ones."""

from __future__ import annotations

import copy
import json
import math
import random
from functools import cache
from pathlib import Path
from typing import Any

from terrain_forge.recipe import json_schema
from tests.fuzz import samples

NUMBERS = (
    *(0.0, -0.0, 5e-324, 1e-300, 1e-12, 1e-6, 0.0244, 0.1, 0.125, 0.5, 1.0, 2.0, 3.7, 90.0),
    *(1e3, 1e4, 1e6, 1e9, 1e13, 1e30, 1.7e308, -1e-9, -1.0, -1e6, -1e300),
)
INTEGERS = (0, 1, 2, 3, 7, 64, 1000, 10_000, 10**6, 2**31, 2**63 - 1, 2**63, 10**30, -1, -(10**9))
WORDS = (
    *("", "way", "tiny", "stones", "craters", "a b", "..", "../x", "%s", "{x}", "CON", "é" * 100),
    *("\U0001f680" * 100, "x" * 300, "x" * 100_000, "a\nb", "\x1b[31mred", "\u202e", "\x00", "nan"),
)
FILES = (
    *("missing", "/dev/zero", "/dev/null", "fifo", ".", "..", "recipe.yaml", "x" * 300, "a\nb"),
    *("/proc/self/mem", "loop", "\x1b[2J.tif", "empty", "big.bin", "/" + "x/" * 3000),
)
ODD: tuple[Any, ...] = (
    *(None, True, False, "", "0.5", "inf", [], {}, [[]], [None], {"kind": None}, {"kind": []}),
    *(math.nan, math.inf, 10**400, [1] * 5000, {"": 1}, {"kind": "x" * 5000}, "\ud800"),
)
TEXTS = (
    b"\x00", b"\xff\xfe", b"\xc3\x28", b"\t", b"\r", b"\x1b[31m", b"&a ", b"*a", b"<<: *a",
    b"!!python/object:os.system ", b"? ", b"- ", b": ", b"{", b"}", b"[", b"]", b"'",
    b'"', b"#", b"|", b">", b"%", b"@",
    b"---\n", b"...\n",
    b"\xef\xbb\xbf", b"\xe2\x80\xa8", b"9" * 5000, b"[" * 5000, b"{a: " * 3000, b"- " * 4000,
    b"1e400", b"0x10", b"0o7", b"1_000", b"1:30", b"~", b"yes", b".inf", b".nan",
    b"2001-01-01", b"=",
    b"[" + b"1, " * 100_000 + b"]", b"x" * 100_000, b"\n" * 50_000, b"\xf0\x9f\x9a\x80",
)  # fmt: skip


class Recipes:
    """Draws recipes.

    Args:
        rng: where chance comes from.
    """

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._seeds = samples.schema_recipes()
        self._texts = [text.encode() for text in samples.yaml_texts()]
        self._texts += [json.dumps(recipe).encode() for recipe in self._seeds]
        self._schema = json_schema()

    def write(self, folder: Path) -> tuple[str, ...]:
        """Write one recipe; the command that reads it."""
        if self._rng.random() < 0.25:
            data = self._mangled(self._rng.choice(self._texts))
        else:
            data = _dumped(self._drawn())
        (folder / "recipe.yaml").write_bytes(data)
        if self._rng.random() < 0.03:
            change = self._rng.choice(("name", "dtm.size_m", "rocks.populations.0", "x[0", "a=b=c"))
            return ("check", "recipe.yaml", "--set", f"{change}={self._rng.choice(WORDS[:12])}")
        return ("check", "recipe.yaml")

    def _drawn(self) -> Any:
        """A good recipe in which a few parts are others, which the schema allows or not."""
        recipe: Any = copy.deepcopy(self._rng.choice(self._seeds))
        for _ in range(self._rng.choice((1, 1, 1, 2, 3))):
            recipe = self._changed(self._schema, recipe)
        return recipe

    def _changed(self, node: Any, value: Any) -> Any:
        """A value in which one part, anywhere, is another."""
        rng, node = self._rng, self._chosen(node, value)
        inner = node.get("properties", {})
        if isinstance(value, dict) and rng.random() < 0.9:
            if rng.random() < 0.02:
                return {**value, rng.choice(WORDS): rng.choice(ODD)}
            if rng.random() < 0.02 and value:
                return {k: v for k, v in value.items() if k != rng.choice([*value])}
            given = [name for name in value if name in inner]
            name = rng.choice(given if given and rng.random() < 0.7 else [*inner, *value] or [""])
            changed = self._changed(inner.get(name, {}), value.get(name))
            return {**value, name: changed}
        if isinstance(value, list) and value and rng.random() < 0.9:
            which = rng.randrange(len(value))
            item = (node.get("prefixItems") or [node.get("items", {})] * len(value))[which:]
            return [*value[:which], self._changed(item[0] if item else {}, value[which]),
                    *value[which + 1 :]]  # fmt: skip
        return self._value(node)

    def _chosen(self, node: Any, value: Any = None) -> Any:
        """The schema of what a value is, or of any member of a union."""
        while "$ref" in node or "anyOf" in node or "oneOf" in node:
            if "$ref" in node:
                node = self._schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
                continue
            members = [m for m in node.get("anyOf", node.get("oneOf")) if m.get("type") != "null"]
            kind = value.get("kind", "spline") if isinstance(value, dict) else None
            meant = [m for m in members if kind is not None and self._is_kind(m, kind)]
            node = self._rng.choice(meant or members)
        return node

    def _is_kind(self, member: Any, kind: Any) -> bool:
        found = self._chosen(member).get("properties", {}).get("kind", {})
        return kind == found.get("const") or kind in found.get("enum", ())

    def _value(self, node: Any, depth: int = 0) -> Any:
        """A value of a schema, often at its limits; now and then one that it does not allow."""
        rng = self._rng
        if rng.random() < 0.08 or depth > 6:
            return rng.choice(ODD)
        node = self._chosen(node)
        if "const" in node:
            return node["const"]
        if "enum" in node:
            return rng.choice(node["enum"])
        match node.get("type"):
            case "number" | "integer" as kind:
                return self._number(node, whole=kind == "integer")
            case "boolean":
                return rng.random() < 0.5
            case "string":
                return rng.choice(WORDS if node.get("maxLength") else (*WORDS, *FILES))
            case "array":
                items = node.get("prefixItems")
                if items is None:
                    least = node.get("minItems", 0)
                    count = rng.choice((least, least, least + 1, least + 2, 2, 30))
                    items = [node.get("items", {})] * count
                return [self._value(item, depth + 1) for item in items]
            case "object":
                inner, must = node.get("properties", {}), node.get("required", ())
                return {
                    name: self._value(inner[name], depth + 1)
                    for name in inner
                    if name in must or name == "kind" or rng.random() < 0.25
                }
        return rng.choice(ODD)

    def _number(self, node: Any, *, whole: bool) -> float:
        rng = self._rng
        low = node.get("minimum", node.get("exclusiveMinimum", -math.inf))
        high = node.get("maximum", node.get("exclusiveMaximum", math.inf))
        numbers: list[float] = [n for n in (INTEGERS if whole else NUMBERS) if low <= n <= high]
        numbers += [n for n in (low, high) if math.isfinite(n)] * 3
        if not whole:
            numbers += [10 ** rng.uniform(-4, 4), rng.uniform(-3, 3)] * 3
            numbers += [math.nextafter(low, math.inf), math.nextafter(high, -math.inf)]
        return rng.choice([n for n in numbers if math.isfinite(n)])

    def _mangled(self, text: bytes) -> bytes:
        """A recipe's text with a few pieces put in, cut out, doubled or exchanged."""
        rng, data = self._rng, bytearray(text)
        for _ in range(rng.choice((1, 1, 2, 4))):
            at = rng.randrange(len(data) + 1)
            end = min(at + rng.choice((1, 2, 8, 40)), len(data))
            match rng.randrange(6):
                case 0:
                    data[at:at] = rng.choice(TEXTS)
                case 1:
                    data[at:end] = b""
                case 2:
                    data[at:end] = rng.choice(TEXTS)
                case 3:
                    data[at:at] = data[at:end] * rng.choice((1, 2, 50))
                case 4:
                    data[at : at + 1] = bytes([rng.randrange(256)])
                case 5:
                    words = bytes(data).split(b" ")
                    words[rng.randrange(len(words))] = json.dumps(rng.choice(NUMBERS)).encode()
                    data = bytearray(b" ".join(words))
        return bytes(data)


@cache
def _names() -> dict[str, str]:
    return {"NaN": ".nan", "Infinity": ".inf"}


def _dumped(recipe: Any) -> bytes:
    """A recipe as YAML's flow style, in which everything that JSON holds can be said."""
    text = json.dumps(recipe, ensure_ascii=True)
    for name, plain in _names().items():
        text = text.replace(f" {name}", f" {plain}").replace(f" -{name}", f" -{plain}")
    return text.encode()


def put_traps(folder: Path) -> None:
    """Files that do not end, and such that are none."""
    import os

    os.mkfifo(folder / "fifo")
    (folder / "loop").symlink_to("loop")
    (folder / "empty").touch()
    with (folder / "big.bin").open("wb") as file:
        file.truncate(5 * 2**30)
