"""How Gazebo opens an SDF export."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening:
    """The lines for a terminal."""
    name = quote(folder.name)
    models = f'"$PWD"/{name}/models'
    if options.flavour == "classic":
        return Opening(
            title="Gazebo Classic",
            commands=f"GAZEBO_MODEL_PATH={models} gazebo {name}/scene.sdf",
        )
    return Opening(
        title="Gazebo",
        commands=f"GZ_SIM_RESOURCE_PATH={models} gz sim {name}/scene.sdf\n"
        f"IGN_GAZEBO_RESOURCE_PATH={models} ign gazebo {name}/scene.sdf   # Fortress",
    )
