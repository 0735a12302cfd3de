"""A drive as files: poses and wheels as CSV, the driven path as TUM, and a figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from terrain_forge.base import Array, xyzw
from terrain_forge.driving.map_figure import INK, PATH, TRACK, draw_ground
from terrain_forge.driving.result import DriveResult
from terrain_forge.model import World
from terrain_forge.writers import Column, figure_text, file_name, write_table


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
    draw_ground(axes, world, touched=result.rocks, around=np.vstack([planned, driven]))
    axes.plot(*planned.T, color=PATH, linewidth=3.5, label="path")
    axes.plot(*driven.T, color=TRACK, linewidth=1.2, label="driven")
    axes.plot(*planned[0], "o", color=INK, markersize=5, label="start")
    if not result.completed:
        axes.plot(*driven[-1], "X", color="#c0392b", markersize=10, label="end")
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
