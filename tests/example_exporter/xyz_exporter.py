"""Exports the ground as a list of points, one line of x, y, z [m] per node."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge

from terrain_forge.base import Spec
from terrain_forge.model import ExportReport, World


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the point list."""

    separator: Literal["space", "comma"] = "space"
    """What stands between the numbers."""
    every: Annotated[int, Ge(1)] = 1
    """Which nodes to write, each way: all, every second, …"""


def export(world: World, directory: Path, *, options: Any) -> ExportReport:
    """Write points.xyz, row by row from the south-west."""
    ground, step = world.ground, options.every
    east, north = np.meshgrid(ground.east[::step], ground.north[::step])
    points = np.column_stack(
        [east.ravel(), north.ravel(), ground.elevation[::step, ::step].ravel()]
    )
    separator = "," if options.separator == "comma" else " "
    np.savetxt(directory / "points.xyz", points, fmt="%.9g", delimiter=separator)
    return ExportReport(files=(Path("points.xyz"),), losses=_losses(world, step))


def _losses(world: World, step: int) -> tuple[str, ...]:
    losses = ["Points have no triangles: the surface between the nodes is left to the reader."]
    if len(world.field):
        losses.append(f"{len(world.field)} rocks are left out.")
    if step > 1:
        losses.append(f"Only every {step}. node of the ground is written.")
    return tuple(losses)
