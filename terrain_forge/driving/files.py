"""A drive as files: the driven track as CSV and TUM, and a picture of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from terrain_forge.driving.drive import DriveResult
from terrain_forge.frames import xyzw
from terrain_forge.world import World
from terrain_forge.writers.table import Column, write_table

_PATH, _TRACK, _INK, _HIT = "#f2c230", "#1668a8", "#4a433d", "#c0392b"
_MAP_NODES = 800
_SMALLEST_SHOWN = 0.3
_MARGIN = 4.0


def write_track(result: DriveResult, folder: Path) -> list[Path]:
    """Write drive.csv and drive.tum: poses of base_link in the world frame; returns both."""
    time = _columns(result.time[:, None], "time_s")
    position = _columns(result.position, "x_m", "y_m", "z_m")
    quaternion = _columns(result.quaternion, "qw", "qx", "qy", "qz")
    rpy = np.column_stack([result.rpy[:, :2], np.unwrap(result.rpy[:, 2])])
    angles = _columns(rpy, "roll_rad", "pitch_rad", "yaw_rad")
    errors = np.column_stack([result.cross_track, result.heading_error, result.tilt])
    figures = _columns(errors, "cross_track_m", "heading_error_rad", "tilt_rad")
    table, tum = folder / "drive.csv", folder / "drive.tum"
    write_table(table, time + position + quaternion + angles + figures)
    rotation = _columns(xyzw(result.quaternion), "qx", "qy", "qz", "qw")
    write_table(tum, time + position + rotation, separator=" ", header=False)
    return [table, tum]


def _columns(values: NDArray[np.float64], *names: str) -> list[Column]:
    return [Column(name=name, values=values[:, n], form="%.9f") for n, name in enumerate(names)]


def write_figure(world: World, result: DriveResult, path: Path) -> Path:
    """Draw a map with path and track, and cross-track error and tilt over time."""
    figure = Figure(figsize=(11, 5.6), dpi=120, facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        2, 2, width_ratios=(1, 1), left=0.06, right=0.985, bottom=0.1, top=0.92, hspace=0.25
    )
    _draw_map(figure.add_subplot(grid[:, 0]), world, result)
    cross_track, tilt = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    _draw_series(cross_track, result.time, 100 * result.cross_track, "Offset to the left, cm")
    _draw_series(tilt, result.time, np.degrees(result.tilt), "Tilt, °")
    cross_track.axhline(0.0, color=_INK, linewidth=0.6)
    tilt.set_xlabel("Time, s", color=_INK)
    figure.savefig(path, metadata={"Software": None})
    return path


def _draw_map(axes: Axes, world: World, result: DriveResult) -> None:
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
    _draw_rocks(axes, world, result)
    planned = next(t for t in world.trajectories if t.name == result.path).position
    axes.plot(planned[:, 0], planned[:, 1], color=_PATH, linewidth=3.5, label="path")
    axes.plot(result.position[:, 0], result.position[:, 1], color=_TRACK, linewidth=1.2,
              label="driven")  # fmt: skip
    axes.plot(*planned[0, :2], "o", color=_INK, markersize=5, label="start")
    low = np.maximum(planned[:, :2].min(0) - _MARGIN, ground.bounds[:2])
    high = np.minimum(planned[:, :2].max(0) + _MARGIN, ground.bounds[2:])
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set_xlabel("East, m", color=_INK)
    axes.set_ylabel("North, m", color=_INK)
    title = f"{result.path}: {result.reason}, {result.distance:.0f} m in {result.duration:.0f} s"
    axes.set_title(title, loc="left", fontsize=10, color=_INK)
    axes.legend(loc="upper right", fontsize=8, framealpha=0.9)


def _draw_rocks(axes: Axes, world: World, result: DriveResult) -> None:
    """Rocks that a map of this size can show, and those that were touched."""
    field = world.field
    touched = np.isin(field.id, [int(name.removeprefix("rock_")) for name in result.rocks])
    for rows, colour in ((~touched & (field.diameter >= _SMALLEST_SHOWN), _INK), (touched, _HIT)):
        size = field.diameter[rows]
        circles = EllipseCollection(
            size, size, np.zeros(len(size)), units="xy", offsets=field.position[rows, :2],
            offset_transform=axes.transData, facecolors=colour, alpha=0.75, linewidths=0,
        )  # fmt: skip
        axes.add_collection(circles)


def _hillshade(
    heights: NDArray[np.float64], spacing: float, towards_sun: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Cosine of the Sun's incidence on each node."""
    north, east = np.gradient(heights, spacing)
    normal = np.stack([-east, -north, np.ones_like(heights)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.asarray(normal @ towards_sun)


def _draw_series(
    axes: Axes, time: NDArray[np.float64], values: NDArray[np.float64], title: str
) -> None:
    axes.plot(time, values, color=_TRACK, linewidth=0.9)
    axes.set_title(title, loc="left", fontsize=10, color=_INK)
    axes.set_xlim(0.0, float(time[-1]) or 1.0)
    axes.grid(alpha=0.3)
    axes.tick_params(labelsize=8)
