"""The terms of the page: explained where they stand, and listed at its end for paper and phones."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

from markupsafe import Markup, escape

_SHORT = 2
"""Letters of a symbol, which is a word's part or a name everywhere but alone or before a figure."""


@cache
def _terms() -> dict[str, str]:
    """What each term means, by its spellings parted by `|`."""
    path = Path(__file__).parent / "bundle" / "glossary.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


@cache
def _spellings() -> tuple[dict[str, str], re.Pattern[str]]:
    """What each spelling means, and what finds them all in escaped text, the longest first."""
    meanings = {name: said for names, said in _terms().items() for name in names.split("|")}
    ordered = sorted(meanings, key=len, reverse=True)
    symbols = "|".join(re.escape(name) for name in ordered if len(name) <= _SHORT)
    words = "|".join(re.escape(name) for name in ordered if len(name) > _SHORT)
    alone = rf"\A(?:{symbols})\Z|(?<!\w)(?:{symbols})(?= (?:[=≥\[]|\d))"
    pattern = re.compile(rf"(?<!\w)(?i:{words})(?!\w)|{alone}")
    return {
        name if len(name) <= _SHORT else name.lower(): m for name, m in meanings.items()
    }, pattern


def explained(text: str) -> Markup:
    """The text, escaped, with what a term means on each one: under the mouse, or where touched."""
    meanings, pattern = _spellings()

    def mark(found: re.Match[str]) -> str:
        word = found[0]
        meaning = escape(meanings[word if len(word) <= _SHORT else word.lower()])
        return f'<abbr title="{meaning}" tabindex="-1">{word}</abbr>'

    return Markup(pattern.sub(mark, str(escape(text))))


def explained_in(page: str) -> list[tuple[str, str]]:
    """The terms that a part of the page explains, with what they mean."""
    return [
        (names.partition("|")[0], meaning)
        for names, meaning in _terms().items()
        if f'<abbr title="{escape(meaning)}"' in page
    ]
