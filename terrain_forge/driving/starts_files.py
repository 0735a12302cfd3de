"""Many drives as files: a table and a map."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from terrain_forge.driving.map_figure import HIT, INK, TRACK, draw_ground
from terrain_forge.driving.starts import StartResult, StartsResult
from terrain_forge.model import World
from terrain_forge.writers import Column, quoted, write_table


def write_starts_table(result: StartsResult, path: Path) -> Path:
    """Write a row for each drive; figures of drives that could not begin are 0."""
    starts = result.starts
    numbers = {
        "x_m": [start.start[0] for start in starts],
        "y_m": [start.start[1] for start in starts],
        "heading_deg": [math.degrees(start.heading) for start in starts],
        "progress_m": [_figure(start, "progress") for start in starts],
        "time_s": [_figure(start, "duration") for start in starts],
        "mean_slip": [_figure(start, "mean_slip") for start in starts],
        "largest_tilt_deg": [math.degrees(_figure(start, "largest_tilt")) for start in starts],
        "rocks_touched": [float(len(s.drive.rocks)) if s.drive else 0.0 for s in starts],
        "motor_work_j": [s.drive.energy.driving if s.drive else 0.0 for s in starts],
    }
    columns = [
        Column(name="number", values=np.arange(len(starts)), form="%d"),
        Column(name="arrived", values=np.array([s.arrived for s in starts], int), form="%d"),
        *(Column(name=n, values=np.array(v), form="%.6f") for n, v in numbers.items()),
        Column(
            name="reason", values=np.array([quoted(s.reason) for s in starts], object), form="%s"
        ),
    ]
    write_table(path, columns)
    return path


def _figure(start: StartResult, name: str) -> float:
    return float(getattr(start.drive, name)) if start.drive else 0.0


def write_starts_figure(world: World, result: StartsResult, path: Path) -> Path:
    """Draw a map of all drives: those that arrived, those that did not, and where they ended."""
    figure = Figure(figsize=(7.5, 7.5), dpi=120, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    west, south, east, north = world.ground.bounds
    draw_ground(axes, world, touched=(), around=np.array([(west, south), (east, north)]))
    for start in result.starts:
        colour = TRACK if start.arrived else HIT
        axes.plot(*start.start, "o", color=colour, markersize=4)
        if start.drive:
            axes.plot(*start.drive.position[:, :2].T, color=colour, linewidth=1.4)
            if not start.arrived:
                axes.plot(*start.drive.position[-1, :2], "x", color=colour, markersize=6)
    arrived = sum(start.arrived for start in result.starts)
    axes.set_title(
        f"{arrived} of {len(result.starts)} drives of {result.length:g} m arrived; "
        f"mean slip {result.mean_slip:.1%}",
        loc="left", fontsize=10, color=INK,
    )  # fmt: skip
    figure.savefig(path, metadata={"Software": None})
    return path
