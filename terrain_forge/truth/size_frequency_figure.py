"""The picture of the size-frequency verification, truth/size_frequency.png."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from terrain_forge.base import own_style
from terrain_forge.writers import figure_text, log_axes

_COLOURS = (
    *("#b4552d", "#2f6f8f", "#5f8a3a", "#7a4f9a", "#b58a1e"),
    *("#a03a6a", "#2f8f7f", "#8a6a4a", "#4a5aa0", "#7a7a7a"),
)
_NAMED = 10
_TOGETHER = "#d9cfc3"
_INK = "#4a433d"
_LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9, "labelcolor": _INK}
_BARE = 1e-4, 1.0
_LEAST = 1e-99
"""So few rocks per m², or so little of it covered, are none."""
_TICKS = [m * 10.0**e for e in range(-3, 3) for m in (1, 2, 5)]


@own_style()
def write_figure(verification: dict[str, Any], path: Path) -> None:
    """Draw cumulative number and cover over diameter; equal verification, equal bytes."""
    figure = Figure(figsize=(11, 4.8), dpi=120, layout=None, facecolor="white")
    FigureCanvasAgg(figure)
    number, cover = figure.subplots(1, 2)
    figure.subplots_adjust(left=0.075, right=0.985, bottom=0.13, top=0.89, wspace=0.2)
    parts = _parts(verification)
    fits = [(part["fit_to_counts"], colour) for part, colour, _ in parts if "law" in part]
    fits = [(fit["counted_above"], colour) for fit, colour in fits if fit]
    for part, colour, width in parts:
        _draw(number, part, "number", colour, width)
        _draw(cover, part, "cover", colour, width)
    _finish(number, "Cumulative number", "Rocks larger than D per m²")
    _finish(cover, "Cumulative cover, Σ πD²/4", "Area covered by rocks larger than D")
    if verification["populations"]:
        everything = parts[0][0]
        _limit(number, everything, "number", verification["area_m2"])
        _limit(cover, everything, "cover", verification["area_m2"])
    for counted, colour in fits:
        _draw_counted(number, counted, colour)
    if parts:
        handles, _ = number.get_legend_handles_labels()
        more = len(handles) - _NAMED
        title = f"and {more} more" if more > 0 else None
        number.legend(handles=handles[:_NAMED], loc="lower left", title=title, **_LEGEND)
        right = f"{verification['confidence']:.0%} of right samples"
        cover.plot([], [], color=_INK, linewidth=1.8, label="this world")
        cover.plot([], [], color=_INK, linewidth=1, linestyle="--", label="the law")
        cover.fill_between([], [], [], color=_INK, alpha=0.16, label=right)
        if fits:
            style: dict[str, Any] = {"color": _INK, "marker": "o", "markersize": 4}
            cover.plot([], [], linestyle=":", linewidth=1, label="your counts, law there", **style)
        handles, _ = cover.get_legend_handles_labels()
        cover.legend(handles=handles[-4 if fits else -3 :], loc="lower left", **_LEGEND)
    figure.savefig(path, metadata={"Software": None})


def _parts(verification: dict[str, Any]) -> list[tuple[dict[str, Any], str, float]]:
    """What is drawn, in which colour and how wide: the sum of all first, then each of them."""
    curves = [*verification["populations"], *verification["lists"]]
    parts = [(part, _COLOURS[n % len(_COLOURS)], 1.8) for n, part in enumerate(curves)]
    if len(verification["populations"]) > 1:
        parts.insert(0, ({"name": "together", **verification["together"]}, _TOGETHER, 4.5))
    return parts


def _draw(axes: Axes, part: dict[str, Any], quantity: str, colour: str, width: float) -> None:
    curve = part["curve"]
    diameter = curve["diameter_m"]
    observed = [value if value > 0 else float("nan") for value in curve[f"{quantity}_observed"]]
    axes.plot(diameter, observed, color=colour, linewidth=width, label=population_label(part))
    if f"{quantity}_expected" in curve:
        low, high = curve[f"{quantity}_low"], curve[f"{quantity}_high"]
        axes.fill_between(diameter, low, high, color=colour, alpha=0.16, linewidth=0)
        axes.plot(diameter, curve[f"{quantity}_expected"], color=_INK, linewidth=1, linestyle="--")


def _draw_counted(axes: Axes, counted: dict[str, list[float]], colour: str) -> None:
    """The user's counts with Poisson errors, and the law that was fitted to them, untruncated."""
    at, number = counted["diameter_m"], counted["number"]
    below = [n - low for n, low in zip(number, counted["number_low"], strict=True)]
    above = [high - n for n, high in zip(number, counted["number_high"], strict=True)]
    style: dict[str, Any] = {
        "color": colour,
        "markersize": 4,
        "linewidth": 1,
        "markeredgecolor": _INK,
    }
    axes.errorbar(at, number, yerr=[below, above], fmt="o", zorder=3, **style)
    axes.plot(at, counted["number_law"], color=_INK, linewidth=1, linestyle=":")
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, 0.95 * at[0]), max(high, 1.1 * at[-1]))
    low, high = axes.get_ylim()
    seen = [value for value in number if value > 0.0]
    axes.set_ylim(min([low, *(0.6 * n for n in seen)]), max([high, *(1.8 * n for n in seen)]))


def population_label(part: dict[str, Any]) -> str:
    """A population's name in the legend."""
    number = f"{part['count']['observed']:,}".replace(",", " ")
    how = {"clustered": ", clustered", "craters": ", around craters"}
    kind = how.get(part.get("arrangement", ""), ", listed" if "file" in part else "")
    # The number stands first, since matplotlib hides labels that begin with "_".
    return f"{number} {figure_text(part['name'])}{kind}"


def _finish(axes: Axes, title: str, label: str) -> None:
    if not _LEAST < axes.dataLim.minposy < math.inf:
        axes.set_ylim(*_BARE)  # no rock is there nor expected: a logarithmic axis finds no limits
    log_axes(axes)
    axes.xaxis.set_major_locator(FixedLocator(_TICKS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(_power_of_ten))
    # A fixed place and plain text: measuring titles and typesetting formulas takes time.
    axes.set_title(title, loc="left", fontsize=11, color=_INK, y=1.02)
    axes.set_xlabel("Exposed plan diameter D [m]", color=_INK)
    axes.set_ylabel(label, color=_INK)
    axes.grid(color="#e4ddd5", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(colors=_INK, length=0)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color("#b9aea2")


def _power_of_ten(value: float, _: int | None) -> str:
    exponent = str(round(math.log10(value)))
    return "10" + exponent.translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _limit(axes: Axes, part: dict[str, Any], quantity: str, area: float) -> None:
    """Show down to half an expected rock: beyond, a cumulative law falls to zero."""
    curve = part["curve"]
    expected = [number * area for number in curve["number_expected"]]
    last = max((n for n, count in enumerate(expected) if count >= 0.5), default=0)
    lowest, highest = curve[f"{quantity}_expected"][last], curve[f"{quantity}_expected"][0]
    if lowest > _LEAST:
        axes.set_ylim(0.6 * lowest, 1.8 * highest)
    possible = [
        d for d, high in zip(curve["diameter_m"], curve["number_high"], strict=True) if high
    ]
    axes.set_xlim(0.95 * curve["diameter_m"][0], 1.1 * possible[-1] if possible else None)
