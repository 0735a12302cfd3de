"""Plots of a recording: its IMU, and the returns of a lidar."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from terrain_forge.base import Array, own_style
from terrain_forge.report.recorded.measures import ImuErrors, RingCounts, WorldSweep
from terrain_forge.sensors import allan_deviation

_AXES = ("#b4552d", "#2f6f8f", "#5f8a3a")
INK = "#4a433d"
_DRAWN = 2000
"""Columns that a line over time has; each shows the least and the largest value in it."""
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9, "labelcolor": INK}


@own_style()
def imu_plot(measured: ImuErrors, *, densities: Sequence[tuple[float, float]]) -> bytes:
    """Rates and forces over time; beside them the Allan deviation of their errors.

    Args:
        measured: What the IMU told.
        densities: White noise N and walk K of the rates and of the forces.
    """
    beside = measured.errors is not None
    figure = blank_figure(11.0 if beside else 6.0, 6.0)
    axes = figure.subplots(2, 2 if beside else 1, squeeze=False)
    figure.subplots_adjust(
        left=0.085 if beside else 0.13, right=0.985, bottom=0.09, top=0.95, hspace=0.32, wspace=0.3
    )
    for row, (title, unit) in enumerate((("Rates", "rad/s"), ("Specific forces", "m/s²"))):
        over_time, part = axes[row, 0], slice(3 * row, 3 * row + 3)
        _draw_over_time(over_time, measured.times, measured.told[:, part])
        over_time.set_title(f"{title} [{unit}]", fontsize=10, loc="left", color=INK)
        if measured.errors is not None:
            errors = measured.errors[:, part]
            _draw_allan(axes[row, 1], errors, measured.rate, *densities[row])
            heading = f"Allan deviation of their errors [{unit}]"
            axes[row, 1].set_title(heading, fontsize=10, loc="left", color=INK)
    axes[1, 0].set_xlabel("time [s]")
    axes[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=3, **LEGEND)
    if beside:
        axes[1, 1].set_xlabel("time of averaging τ [s]")
        axes[0, 1].legend(loc="best", **LEGEND)
    return png_of(figure)


def _draw_over_time(axes: Axes, times: Array, values: Array) -> None:
    step = max(1, -(-len(times) // _DRAWN))
    whole = len(times) // step * step
    blocks = values[:whole].reshape(-1, step, 3)
    ends = np.stack([blocks.min(axis=1), blocks.max(axis=1)], axis=1).reshape(-1, 3)
    middles = np.repeat(times[:whole].reshape(-1, step).mean(axis=1), 2)
    shown = (times, values) if step == 1 else (middles, ends)
    for axis, (name, colour) in enumerate(zip("xyz", _AXES, strict=True)):
        axes.plot(shown[0], shown[1][:, axis], color=colour, linewidth=0.7, label=name)
    axes.margins(x=0.01)
    axes.grid(color="#eee8e0", linewidth=0.6)


def _draw_allan(axes: Axes, errors: Array, rate: float, white: float, walk: float) -> None:
    times, found = allan_deviation(errors, rate)
    for axis, (name, colour) in enumerate(zip("xyz", _AXES, strict=True)):
        axes.plot(times, found[:, axis], color=colour, linewidth=1.2, label=f"{name}, recorded")
    lines = (
        ("white noise N / √τ", white / np.sqrt(times), ":"),
        ("walk K √(τ/3)", walk * np.sqrt(times / 3.0), "--"),
        ("the spec", np.hypot(white / np.sqrt(times), walk * np.sqrt(times / 3.0)), "-"),
    )
    for name, line, style in lines:
        if line.any():
            axes.plot(times, line, style, color=INK, linewidth=1.0, label=name)
    axes.set_xscale("log")
    if found.any():
        axes.set_yscale("log")
        least = found[found > 0.0].min()
        axes.set_ylim(bottom=0.3 * least)
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(color="#eee8e0", linewidth=0.6)


@own_style()
def sweep_plot(sweep: WorldSweep | None, counts: RingCounts) -> bytes:
    """A sweep from above, by ring; beside it the returns per ring."""
    figure = blank_figure(11.0 if sweep else 6.0, 4.6)
    axes = figure.subplots(1, 2 if sweep else 1, squeeze=False)[0]
    figure.subplots_adjust(left=0.07, right=0.985, bottom=0.12, top=0.93, wspace=0.22)
    if sweep:
        places = sweep.points[:, :2] - sweep.lidar[:2]
        reach = 1.05 * float(np.percentile(np.abs(places).max(axis=1), 97.0))
        colours = sweep.ring / max(sweep.rings - 1, 1)
        axes[0].scatter(*places.T, c=colours, cmap="viridis", s=1.2, linewidths=0)
        axes[0].plot(0, 0, "+", color=INK)
        axes[0].set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        axes[0].set_title("A sweep from above, by ring", fontsize=10, loc="left", color=INK)
        axes[0].set_xlabel("east of the lidar [m]")
        axes[0].set_ylabel("north of it [m]")
    bars, edges = axes[-1], np.arange(len(counts.ground) + 1) - 0.5
    bars.stairs(counts.ground, edges, fill=True, color=_AXES[1], label="ground and rocks")
    if counts.rover.any():
        both, below = counts.ground + counts.rover, counts.ground
        bars.stairs(both, edges, baseline=below, fill=True, color=_AXES[0], label="the rover")
        bars.legend(loc="upper right", **LEGEND)
    bars.set_title("Returns of a sweep by ring", fontsize=10, loc="left", color=INK)
    bars.set_xlabel("ring")
    bars.xaxis.set_major_locator(MaxNLocator(integer=True))
    bars.set_xlim(edges[0] - 0.1, edges[-1] + 0.1)
    bars.set_ylim(bottom=0.0)
    return png_of(figure)


def blank_figure(width: float, height: float) -> Figure:
    """A white figure of some inches."""
    figure = Figure(figsize=(width, height), dpi=100, layout=None, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def png_of(figure: Figure) -> bytes:
    """A figure as PNG, its axes in the page's style."""
    for axes in figure.axes:
        axes.tick_params(labelsize=9, colors=INK)
        axes.spines[["top", "right"]].set_visible(False)
    buffer = BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
