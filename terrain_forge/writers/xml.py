"""XML as indented lines of text: small, fast, and the same bytes for the same content."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

Lines = list[str]
Value = str | float | tuple[float, ...] | NDArray[Any]
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def element(tag: str, /, *content: Lines | Value, digits: int = 9, **attributes: Value) -> Lines:
    """An element: of text, if its only content is no list of lines, or of child elements.

    Numbers are written in so many significant digits. A trailing underscore of an attribute's name
    is dropped, so that `class_` is `class`.
    """
    opening = tag
    for name, value in attributes.items():
        text = _NOT_XML.sub("\ufffd", _text(value, digits))
        opening += f" {name.rstrip('_')}={quoteattr(text)}"
    if not content:
        return [f"<{opening}/>"]
    if not isinstance(content[0], list):
        text = "".join(filter(str.isprintable, _text(content[0], digits)))
        return [f"<{opening}>{escape(text)}</{tag}>"]
    inside = (f"  {line}" for child in content if isinstance(child, list) for line in child)
    return [f"<{opening}>", *inside, f"</{tag}>"]


def leaves(*, digits: int = 9, **contents: Value) -> list[Lines]:
    """Elements of text or numbers, one for each keyword."""
    return [element(tag, content, digits=digits) for tag, content in contents.items()]


def numbers(values: ArrayLike, digits: int = 9) -> str:
    """Numbers in so many significant digits, nine hold a float32; blank between, -0 as 0."""
    return " ".join(f"{value + 0.0:.{digits}g}" for value in np.ravel(values).tolist())


def write_xml(path: Path, root: Lines) -> None:
    """Write a file of one element."""
    text = "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', *root]) + "\n"
    path.write_text(text, encoding="utf-8", newline="\n")


def _text(value: Value, digits: int) -> str:
    return value if isinstance(value, str) else numbers(value, digits)
