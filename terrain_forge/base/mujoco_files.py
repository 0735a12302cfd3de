"""MuJoCo models, read from their files as those are now, and MuJoCo without a word of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

_LOCK = Lock()
_silent = 0
"""How many want silence now, in any thread."""


def load_model(path: Path) -> Any:
    """The model of an XML file and the files that it names.

    MuJoCo remembers what it has read by a file's place and the second of its last change, so that a
    world written anew within a second would keep its old ground; its memory is emptied first.

    Raises:
        ValueError: if MuJoCo cannot load it.
    """
    import mujoco

    if hasattr(mujoco, "mj_clearCache"):  # older versions had no way to
        mujoco.mj_clearCache(mujoco.mj_getCache())
    return mujoco.MjModel.from_xml_path(str(path))


@contextmanager
def silent_mujoco() -> Iterator[None]:
    """MuJoCo counts its warnings in `data.warning` alone.

    Else it prints them, and writes MUJOCO_LOG.TXT into the folder that the user stands in. A
    handler that somebody has set stays.
    """
    import mujoco

    global _silent
    with _LOCK:
        _silent += 1
        if mujoco.get_mju_user_warning() is None:
            mujoco.set_mju_user_warning(_ignore)
    try:
        yield
    finally:
        with _LOCK:
            _silent -= 1
            if not _silent and mujoco.get_mju_user_warning() is _ignore:
                mujoco.set_mju_user_warning(None)


def _ignore(_: str) -> None:
    """Take a warning for told."""
