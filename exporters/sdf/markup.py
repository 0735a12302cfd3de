"""XML as indented lines of text: small, fast, and the same bytes for the same content."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

Lines = list[str]


def element(tag: str, /, *content: str | Lines, **attributes: str) -> Lines:
    """An element: of text, if its only content is a string, or of the given child elements."""
    opening = "".join([tag, *(f" {key}={quoteattr(text)}" for key, text in attributes.items())])
    if not content:
        return [f"<{opening}/>"]
    if len(content) == 1 and isinstance(content[0], str):
        return [f"<{opening}>{escape(_allowed(content[0]))}</{tag}>"]
    return [f"<{opening}>", *("  " + line for child in content for line in child), f"</{tag}>"]


def leaves(**contents: str | float | Iterable[float]) -> list[Lines]:
    """Elements of text or numbers, one for each keyword."""
    lines = []
    for tag, content in contents.items():
        if not isinstance(content, str):
            content = numbers([content] if isinstance(content, int | float) else content)
        lines.append(element(tag, content))
    return lines


def _allowed(text: str) -> str:
    """The text without the control characters that XML cannot hold."""
    return text if text.isprintable() else "".join(filter(str.isprintable, text))


def world_name(name: str) -> str:
    """The name of a `<world>`: SDF keeps `world` for itself."""
    return "the_world" if name == "world" else name


def numbers(values: Iterable[float]) -> str:
    """Numbers in nine significant digits, which hold a float32 exactly, separated by blanks."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def figures(values: Iterable[float]) -> str:
    """Numbers in twelve significant digits, separated by blanks."""
    return " ".join(f"{value + 0.0:.12g}" for value in values)


def write_document(path: Path, version: str, *content: Lines) -> None:
    """Write an SDF file whose root is `<sdf version="…">`."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', *element("sdf", *content, version=version)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
