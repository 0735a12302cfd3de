"""Names for files, scene elements and figures, made from names that people chose, and of rocks."""

from __future__ import annotations

import re
import unicodedata
from functools import cache
from zlib import crc32

ROCK = "rock_"
"""What the name of a rock begins with; its id follows."""


def file_name(text: str) -> str:
    """A name of ASCII letters, digits, underscores and hyphens for files, URIs, XML and models."""
    return _plain(text, "A-Za-z0-9_-")


def identifier(text: str) -> str:
    """A name of ASCII letters, digits and underscores, as scene graphs and ROS want it."""
    return _plain(text, "A-Za-z0-9_")


def rock_name(identity: int) -> str:
    """What a rock is called in every format."""
    return f"{ROCK}{identity}"


def figure_text(name: str) -> str:
    """A name as text of a matplotlib figure.

    The font that comes with matplotlib has no letters of Chinese and others; a name with any that
    it lacks is written as files of that name are, on every machine alike.
    """
    shown = name if set(map(ord, name)) <= _known() else file_name(name)
    hidden = " " * shown.startswith("_")  # legends leave out what begins with "_"
    return hidden + shown.replace("$", r"\$")  # a pair of dollars would be a formula


def _plain(text: str, allowed: str) -> str:
    """The text in the allowed signs, beginning with a letter; different texts stay different.

    Accents are dropped and other signs become underscores; a name that had to be changed ends in a
    checksum of the original, so that no two names become one.
    """
    ascii_text = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    name = re.sub(f"[^{allowed}]+", "_", ascii_text).strip("_-")
    if not name[:1].isalpha():
        name = f"world_{name}".rstrip("_")
    return name if name == text else f"{name}_{crc32(text.encode()):08x}"


@cache
def _known() -> frozenset[int]:
    """Code points that the figures' font has."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    return frozenset(get_font(findfont(FontProperties())).get_charmap())
