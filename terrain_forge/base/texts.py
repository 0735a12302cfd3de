"""Texts of users' files: what is one, and what is a number."""

from __future__ import annotations


def is_text(text: str) -> bool:
    """Whether UTF-8 can hold a text: it has no halves of UTF-16's characters, U+D800 to U+DFFF."""
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


def plain_number(text: str) -> float:
    """The number of a text: not as Python's `1_0`, nor in digits of other scripts.

    Raises:
        ValueError: if it is none.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"no number: {text!r}")
    return float(text)
