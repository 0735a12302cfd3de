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

from terrain_forge.base import own_style
from terrain_forge.terrain.statistics import TerrainStatistics
from terrain_forge.writers import log_axes

_GROUND, _DTM, _INK, _LINE = "#b4552d", "#2f6f8f", "#4a433d", "#d9cfc3"


@own_style()
def write_terrain_figure(statistics: TerrainStatistics, path: Path) -> None:
    """Draw structure function, spectrum and slopes; equal statistics, equal bytes."""
    figure = Figure(figsize=(13, 4.4), dpi=110, layout=None, facecolor="white")
    FigureCanvasAgg(figure)
    structure, spectrum, slopes = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.06, right=0.99, bottom=0.135, top=0.9, wspace=0.24)
    ground, dtm = statistics.ground, statistics.dtm
    curved = [(ground, _GROUND, f"ground, {ground.spacing:g} m")]
    if dtm is not None:
        curved.insert(0, (dtm, _DTM, f"DTM, {dtm.spacing:.3g} m"))
    for curves, colour, name in curved:
        _draw(structure, curves.baseline, curves.deviation, color=colour, lw=1.8, label=name)
        _draw(spectrum, curves.wave_number, curves.density, color=colour, lw=1.8, label=name)
        shares = 100.0 * curves.slope_shares
        slopes.stairs(shares, np.arange(91.0), color=colour, lw=1.6, label=name)
    _finish(structure, "Structure function", "Baseline [m]", "RMS height difference [m]")
    _finish(spectrum, "Power spectrum", "Wave number [1/m]", "Density [m⁴]")
    _finish(slopes, "Slopes between neighbouring samples", "Slope [°]", "Part of the ground [%]")
    # All but a thousandth of the ground.
    steepest = np.searchsorted(np.cumsum(ground.slope_shares), 0.999) + 2.0
    slopes.set_xlim(0.0, float(min(max(steepest, 10.0), 90.0)))
    if (detail := statistics.detail) is not None:
        law = np.array([detail.deviation_over(length) for length in ground.baseline.tolist()])
        label = f"ν = {detail.deviation:.2g} m · (L / 1 m)^{detail.hurst:.2f}"
        if detail.rise:
            label = f"ν(1 m) = {detail.deviation:.2g} m, H from {detail.hurst:.2f}"
        _draw(structure, ground.baseline, law, color=_LINE, lw=4.0, zorder=0, label=label)
    if dtm is not None:  # where it ends: its posting, half a cycle per posting
        structure.axvline(dtm.spacing, color=_INK, lw=0.8, ls=":")
        spectrum.axvline(0.5 / dtm.spacing, color=_INK, lw=0.8, ls=":")
    structure.legend(frameon=False, fontsize=9, labelcolor=_INK)
    figure.savefig(path, metadata={"Software": None})


def _draw(axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64], **style: Any) -> None:
    """Draw what is positive on logarithmic axes; of a level ground nothing is."""
    if np.any(y > 0.0):
        axes.plot(x[y > 0.0], y[y > 0.0], **style)
        log_axes(axes)
    else:
        axes.plot([], [], **style)


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
