"""The picture of the ground beside its DTM, validation/terrain.png."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from terrain_forge.base import portable
from terrain_forge.terrain.statistics import Curves, TerrainStatistics
from terrain_forge.writers import log_axes

_GROUND, _DTM, _INK, _LINE = "#b4552d", "#2f6f8f", "#4a433d", "#d9cfc3"


def write_terrain_figure(statistics: TerrainStatistics, path: Path) -> None:
    """Draw structure function, spectrum and slopes; equal statistics, equal bytes."""
    figure = Figure(figsize=(13, 4.4), dpi=110, layout=None, facecolor="white")
    FigureCanvasAgg(figure)
    structure, spectrum, slopes = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.06, right=0.99, bottom=0.135, top=0.9, wspace=0.24)
    for curves, colour, name in _pairs(statistics):
        _draw(structure, curves.baseline, curves.deviation, color=colour, lw=1.8, label=name)
        _draw(spectrum, curves.wave_number, curves.density, color=colour, lw=1.8, label=name)
        shares = 100.0 * curves.slope_shares
        slopes.stairs(shares, np.arange(91.0), color=colour, lw=1.6, label=name)
    _finish(structure, "Structure function", "Baseline [m]", "RMS height difference [m]")
    _finish(spectrum, "Power spectrum", "Wave number [1/m]", "Density [m⁴]")
    _finish(slopes, "Slopes between neighbouring samples", "Slope [°]", "Part of the ground [%]")
    slopes.set_xlim(0.0, _steepest(statistics))
    _draw_law(structure, statistics)
    _draw_joint(structure, spectrum, statistics)
    structure.legend(frameon=False, fontsize=9, labelcolor=_INK)
    figure.savefig(path, metadata={"Software": None})


def _draw(axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64], **style: Any) -> None:
    """Draw what is positive on logarithmic axes; of a level ground nothing is."""
    if np.any(y > 0.0):
        axes.plot(x[y > 0.0], y[y > 0.0], **style)
        log_axes(axes)
    else:
        axes.plot([], [], **style)


def _pairs(statistics: TerrainStatistics) -> list[tuple[Curves, str, str]]:
    pairs = [(statistics.ground, _GROUND, f"ground, {statistics.ground.spacing:g} m")]
    if statistics.dtm is not None:
        pairs.insert(0, (statistics.dtm, _DTM, f"DTM, {statistics.dtm.spacing:.3g} m"))
    return pairs


def _draw_law(axes: Axes, statistics: TerrainStatistics) -> None:
    """The law that the detail follows, over the ground's baselines."""
    length = statistics.ground.baseline
    label = f"ν = {statistics.deviation:.2g} m · (L / 1 m)^{statistics.hurst:.2f}"
    law = statistics.deviation * portable.power(length, statistics.hurst)
    _draw(axes, length, law, color=_LINE, lw=4.0, zorder=0, label=label)


def _draw_joint(structure: Axes, spectrum: Axes, statistics: TerrainStatistics) -> None:
    """Where the DTM ends: its posting, half a cycle per posting."""
    if statistics.dtm is not None:
        spacing = statistics.dtm.spacing
        structure.axvline(spacing, color=_INK, lw=0.8, ls=":")
        spectrum.axvline(0.5 / spacing, color=_INK, lw=0.8, ls=":")


def _steepest(statistics: TerrainStatistics) -> float:
    """The slope that all but a thousandth of the ground stays below [degrees]."""
    total = np.cumsum(statistics.ground.slope_shares)
    return float(min(max(np.searchsorted(total, 0.999) + 2.0, 10.0), 90.0))


def _finish(axes: Axes, title: str, x: str, y: str) -> None:
    # A fixed place and no minor ticks: measuring what is written takes longer than drawing it.
    axes.set_title(title, loc="left", fontsize=11, color=_INK, y=1.02)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())
    axes.set_xlabel(x, fontsize=9, color=_INK)
    axes.set_ylabel(y, fontsize=9, color=_INK)
    axes.tick_params(labelsize=8, colors=_INK, which="both")
    axes.grid(color="#ece6df", lw=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
