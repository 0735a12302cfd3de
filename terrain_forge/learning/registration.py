"""Making the environments known to Gymnasium."""

from __future__ import annotations

from importlib.util import find_spec

DRIVE = "TerrainForge/Drive-v0"


def register_environments() -> None:
    """Let `gymnasium.make("TerrainForge/Drive-v0", worlds=…)` find the environment.

    It is done when `terrain_forge.learning` is imported; without Gymnasium it does nothing.
    """
    if find_spec("gymnasium") is None:
        return
    import gymnasium

    if DRIVE not in gymnasium.registry:
        gymnasium.register(DRIVE, entry_point="terrain_forge.learning.drive:DriveEnv")
