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

from terrain_forge.base import Array, own_style, portable
from terrain_forge.driving.result import DriveResult
from terrain_forge.driving.starts import StartsResult
from terrain_forge.model import World
from terrain_forge.paths import columns, pose_columns, write_tum
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
    name, time = stem(result), result.time
    table, wheels, tum = (folder / f"{name}{end}" for end in (".csv", "_wheels.csv", ".tum"))
    rpy = np.column_stack([result.rpy[:, :2], np.unwrap(result.rpy[:, 2])])
    errors = np.column_stack([result.cross_track, result.heading_error, result.tilt])
    content = pose_columns(time, result.position, result.quaternion, rpy)
    content += columns(errors, "cross_track_m", "heading_error_rad", "tilt_rad")
    if len(result.clearance):
        content += columns(result.clearance[:, None], "clearance_m")
    write_table(table, content)
    states = np.stack([result.wheel_rate, result.wheel_torque, result.wheel_slip], axis=-1)
    measures = ("rate_rad_s", "torque_n_m", "slip")
    names = [f"{wheel}_{measure}" for wheel in result.wheels for measure in measures]
    content = columns(time[:, None], "time_s") + columns(states.reshape(len(time), -1), *names)
    content += columns(result.joint_angle, *(f"{name}_rad" for name in result.joints))
    write_table(wheels, content)
    write_tum(tum, time, result.position, result.quaternion)
    return [table, wheels, tum]


@own_style()
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
    numbers = np.zeros((len(starts), 9))
    for row, start in zip(numbers, starts, strict=True):
        row[:3] = *start.start, math.degrees(start.heading)
        if drive := start.drive:
            tilt, work = math.degrees(drive.largest_tilt), drive.energy.driving
            row[3:6] = drive.progress, drive.duration, drive.mean_slip
            row[6:] = tilt, len(drive.rocks), work
    names = (
        *("x_m", "y_m", "heading_deg", "progress_m", "time_s", "mean_slip", "largest_tilt_deg"),
        *("rocks_touched", "motor_work_j"),
    )
    reasons = np.array([quoted(start.reason) for start in starts], object)
    content = [
        Column(name="number", values=np.arange(len(starts)), form="%d"),
        Column(name="arrived", values=np.array([s.arrived for s in starts], int), form="%d"),
        *(Column(name=n, values=v, form="%.6f") for n, v in zip(names, numbers.T, strict=True)),
        Column(name="reason", values=reasons, form="%s"),
    ]
    write_table(path, content)
    return path


@own_style()
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
    """Draw the shaded ground around points [m] and the rocks that a map of this size can show."""
    ground = world.ground
    step = -(-max(ground.shape) // _MAP_NODES)
    heights = ground.elevation[::step, ::step].astype(np.float64)
    spacing = ground.spacing * step
    west, south = (edge - spacing / 2 for edge in ground.origin)
    high, wide = (nodes * spacing for nodes in heights.shape)
    extent = west, west + wide, south, south + high
    shade = _hillshade(heights, spacing, world.lighting.towards_sun)
    axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=-0.4, vmax=1.4)
    _draw_rocks(axes, world, touched)
    low = np.maximum(around.min(0) - _MARGIN, ground.bounds[:2])
    top = np.minimum(around.max(0) + _MARGIN, ground.bounds[2:])
    axes.set(xlim=(low[0], top[0]), ylim=(low[1], top[1]), aspect="equal")
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
