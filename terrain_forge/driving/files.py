"""Drives as files: poses and wheels as CSV, the driven path as TUM, tables, figures, maps."""

from __future__ import annotations

import math
from collections.abc import Collection
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from terrain_forge.base import Array, portable, xyzw
from terrain_forge.driving.result import DriveResult
from terrain_forge.driving.starts import StartResult, StartsResult
from terrain_forge.model import World
from terrain_forge.writers import Column, figure_text, file_name, quoted, write_table

PATH, TRACK, INK, HIT = "#f2c230", "#1668a8", "#4a433d", "#c0392b"
"""Colours of the planned path, the driven track, the text, and what was hit."""
_MAP_NODES = 800
_SMALLEST_SHOWN = 0.3
_MARGIN = 4.0


def stem(result: DriveResult) -> str:
    """What the names of a drive's files begin with, `drive_<path>`."""
    return f"drive_{file_name(result.path)}"


def write_tables(result: DriveResult, folder: Path) -> list[Path]:
    """Write drive_PATH.csv, drive_PATH_wheels.csv and drive_PATH.tum; returns them.

    The TUM holds poses of base_link in the world frame, as a recorded path needs them.
    """
    name = stem(result)
    time = _columns(result.time[:, None], "time_s")
    position = _columns(result.position, "x_m", "y_m", "z_m")
    table, wheels, tum = (folder / f"{name}{end}" for end in (".csv", "_wheels.csv", ".tum"))
    write_table(table, time + position + _angles(result) + _errors(result))
    write_table(wheels, time + _wheels(result))
    rotation = _columns(xyzw(result.quaternion), "qx", "qy", "qz", "qw")
    write_table(tum, time + position + rotation, separator=" ", header=False)
    return [table, wheels, tum]


def _angles(result: DriveResult) -> list[Column]:
    rpy = np.column_stack([result.rpy[:, :2], np.unwrap(result.rpy[:, 2])])
    quaternion = _columns(result.quaternion, "qw", "qx", "qy", "qz")
    return quaternion + _columns(rpy, "roll_rad", "pitch_rad", "yaw_rad")


def _errors(result: DriveResult) -> list[Column]:
    errors = np.column_stack([result.cross_track, result.heading_error, result.tilt])
    columns = _columns(errors, "cross_track_m", "heading_error_rad", "tilt_rad")
    if len(result.clearance):
        columns += _columns(result.clearance[:, None], "clearance_m")
    return columns


def _wheels(result: DriveResult) -> list[Column]:
    columns = []
    for n, wheel in enumerate(result.wheels):
        states = (result.wheel_rate, result.wheel_torque, result.wheel_slip)
        values = np.column_stack([state[:, n] for state in states])
        columns += _columns(values, f"{wheel}_rate_rad_s", f"{wheel}_torque_n_m", f"{wheel}_slip")
    return columns + _columns(result.joint_angle, *(f"{name}_rad" for name in result.joints))


def _columns(values: Array, *names: str) -> list[Column]:
    return [Column(name=name, values=values[:, n], form="%.9f") for n, name in enumerate(names)]


def write_figure(world: World, result: DriveResult, path: Path) -> Path:
    """Draw a map with path and track, and what happened over time."""
    figure = Figure(figsize=(12, 7.2), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        5, 2, width_ratios=(1.15, 1), left=0.06, right=0.985, bottom=0.07, top=0.94, hspace=0.55
    )
    _draw_map(figure.add_subplot(grid[:, 0]), world, result)
    panels = [figure.add_subplot(grid[row, 1]) for row in range(5)]
    _draw_series(panels[0], result, 100 * result.cross_track, "Offset to the left, cm")
    _draw_series(panels[1], result, np.degrees(result.tilt), "Tilt, °")
    _draw_band(panels[2], result, 100 * result.wheel_slip, "Slip of the wheels: mean and range, %")
    _draw_band(panels[3], result, result.wheel_torque, "Torque of the motors: mean and range, N m")
    if len(result.clearance):
        _draw_series(panels[4], result, 100 * result.clearance, "Free height under the belly, cm")
    panels[0].axhline(0.0, color=INK, linewidth=0.6)
    panels[4].set_xlabel("Time, s", color=INK)
    figure.savefig(path, metadata={"Software": None})
    return path


def _draw_map(axes: Axes, world: World, result: DriveResult) -> None:
    planned = next(t for t in world.trajectories if t.name == result.path).position[:, :2]
    driven = result.position[:, :2]
    _draw_ground(axes, world, touched=result.rocks, around=np.vstack([planned, driven]))
    axes.plot(*planned.T, color=PATH, linewidth=3.5, label="path")
    axes.plot(*driven.T, color=TRACK, linewidth=1.2, label="driven")
    axes.plot(*planned[0], "o", color=INK, markersize=5, label="start")
    if not result.completed:
        axes.plot(*driven[-1], "X", color=HIT, markersize=10, label="end")
    name = figure_text(result.path)
    title = f"{name}: {result.reason}, {result.distance:.0f} m in {result.duration:.0f} s"
    axes.set_title(title, loc="left", fontsize=10, color=INK)
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, -0.04), ncols=4, fontsize=8, frameon=False)


def _draw_series(axes: Axes, result: DriveResult, values: Array, title: str) -> None:
    axes.plot(result.time, values, color=TRACK, linewidth=0.9)
    axes.set_title(title, loc="left", fontsize=9, color=INK)
    axes.set_xlim(0.0, float(result.time[-1]) or 1.0)
    axes.grid(alpha=0.3)
    axes.tick_params(labelsize=8)


def _draw_band(axes: Axes, result: DriveResult, values: Array, title: str) -> None:
    """The mean over the wheels as a line within the band of all of them."""
    axes.fill_between(
        result.time, values.min(1), values.max(1), color=TRACK, alpha=0.25, linewidth=0
    )
    _draw_series(axes, result, values.mean(1), title)


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
    _draw_ground(axes, world, touched=(), around=np.array([(west, south), (east, north)]))
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


def _draw_ground(axes: Axes, world: World, *, touched: Collection[str], around: Array) -> None:
    """Draw the shaded ground and the rocks that a map of this size can show.

    Args:
        axes: where to draw.
        world: the world.
        touched: names of rocks that are shown in the colour of hits.
        around: points that the map shows, with a margin [m], shape [points, 2].
    """
    ground = world.ground
    step = -(-max(ground.shape) // _MAP_NODES)
    heights = ground.elevation[::step, ::step].astype(np.float64)
    spacing = ground.spacing * step
    west, south = ground.origin
    rows, columns = heights.shape
    half = spacing / 2
    extent = (
        west - half,
        west - half + columns * spacing,
        south - half,
        south - half + rows * spacing,
    )
    shade = _hillshade(heights, spacing, world.lighting.towards_sun)
    axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=-0.4, vmax=1.4)
    _draw_rocks(axes, world, touched)
    low = np.maximum(around.min(0) - _MARGIN, ground.bounds[:2])
    high = np.minimum(around.max(0) + _MARGIN, ground.bounds[2:])
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_xlabel("East, m", color=INK, loc="left")
    axes.set_ylabel("North, m", color=INK)


def _draw_rocks(axes: Axes, world: World, names: Collection[str]) -> None:
    field = world.field
    touched = np.isin(field.id, [int(name.removeprefix("rock_")) for name in names])
    for rows, colour in ((~touched & (field.diameter >= _SMALLEST_SHOWN), INK), (touched, HIT)):
        size = field.diameter[rows]
        circles = EllipseCollection(
            size, size, np.zeros(len(size)), units="xy", offsets=field.position[rows, :2],
            offset_transform=axes.transData, facecolors=colour, alpha=0.75, linewidths=0,
        )  # fmt: skip
        axes.add_collection(circles)


def _hillshade(heights: Array, spacing: float, towards_sun: Array) -> Array:
    """Cosine of the Sun's incidence on each node."""
    north, east = np.gradient(heights, spacing)
    normal = np.stack([-east, -north, np.ones_like(heights)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.asarray(portable.product(normal, towards_sun))
