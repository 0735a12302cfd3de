"""Paths and drives on the report page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.model import Trajectory
from terrain_forge.report.blocks import ANIMATED, Block, Cell, Shown, paragraph, plot, table
from terrain_forge.report.describe import describe
from terrain_forge.report.section import Built, Section
from terrain_forge.report.sections.checks import is_drive, measure_facts


class Paths(Section):
    """The planned paths, and what they ask of the rover where that was looked at."""

    kind, title, place = "paths", "Paths", 70

    def blocks(self, built: Built) -> Sequence[Block]:
        """A row for each path, then what they ask."""
        world = built.world
        if not world.trajectories:
            return [paragraph("This world has no paths.")]
        rows = [_path_row(trajectory) for trajectory in world.trajectories]
        asked = built.validation.get("paths")
        found = describe({"what_they_ask_of_the_rover": asked}) if asked else []
        return [table(_HEADINGS, rows, figures="lrrrrrl"), *found]


_HEADINGS = ("Path", "Length", "Duration", "Mean speed", "Height range", "Largest tilt", "Kind")


def _path_row(trajectory: Trajectory) -> list[Shown]:
    duration = float(trajectory.time[-1] - trajectory.time[0])
    roll, pitch = trajectory.rpy[:, 0], trajectory.rpy[:, 1]
    tilt = float(np.degrees(np.arccos(np.cos(roll) * np.cos(pitch)).max()))
    return [
        trajectory.name,
        f"{trajectory.length:.1f} m",
        f"{duration:.1f} s",
        f"{trajectory.length / duration:.3f} m/s",
        f"{np.ptp(trajectory.position[:, 2]):.2f} m",
        f"{tilt:.1f}°",
        "closed" if trajectory.closed else "open",
    ]


class Drive(Section):
    """The validation drive: whether it arrived, what it looked like, its figures.

    Its checks stand among all others.
    """

    kind, title, place = "drive", "The drive", 80

    def blocks(self, built: Built) -> Sequence[Block]:
        """Verdict, film and plots, figures."""
        said = {name: said for name, said in built.validation.items() if name.startswith("drive")}
        measures = measure_facts([c for c in built.validation.get("checks", []) if is_drive(c)])
        files = sorted(built.pictures("drive"), key=lambda path: path.suffix not in ANIMATED)
        pictures = [plot(path, description=_described(path)) for path in files]
        facts = list[Block]()
        for content in filter(None, said.values()):
            facts += describe(content if isinstance(content, dict) else {"drives": content})
        return [*_arrival(said.get("drive") or {}), *pictures, *facts, *measures]


def _arrival(drive: dict[str, Any]) -> list[Block]:
    if "reason" not in drive:
        return []
    if drive.get("completed"):
        return [paragraph(Cell("arrived", "good"))]
    return [paragraph(Cell("did not arrive", "bad", note=str(drive["reason"])))]


def _described(path: Path) -> str:
    name = path.stem.replace("_", " ")
    if path.suffix in ANIMATED:
        return f"Film of the {name}"
    return f"Plots of the {name}: path and driven track, errors over time"
