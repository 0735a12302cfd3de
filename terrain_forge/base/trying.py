"""A task, tried some times, and what comes of it as other processes can be sent it."""

from __future__ import annotations

import pickle
import traceback
from collections.abc import Callable
from typing import Any, TypeVar

from terrain_forge.base.errors import PluginError, TerrainForgeError
from terrain_forge.base.registry import FOREIGN_FAILURES, failure_words, plugin_at_fault

T = TypeVar("T")
R = TypeVar("R")


def tried(function: Callable[[T], R], item: T, tries: int) -> R | Exception:
    """What a function returns for an item, or the error of its last try."""
    for left in reversed(range(tries)):
        try:
            return function(item)
        except FOREIGN_FAILURES as error:
            if not left:
                return _failure(error)
    raise ValueError(f"tries: {tries}, at least 1")


def _failure(error: BaseException) -> Exception:
    """An error of a task; one in the lines of another package is told as that package's."""
    if isinstance(error, TerrainForgeError | MemoryError):
        return error
    if told := plugin_at_fault(error):
        failure = PluginError(told)
        failure.__cause__ = error
        return failure
    return error if isinstance(error, Exception) else RuntimeError(failure_words(error))


def sendable(result: Any) -> Any:
    """A result that can be sent, or the error that says why not."""
    if isinstance(result, Exception):
        result.add_note("".join(traceback.format_exception(result)))
    try:
        pickle.loads(pickle.dumps(result))
    except Exception as error:
        told = result if isinstance(result, Exception) else error
        return RuntimeError(f"{type(told).__name__}: {told}")
    return result
