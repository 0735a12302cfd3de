"""The errors that a user can cause or meet; everything else is a bug in terrain-forge."""

from __future__ import annotations

import errno
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path

_PACKAGE = str(Path(__file__).parents[1])
_LONGEST = 300
"""Characters of another library's message that are shown."""

DISK_FULL = errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS
"""What the system says where a disk takes no more."""


class TerrainForgeError(Exception):
    """Base of all errors with a message meant for the user: what was found, what is allowed.

    Args:
        message: one line.
        key: where in the recipe, such as ("dtm", "source"); the recipe's file adds name and line.
    """

    def __init__(self, message: str, *, key: tuple[str | int, ...] = ()) -> None:
        super().__init__(message)
        self.key = key


class RecipeError(TerrainForgeError):
    """The recipe asks for something that does not exist or cannot be (exit status 2)."""


class DataError(TerrainForgeError):
    """An input file cannot be used as what the recipe says it is (exit status 2)."""


class OutputError(TerrainForgeError):
    """The output folder cannot be written or is not a terrain-forge world (exit status 2)."""


class StorageError(TerrainForgeError):
    """The disk is full, or the system's limits or permissions forbid a file (exit status 3)."""


class ExportError(TerrainForgeError):
    """A format cannot hold this world with these options (exit status 2)."""


class PluginError(TerrainForgeError):
    """Code of another package returned what it may not (exit status 3)."""


class SimulationError(TerrainForgeError):
    """A simulation could not be carried to an end that means anything (exit status 1)."""


class RecipeWarning(FutureWarning):
    """A recipe uses a key by its old name, or one that has no effect."""


def warn_user(message: str) -> None:
    """Warn of a recipe at the line of the first caller that is not of this package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, RecipeWarning, stacklevel=level)


@contextmanager
def reading(name: str, *, key: tuple[str | int, ...] = ()) -> Iterator[None]:
    """Turns whatever a reader raises for a broken file into one line, and drops its warnings.

    Args:
        name: The file, as the recipe writes it.
        key: Where in the recipe it is named; errors of ours that have no place get it.

    Raises:
        DataError: in place of any error that is not ours.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except DataError as error:
        error.key = error.key or key
        raise
    except TerrainForgeError:
        raise
    except Exception as error:
        why = " ".join(str(_first(error)).split()) or type(error).__name__
        raise DataError(f"{name} cannot be read: {why[:_LONGEST]}", key=key) from error


def _first(error: BaseException) -> BaseException:
    """What went wrong at first: GDAL's last error says to look at the one before."""
    while error.__cause__ is not None and str(error.__cause__):
        error = error.__cause__
    return error


def hint_at(word: str, allowed: Iterable[str], *, alike: float = 0.6) -> str:
    """The allowed word that is meant, as a question; empty where none is so much like it."""
    close = get_close_matches(str(word), list(allowed), n=1, cutoff=alike)
    return f" (did you mean {close[0]!r}?)" if close else ""
