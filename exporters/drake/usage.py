"""How Drake opens its world."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening:
    """The lines for a terminal."""
    del options
    return Opening(
        title="Drake",
        commands="from pydrake.multibody.parsing import Parser\n"
        f'Parser(plant).AddModels("{folder.name}/world.sdf")   '
        "# contact: see docs/exporters/drake.md",
    )
