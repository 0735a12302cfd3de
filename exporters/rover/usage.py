"""How ROS 2 shows the rover."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening | None:
    """The lines for a terminal."""
    if "urdf" not in options.formats:
        return None
    model = f'"$PWD"/{quote(folder.name)}/{next(folder.glob("*.urdf")).name}'
    return Opening(
        title="The rover in ROS 2",
        commands=f"ros2 launch urdf_tutorial display.launch.py model:={model}",
    )
