"""Plots of a study: a panel for each factor, with each cell's figure and the median of a level."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from terrain_forge.base import own_style
from terrain_forge.studies.cells import Study
from terrain_forge.studies.effects import MAIN, MEASURES, Effect
from terrain_forge.studies.factors import Factor
from terrain_forge.writers import figure_text

_COLOURS = ("#b4552d", "#2f6f8f", "#5f8a3a", "#8a5fa0", "#c39a2b", "#555555")
_INK = "#4a433d"
_LONGEST = 18
"""Characters of a level's name."""


@own_style()
def effect_plot(study: Study, factor: Factor, effects: list[Effect]) -> bytes:
    """The figures of a factor's levels, by system, as PNG.

    A dot is a cell, a line joins the medians, a bar goes from the least to the largest; a cross
    below the axis is a cell without a figure.
    """
    figure = Figure(figsize=(7.4, 4.2), dpi=110, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    mine = [one for one in effects if one.factor == factor.name and one.measure == MAIN]
    systems = [adapter.name for adapter in study.file.systems]
    for number, system in enumerate(systems):
        shift = 0.5 * (number + 0.5) / len(systems) - 0.25
        colour = _COLOURS[number % len(_COLOURS)]
        _draw(axes, [one for one in mine if one.system == system], shift, colour, system)
    values = [value for one in mine for value in one.values]
    if values and min(values) > 0.0:
        axes.set_yscale("log")
        plain = FuncFormatter(lambda value, _: f"{value:g}")
        axes.yaxis.set_major_formatter(plain)
        few = max(values) < 20.0 * min(values)
        axes.yaxis.set_minor_formatter(plain if few else NullFormatter())
    names = [figure_text(_short(level.name)) for level in factor.levels]
    long = max(map(len, names)) > 9
    axes.set_xticks(
        range(len(names)), names, rotation=15 if long else 0, ha="right" if long else "center"
    )
    axes.set_xlim(-0.5, len(names) - 0.5)
    axes.set_title(figure_text(factor.name), fontsize=11, loc="left", color=_INK)
    axes.set_ylabel(f"{MAIN} [{MEASURES[MAIN][3]}]")
    axes.grid(axis="y", color="#eee8e0", linewidth=0.6)
    figure.legend(loc="outside right upper", frameon=False, fontsize=9, labelcolor=_INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=9, colors=_INK, which="both")
    buffer = BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw(axes: Axes, effects: list[Effect], shift: float, colour: str, system: str) -> None:
    places, medians = [], []
    for number, one in enumerate(effects):
        if one.values:
            spread = 0.04 * (np.arange(len(one.values)) - 0.5 * (len(one.values) - 1))
            at = number + shift + np.clip(spread, -0.1, 0.1)
            axes.plot(at, one.values, "o", color=colour, markersize=3.5, alpha=0.6)
            axes.vlines(number + shift, min(one.values), max(one.values), color=colour, lw=1.0)
            places.append(number + shift)
            medians.append(float(np.median(one.values)))
        if len(one.values) < one.cells:
            axes.plot(number + shift, 0.02, "x", color=colour, transform=axes.get_xaxis_transform())
    label = figure_text(system)
    axes.plot(places, medians, "-", color=colour, linewidth=1.4, marker="_", ms=12, label=label)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else name[: _LONGEST - 1] + "…"
