"""Figures that are files: the same whatever style a user has for theirs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

_drawing = RLock()
"""Settings of matplotlib are those of the whole process."""


@contextmanager
def own_style() -> Iterator[None]:
    """Draw with matplotlib's own settings; those of matplotlibrc and the caller are back then."""
    from matplotlib import style

    with _drawing, style.context("default"):
        yield
