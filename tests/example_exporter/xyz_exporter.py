"""Exports the ground as a list of points, one line of x, y, z [m] per node."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge

from terrain_forge.base import Spec
from terrain_forge.model import ExportReport, Opening, World
from terrain_forge.validation import Consumer, Reading, Sample


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the point list."""

    separator: Literal["space", "comma"] = "space"
    """What stands between the numbers."""
    every: Annotated[int, Ge(1)] = 1
    """Which nodes to write, each way: all, every second, …"""


def export(world: World, directory: Path, *, options: Any) -> ExportReport:
    """Write points.xyz, row by row from the south-west, and world.xml, which describes it."""
    ground, step = world.ground, options.every
    east, north = np.meshgrid(ground.east[::step], ground.north[::step])
    points = np.column_stack(
        [east.ravel(), north.ravel(), ground.elevation[::step, ::step].ravel()]
    )
    separator = "," if options.separator == "comma" else " "
    np.savetxt(directory / "points.xyz", points, fmt="%.9g", delimiter=separator)
    xml = f'<points file="points.xyz" count="{len(points)}"/>\n'
    (directory / "world.xml").write_text(xml, encoding="utf-8")
    files = Path("points.xyz"), Path("world.xml")
    return ExportReport(files=files, losses=_losses(world, step))


def _losses(world: World, step: int) -> tuple[str, ...]:
    losses = ["Points have no triangles: the surface between the nodes is left to the reader."]
    if len(world.field):
        losses.append(f"{len(world.field)} rocks are left out.")
    if step > 1:
        losses.append(f"Only every {step}. node of the ground is written.")
    return tuple(losses)


def read_points(sample: Sample, folder: Path, options: Options, scratch: Path) -> Reading:
    """The listed points nearest to the sample's."""
    from scipy.spatial import cKDTree

    del scratch
    separator = "," if options.separator == "comma" else None
    points = np.loadtxt(folder / "points.xyz", delimiter=separator)
    nearest = points[cKDTree(points[:, :2]).query(sample.points)[1]]
    (west, south), (east, north) = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    others = "findings", "rock tops", "rock outlines", "masses", "gravity", "path", "balls"
    return Reading(
        consumer=f"NumPy {np.__version__}",
        points=nearest[:, :2],
        heights=nearest[:, 2],
        extent=(west, south, east, north),
        reasons=dict.fromkeys(others, "points are the ground alone"),
    )


CONSUMERS = (Consumer(name="NumPy", read=read_points, quick=True),)


def opening(folder: Path, options: Options) -> Opening:
    """How to look at the points."""
    del options
    commands = f"CloudCompare {quote(folder.name)}/points.xyz"
    return Opening(title="Points", commands=commands)
