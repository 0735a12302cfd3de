"""Lines on the terminal: what a file's name or content would do to it is escaped."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any

import click

from terrain_forge.base import RecipeWarning

_LONGEST = 2000
"""Characters of a line that is shown."""
_NOISY = "numba", "rasterio", "matplotlib", "PIL", "trimesh"
"""Libraries whose log is for their developers."""


def say(text: str, *, err: bool = False) -> None:
    """Show one line."""
    click.echo(_plain(text), file=sys.stderr if err else sys.stdout)  # a progress bar's, if there


def word(path: Path | str) -> str:
    """A path as a word of a command line; one that begins with a dash is no option in it."""
    text = click.format_filename(path)
    return quote(f"./{text}" if text.startswith("-") else text)


def time_text(seconds: float) -> str:
    """A time for people, such as `4.2 s` or `3 min 05 s`."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02} s" if minutes else f"{rest} s"


def show_log(*, debug: bool) -> None:
    """Show warnings, and with `debug` the whole log, as lines on the error stream."""
    told = _Told()
    told.setFormatter(logging.Formatter("%(levelname)s: %(message)s"))
    logging.basicConfig(level=logging.DEBUG if debug else logging.WARNING, handlers=[told])
    for noisy in _NOISY:
        logging.getLogger(noisy).setLevel(logging.WARNING if debug else logging.CRITICAL)
    os.environ.setdefault("CPL_LOG", os.devnull)  # GDAL's own lines about broken files
    warnings.showwarning = partial(_show_warning, others=debug)


class _Told(logging.Handler):
    """Shows each record as a line, above a progress bar where there is one."""

    def emit(self, record: logging.LogRecord) -> None:
        """Show it; what cannot be shown must not stop the work."""
        try:
            say(self.format(record), err=True)
        except OSError:
            self.handleError(record)


def _plain(text: str) -> str:
    if len(text) > 2 * _LONGEST:  # before it is escaped, for the time that takes
        text = f"{text[:_LONGEST]} … {text[-_LONGEST:]}"
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 2 :]}"
    return text


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    *_: Any,
    others: bool = False,
) -> None:
    """Show a warning about a recipe as one line; those of other libraries are for developers."""
    if issubclass(category, RecipeWarning):
        say(f"terrain-forge: {message}", err=True)
    elif others:
        say(warnings.formatwarning(message, category, filename, lineno).strip(), err=True)
