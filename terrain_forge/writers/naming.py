"""Names for files and scene elements, made from names that people chose."""

from __future__ import annotations

import re
import unicodedata
from zlib import crc32


def file_name(text: str) -> str:
    """A name of ASCII letters, digits, underscores and hyphens for files, URIs, XML and models."""
    return _plain(text, "A-Za-z0-9_-")


def identifier(text: str) -> str:
    """A name of ASCII letters, digits and underscores, as scene graphs and ROS want it."""
    return _plain(text, "A-Za-z0-9_")


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
