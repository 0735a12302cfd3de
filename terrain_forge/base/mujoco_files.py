"""MuJoCo models, read from their files as those are now."""

from __future__ import annotations

from pathlib import Path
from typing import Any


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
