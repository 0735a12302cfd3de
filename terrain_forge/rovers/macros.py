"""Expanding a xacro as the package `xacro` does, without its Python (docs/rovers.md).

http://wiki.ros.org/xacro; expressions are arithmetic on a checked syntax tree, files come from the
rover's own folders, the environment is never read, and nothing grows without end.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from terrain_forge.base import TerrainForgeError
from terrain_forge.rovers.bounds import FileError, read_xml
from terrain_forge.rovers.expressions import FAULTS, Scope, Value, truth
from terrain_forge.rovers.packages import Packages
from terrain_forge.rovers.substitution import Substitution

_PREFIX = "xacro:"
_DEEPEST = 250
"""Macros within macros: how often a loop that calls itself may run."""
_NESTED = 2000
"""Elements, macros and files within each other."""
_PARAMETER = re.compile(
    r"""\s*([^\s:=]+)(\s*:?=\s*(\^\|?)?((?:\$\{[^}]*\}|\$\([^)]*\)|'[^']*'|"[^"]*"|"""
    r"""(?!\$[{(])[^\s'"])*))?(?:\s+|$)"""
)


def expand_xacro(
    file: Path, packages: Packages, *, names: Mapping[str, Value] | None = None
) -> tuple[Element, tuple[Path, ...]]:
    """The `<robot>` of a file without xacro's elements, and the files that it includes.

    Args:
        file: A xacro file.
        packages: Which files it may include.
        names: Values that its expressions may use.

    Raises:
        DataError: for a file that is not right, or that only Python could expand.
    """
    return _Expansion(packages).run(file, Scope(values=names))


def expand_trusted(file: Path, packages: Packages) -> tuple[bytes, tuple[Path, ...]]:
    """The URDF text of a xacro file, and the files that it includes.

    Raises:
        DataError: if the package `xacro` is not installed, or the file is not right.
    """
    try:
        import xacro
        from xacro import substitution_args
    except ImportError:
        raise FileError(
            f"{file.name} with `trust: true` needs the package xacro: "
            "pip install 'terrain-forge[xacro]'"
        ) from None
    original = substitution_args._eval_find
    xacro.all_includes.clear()
    try:  # $(find PACKAGE) asks us, where it would ask an installed ROS
        substitution_args._eval_find = lambda package: str(packages.folder(package))
        with redirect_stderr(StringIO()), redirect_stdout(StringIO()):
            text = str(xacro.process_file(str(file)).toxml())
    except TerrainForgeError:
        raise
    except Exception as error:  # xacro evaluates Python: whatever the file's expressions raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise FileError(f"{file.name}: xacro cannot expand it: {why}") from None
    finally:
        substitution_args._eval_find = original
    return text.encode(), tuple(dict.fromkeys(map(Path, xacro.all_includes)))


@dataclass(frozen=True)
class _Macro:
    """A macro: what it consists of, and its parameters with their defaults."""

    body: Element
    parameters: dict[str, tuple[bool, str] | None]
    """By name; whether the caller's value of that name is forwarded, and the text that is taken
    otherwise. None for a parameter that must be given."""


@dataclass(frozen=True, slots=True)
class _Frame:
    """Nodes that are being expanded, and where to."""

    nodes: Iterator[Element | str]
    made: Element
    texts: list[str]
    names: Scope
    macros: Scope
    file: Path
    whole: bool = False
    """Whether the nodes are those of an element that is kept."""
    then: Callable[[], None] | None = None
    """What is done after the last node."""


class _Expansion:
    """Expands node after node, those within others by a stack of our own: none is too deep."""

    def __init__(self, packages: Packages) -> None:
        self._packages = packages
        self._texts = Substitution(packages)
        self._budget = self._texts.budget
        self._stack: list[_Frame] = []
        self._files: list[Path] = []
        self._parsed: dict[Path, Element] = {}
        self._open: list[Path] = []
        self._calls = 0
        self._known = {
            "property": self._property, "macro": self._macro, "include": self._include,
            "if": self._condition, "unless": self._condition, "arg": self._arg,
            "insert_block": self._insert, "element": self._element, "attribute": self._attribute,
            "call": self._dynamic_call,
        }  # fmt: skip

    def run(self, file: Path, names: Scope) -> tuple[Element, tuple[Path, ...]]:
        """The expanded root, and the files that were included."""
        holder = Element("")
        self._open = [file.resolve()]
        frame = _Frame(iter([self._parse(file, file.name)]), holder, [], names, Scope(), file)
        self._stack = [frame]
        try:
            while self._stack:
                frame = self._stack[-1]
                self._texts.file = frame.file
                node = next(frame.nodes, None)
                if node is None:
                    self._stack.pop()
                    if frame.then:
                        frame.then()
                else:
                    self._budget.spend("elements")
                    self._expand(node, frame)
        except FAULTS as error:
            raise FileError(f"{frame.file.name}: {error}") from None
        if len(holder) != 1:
            raise FileError(f"{file.name} expands to nothing")
        return holder[0], (*self._files, *self._texts.files)

    def _parse(self, file: Path, name: str) -> Element:
        if file not in self._parsed:
            self._parsed[file] = read_xml(file, name)
        return self._parsed[file]

    def _push(self, frame: _Frame, nodes: Iterator[Element | str], **changes: Any) -> None:
        """Expand nodes next, to where a frame's are unless told otherwise."""
        if len(self._stack) > _NESTED:
            raise ValueError(f"elements and macros nest more than {_NESTED} deep")
        self._stack.append(replace(frame, **{"whole": False, "then": None, **changes}, nodes=nodes))

    def _text(self, node: Element, name: str, frame: _Frame) -> str:
        return self._texts.text(_attribute(node, name), frame.names)

    def _true(self, text: str, frame: _Frame) -> bool:
        return truth(self._texts.value(text, frame.names))

    def _expand(self, node: Element | str, frame: _Frame) -> None:
        if isinstance(node, str):
            frame.texts.append(self._texts.text(node, frame.names))
        elif not node.tag.startswith(_PREFIX):
            self._keep(node, frame)
        elif (tag := node.tag.removeprefix(_PREFIX)) in self._known:
            self._known[tag](node, frame)
        else:
            self._call(tag, node, frame)

    def _keep(self, node: Element, frame: _Frame) -> None:
        own = {
            name: self._texts.text(text, frame.names)
            for name, text in node.attrib.items()
            if not name.startswith((_PREFIX, "xmlns"))
        }
        made, texts = Element(node.tag, own), list[str]()
        frame.made.append(made)

        def finish() -> None:
            made.text = "".join(texts) or None

        self._push(frame, _nodes(node), made=made, texts=texts, whole=True, then=finish)

    def _property(self, node: Element, frame: _Frame) -> None:
        names, scope = frame.names, node.get("scope", "")
        name = self._text(node, "name", frame)
        if not name.isidentifier() or keyword.iskeyword(name) or name.startswith("__"):
            raise ValueError(f"{name[:80]!r} is no name of a property")
        if self._true(node.get("remove", "false"), frame):
            names.remove(name)
            return
        if "default" in node.attrib and name in names:
            return
        value = node.get("default", node.get("value"))
        target = {"global": names.top, "parent": names.caller}.get(scope, names)
        if target is None:  # nothing is above the file's own scope
            return
        if value is None:
            target.set(f"**{name}", node)
        elif self._true(node.get("lazy_eval", "true"), frame) and scope not in ("global", "parent"):
            target.set(name, value, lazy=self._texts.value)
        else:
            target.set(name, self._texts.value(value, names))

    def _arg(self, node: Element, frame: _Frame) -> None:
        default = self._text(node, "default", frame)
        self._texts.arguments.setdefault(_attribute(node, "name"), default)

    def _condition(self, node: Element, frame: _Frame) -> None:
        if self._true(_attribute(node, "value"), frame) == (node.tag == "xacro:if"):
            self._push(frame, _nodes(node))

    def _element(self, node: Element, frame: _Frame) -> None:
        name = self._text(node, "xacro:name", frame)
        if not name:
            raise ValueError("<xacro:element> has an empty name")
        self._expand(_renamed(node, name, "xacro:name"), frame)

    def _attribute(self, node: Element, frame: _Frame) -> None:
        name, value = (self._text(node, key, frame) for key in ("name", "value"))
        if frame.whole:  # the package too drops those within a condition or a macro
            frame.made.set(name, value)

    def _insert(self, node: Element, frame: _Frame) -> None:
        name = _attribute(node, "name")
        if f"**{name}" in frame.names:
            self._push(frame, _nodes(frame.names[f"**{name}"]))
        elif f"*{name}" in frame.names:
            self._keep(frame.names[f"*{name}"], frame)
        else:
            raise ValueError(f"there is no block {name[:80]!r}")

    def _include(self, node: Element, frame: _Frame) -> None:
        told = self._text(node, "filename", frame)
        optional = truth(node.get("optional", "false"))
        names, macros = frame.names, frame.macros
        if space := self._texts.text(node.get("ns", ""), names):
            inner = Scope(names, namespace=True), Scope(namespace=True)
            names.set(space, inner[0])
            macros.set(space, inner[1])
            names, macros = inner
        for file in reversed(self._packages.found(told, frame.file.parent)):
            if not optional or file.exists():
                nodes = self._included(file, told[:200])
                self._push(frame, nodes, names=names, macros=macros, file=file)

    def _included(self, file: Path, name: str) -> Iterator[Element | str]:
        whole = file.resolve()
        if whole in self._open:
            raise ValueError(f"{name!r} includes itself")
        root = self._parse(file, name)
        self._budget.spend("characters", file.stat().st_size)
        self._files.append(file)
        self._open.append(whole)
        yield from _nodes(root)
        self._open.remove(whole)

    def _macro(self, node: Element, frame: _Frame) -> None:
        name = _attribute(node, "name").removeprefix(_PREFIX)
        if name == "call" or "." in name:
            raise ValueError(f"{name[:80]!r} is no name of a macro")
        rest, parameters = node.get("params", "").strip(), dict[str, tuple[bool, str] | None]()
        while rest:
            found = _PARAMETER.match(rest)
            if not found:
                raise ValueError(f"macro {name[:80]!r}: params {rest[:80]!r} cannot be read")
            forward, default = bool(found[3]), found[4] or ""
            parameters[found[1]] = (forward, default) if forward or default else None
            rest = rest[found.end() :]
        frame.macros.set(name, _Macro(node, parameters))

    def _dynamic_call(self, node: Element, frame: _Frame) -> None:
        name = self._text(node, "macro", frame)
        self._call(name, _renamed(node, f"xacro:{name}", "macro"), frame)

    def _call(self, tag: str, node: Element, frame: _Frame) -> None:
        """Expand the blocks of a call where it stands, then its macro with them."""
        self._budget.spend("elements", 3)  # its scopes cost as much
        macro, names, macros = _find_macro(tag, frame)
        own = Scope(names)
        for name, text in node.attrib.items():
            if name not in macro.parameters:
                raise ValueError(f"<xacro:{tag[:80]}> has no parameter {name[:80]!r}")
            own.set(name, self._texts.value(text, frame.names))
        blocks = Element("")

        def begin() -> None:
            given = list(blocks)
            for name, told in macro.parameters.items():
                if name not in node.attrib:
                    own.set(name, self._untold(tag, name, told, given, frame))
            if given:
                raise ValueError(f"<xacro:{tag[:80]}> has no use for <{given[0].tag[:80]}>")
            self._calls += 1
            if self._calls > _DEEPEST:
                raise ValueError(f"macros call each other more than {_DEEPEST} deep")
            self._push(frame, _nodes(macro.body), names=own, macros=Scope(macros), then=end)

        def end() -> None:
            self._calls -= 1

        if len(node):
            self._push(frame, _nodes(node), made=blocks, texts=[], then=begin)
        else:
            begin()

    def _untold(
        self,
        tag: str,
        name: str,
        told: tuple[bool, str] | None,
        blocks: list[Element],
        frame: _Frame,
    ) -> Value:
        """A parameter that is no attribute of a call: its next block, or a default."""
        if name.startswith("*"):
            if not blocks:
                raise ValueError(f"<xacro:{tag[:80]}> lacks the block {name[:80]!r}")
            return blocks.pop(0)
        if told is None:
            raise ValueError(f"<xacro:{tag[:80]}> lacks {name[:80]!r}")
        forward, default = told
        if forward and name in frame.names:
            return frame.names[name]
        if forward and not default:
            raise ValueError(f"<xacro:{tag[:80]}> lacks {name[:80]!r}, and so does its caller")
        return self._texts.value(default, frame.names)


def _find_macro(tag: str, frame: _Frame) -> tuple[_Macro, Scope, Scope]:
    """A macro, and the scopes that it is expanded in; `arm.link` is one of a namespace."""
    names, macros = frame.names, frame.macros
    *spaces, name = tag.split(".")
    for space in spaces:
        if space not in names or space not in macros:
            raise ValueError(f"<xacro:{tag[:80]}>: there is no namespace {space[:80]!r}")
        names, macros = names[space], macros[space]
    macro = macros[name] if name in macros else None
    if not isinstance(macro, _Macro):
        raise ValueError(f"<xacro:{tag[:80]}>: there is no macro of that name")
    return macro, names, macros


def _attribute(element: Element, name: str) -> str:
    """An attribute that an element must have."""
    if name not in element.attrib:
        raise ValueError(f"<{element.tag[:80]}> lacks {name!r}")
    return element.attrib[name]


def _renamed(element: Element, tag: str, without: str) -> Element:
    """A copy with another tag, without the attribute that tells it."""
    copy = Element(tag, {k: v for k, v in element.attrib.items() if k != without})
    copy.text = element.text
    copy.extend(element)
    return copy


def _nodes(element: Element) -> Iterator[Element | str]:
    """Texts and elements within an element; blanks between them are dropped."""
    if element.text and not element.text.isspace():
        yield element.text
    for child in element:
        yield child
        if child.tail and not child.tail.isspace():
            yield child.tail
