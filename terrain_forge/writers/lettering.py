"""Names that people chose, as pictures can show them."""

from __future__ import annotations

from functools import cache

from terrain_forge.writers.naming import file_name


def figure_text(name: str) -> str:
    """A name as text of a matplotlib figure.

    The font that comes with matplotlib has no letters of Chinese and others; a name with any that
    it lacks is written as files of that name are, on every machine alike.
    """
    shown = name if set(map(ord, name)) <= _known() else file_name(name)
    return shown.replace("$", r"\$")  # a pair of dollars would be a formula


@cache
def _known() -> frozenset[int]:
    """Code points that the figures' font has."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    return frozenset(get_font(findfont(FontProperties())).get_charmap())
