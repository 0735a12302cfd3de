"""Elements of an XML text, one per line, with attributes escaped and numbers in full."""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def numbers(values: ArrayLike) -> str:
    """Numbers with nine digits, blank between; -0 is written as 0."""
    return " ".join(f"{value + 0.0:.9g}" for value in np.ravel(values).tolist())


def quoted(text: str) -> str:
    """Text as a quoted attribute value; characters that XML forbids become U+FFFD."""
    return quoteattr(_NOT_XML.sub("\ufffd", text))


def element(tag: str, children: Iterable[str] = (), **attributes: str | float | ArrayLike) -> str:
    """One element with its children indented below it.

    A trailing underscore of an attribute's name is dropped, so that `class_` is `class`.
    """
    texts = (f" {name.rstrip('_')}={quoted(_text(value))}" for name, value in attributes.items())
    head = f"<{tag}{''.join(texts)}"
    body = "\n".join(children)
    if not body:
        return f"{head}/>"
    return f"{head}>\n  {body.replace(chr(10), chr(10) + '  ')}\n</{tag}>"


def _text(value: str | float | ArrayLike) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    return numbers(value)
