"""How MuJoCo opens an MJCF export."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening:
    """The lines for a terminal."""
    del options
    return Opening(
        title="MuJoCo",
        commands=f"python -m mujoco.viewer --mjcf={quote(folder.name)}/scene.xml",
    )
