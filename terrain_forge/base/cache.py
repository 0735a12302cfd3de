"""The cache: what can be made or fetched again, kept in one folder for all worlds.

It is `terrain-forge` in the user's cache folder (XDG_CACHE_HOME, ~/.cache); the environment
variable TERRAIN_FORGE_CACHE names another one, or `off`. It can be deleted at any time.
"""

from __future__ import annotations

import os
from pathlib import Path

_VARIABLE = "TERRAIN_FORGE_CACHE"


def cache_folder() -> Path | None:
    """Where things are kept; None where they are not."""
    chosen = os.environ.get(_VARIABLE)
    if chosen in ("", "off"):
        return None
    told = (os.environ.get(name, "") for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"))
    base = next((place for place in told if Path(place).is_absolute()), None)
    try:
        if chosen is not None:
            return Path(chosen).expanduser()
        return Path(base or Path.home() / ".cache") / "terrain-forge"
    except RuntimeError:  # no home folder
        return None
