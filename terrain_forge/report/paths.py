"""Paths and drives on the report page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.model import Trajectory
from terrain_forge.report.checks import is_drive, measure_facts
from terrain_forge.report.facts import describe
from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import ANIMATED, Cell, Html, chip, html, paragraph, plot, table


def paths_section(built: Built) -> Section:
    """The planned paths, and what they ask of the rover where that was looked at."""
    world = built.world
    if not world.trajectories:
        return Section("Paths", (paragraph("This world has no paths."),))
    headings = ("Path", "Length", "Duration", "Mean speed", "Height range", "Largest tilt", "Kind")
    rows = [_path_row(trajectory) for trajectory in world.trajectories]
    asked = built.validation.get("paths")
    found = describe({"what_they_ask_of_the_rover": asked}) if asked else []
    return Section("Paths", (table(headings, rows, figures="lrrrrrl"), *found))


def _path_row(trajectory: Trajectory) -> list[Cell]:
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


def drive_section(built: Built) -> Section | None:
    """The validation drive: whether it arrived, what it looked like, its figures.

    Its checks stand among all others.
    """
    said = {name: said for name, said in built.validation.items() if name.startswith("drive")}
    measures = measure_facts([c for c in built.validation.get("checks", []) if is_drive(c)])
    files = sorted(built.pictures("drive"), key=lambda path: path.suffix not in ANIMATED)
    pictures = [plot(path, description=_described(path)) for path in files]
    if not (any(said.values()) or measures or pictures):
        return None
    facts = [part for content in said.values() if content for part in _facts(content)]
    return Section("The drive", (*_arrival(said), *pictures, *facts, *measures))


def _facts(content: Any) -> list[Html]:
    return describe(content if isinstance(content, dict) else {"drives": content})


def _arrival(said: dict[str, Any]) -> list[Html]:
    drive = said.get("drive") or {}
    if "reason" not in drive:
        return []
    arrived = bool(drive.get("completed"))
    mark = chip("arrived" if arrived else "did not arrive", "good" if arrived else "bad")
    reason = "" if arrived else f" {html(str(drive['reason']))}"
    return [paragraph(Html(mark.text + reason))]


def _described(path: Path) -> str:
    name = path.stem.replace("_", " ")
    if path.suffix in ANIMATED:
        return f"Film of the {name}"
    return f"Plots of the {name}: path and driven track, errors over time"
