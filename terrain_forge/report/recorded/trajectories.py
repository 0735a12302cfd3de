"""Plots of systems that were evaluated: their trajectories over the map, error over path length."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, own_style
from terrain_forge.report.recorded.plots import INK, LEGEND, blank_figure, png_of
from terrain_forge.writers import figure_text

_COLOURS = ("#d1495b", "#2f6f8f", "#5f8a3a", "#8a5fa0", "#c39a2b", "#17a398", "#9a5b2d", "#444444")
_MARGIN = 2.0
"""Ground shown around the paths [m]."""
_LEAST = 1e-4
"""Errors that are drawn [m]."""
_DRAWN = 2000
"""Points of a line."""
_LONGEST = 18
"""Characters of a name."""
_BESIDE = LEGEND | {"loc": "upper left", "bbox_to_anchor": (1.01, 1.01)}
"""Names beside the picture, where no line is."""


@own_style()
def trajectory_plot(
    picture: NDArray[np.uint8],
    bounds: tuple[float, float, float, float],
    truth: Array,
    runs: Mapping[str, Array],
) -> bytes:
    """Where systems say the rover went, over the picture from above; as PNG.

    Args:
        picture: The map, north up, shape [height, width, 3].
        bounds: Its west, south, east, north [m].
        truth: True places, shape [poses, 3].
        runs: Rows of `read_errors` of each system's best run.
    """
    figure = blank_figure(8.6, 6.4)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.07, right=0.79, bottom=0.08, top=0.985)
    west, south, east, north = bounds
    axes.imshow(picture, extent=(west, east, south, north), interpolation="bilinear")
    thin = truth[:: max(1, len(truth) // _DRAWN)]
    axes.plot(thin[:, 0], thin[:, 1], color="white", linewidth=3.2, alpha=0.85, label="truth")
    for number, (name, rows) in enumerate(runs.items()):
        colour = _COLOURS[number % len(_COLOURS)]
        rows = rows[:: max(1, len(rows) // _DRAWN)]
        axes.plot(rows[:, 2], rows[:, 3], color=colour, linewidth=1.3, label=_label(name))
    axes.plot(*truth[0, :2], "o", color="white", markeredgecolor=INK, markersize=6)
    low, high = truth[:, :2].min(axis=0), truth[:, :2].max(axis=0)
    reach = 0.5 * float((high - low).max()) + _MARGIN
    middle = 0.5 * (low + high)
    axes.set(
        xlim=(middle[0] - reach, middle[0] + reach),
        ylim=(middle[1] - reach, middle[1] + reach),
        aspect="equal",
    )
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    for line in axes.legend(**_BESIDE).get_lines()[:1]:
        line.set_color("#bbbbbb")  # white, on white
    return png_of(figure)


@own_style()
def error_plot(runs: Mapping[str, Array]) -> bytes:
    """How far systems are off over the length of the true path, as PNG."""
    figure = blank_figure(8.6, 3.6)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.08, right=0.79, bottom=0.14, top=0.95)
    least = 1.0
    for number, (name, rows) in enumerate(runs.items()):
        station, errors = _largest(rows[:, 1], rows[:, 5])
        errors = np.maximum(errors, _LEAST)
        least = min(least, float(np.median(errors)))
        colour = _COLOURS[number % len(_COLOURS)]
        axes.plot(station, errors, color=colour, linewidth=1.2, label=_label(name))
    axes.set_yscale("log")
    axes.set_ylim(bottom=max(0.1 * least, _LEAST))
    axes.set_xlabel("length of the true path [m]")
    axes.set_ylabel("distance to the truth [m]")
    axes.grid(color="#eee8e0", linewidth=0.6)
    axes.legend(**_BESIDE)
    return png_of(figure)


def _label(name: str) -> str:
    """A name as there is room for."""
    return figure_text(name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…")


def _largest(station: Array, errors: Array) -> tuple[Array, Array]:
    """The largest error of each of some pieces of the path."""
    step = max(1, -(-len(station) // _DRAWN))
    begins = np.arange(0, len(station), step)
    return station[begins], np.maximum.reduceat(errors, begins)
