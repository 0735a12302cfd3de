"""The part of xacro that needs no Python: properties, conditions, macros and `${…}`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from terrain_forge.base import DataError
from terrain_forge.rovers.expressions import Value, read_value, substitute
from terrain_forge.rovers.urdf import parse_xml

_KEY = ("rover",)
_DEEPEST = 30
"""Macros within macros."""


def read_macros(file: Path, names: Mapping[str, Value], *, library: Path) -> Element:
    """The `<robot>` of a file, without xacro's elements.

    Known are `property`, `if`, `unless`, `macro`, and `include` of a file beside it.

    Args:
        file: A xacro or URDF file.
        names: Values that its expressions may use.
        library: Folder of what it may include, where that is not beside it.

    Raises:
        DataError: for another element of xacro, or an expression that is more than arithmetic.
    """
    try:
        (made,) = _Expansion((file.parent, library)).expand(_parse(file), dict(names))
    except (OSError, ValueError, KeyError) as error:
        raise DataError(f"{file.name}: {error}", key=_KEY) from None
    return made


def _parse(file: Path) -> Element:
    return parse_xml(file.read_text(encoding="utf-8"), file.name)


class _Expansion:
    """Knows the macros that were defined so far."""

    def __init__(self, folders: tuple[Path, ...]) -> None:
        self._folders = folders
        self._macros: dict[str, Element] = {}
        self._depth = 0

    def expand(self, element: Element, names: dict[str, Value]) -> list[Element]:
        """What an element becomes; properties are added to the names."""
        space, _, tag = element.tag.rpartition("}")
        if not space:
            own = {key: _text(substitute(text, names)) for key, text in element.attrib.items()}
            made = Element(tag, own)
            made.text = element.text and _text(substitute(element.text, names))
            made.extend(self._children(element, names))
            return [made]
        if tag == "property":
            names[element.attrib["name"]] = read_value(element.attrib["value"], names)
            return []
        if tag in ("if", "unless"):
            told = read_value(element.attrib["value"], names)
            return self._children(element, names) if bool(told) == (tag == "if") else []
        if tag == "include":
            files = [folder / element.attrib["filename"] for folder in self._folders]
            file = next((file for file in files if file.is_file()), files[0])
            return self._children(_parse(file), names)
        if tag == "macro":
            self._macros[element.attrib["name"]] = element
            return []
        if tag in self._macros:
            return self._call(self._macros[tag], element, names)
        raise ValueError(f"<xacro:{tag}>: it is no property, if, unless, include, macro or call")

    def _children(self, element: Element, names: dict[str, Value]) -> list[Element]:
        return [made for child in element for made in self.expand(child, names)]

    def _call(self, macro: Element, call: Element, names: dict[str, Value]) -> list[Element]:
        inner = dict(names)
        for parameter in macro.get("params", "").split():
            name, has_default, default = parameter.partition(":=")
            if name not in call.attrib and not has_default:
                raise ValueError(f"<{call.tag.rpartition('}')[2]}> lacks {name!r}")
            inner[name] = read_value(call.get(name, default), names)
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ValueError(f"macros call each other more than {_DEEPEST} deep")
        made = self._children(macro, inner)
        self._depth -= 1
        return made


def _text(value: Value) -> str:
    return " ".join(map(repr, value)) if isinstance(value, tuple) else str(value)
