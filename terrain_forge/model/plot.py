"""Drawing worlds and sites from above: relief, rocks, paths. Imports Matplotlib when it draws."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from terrain_forge.model.site import Site
    from terrain_forge.model.world import World

_PIXELS = 900
"""Nodes of the ground that are drawn each way; rocks of less than one are not."""
_ALTITUDE, _AZIMUTH = np.radians(40.0), np.radians(315.0)
_LEVEL, _CONTRAST = 0.5, 0.7
"""Mean of the colours of level ground, 0 to 1, and the power of the light on it."""
_PATHS = "#d5f000", "#00d5ff", "#ff7ad9", "#ffffff"
_ROCK, _BARE = "#2b2320", "#c9c2ba"


def plot_world(world: World, axes: Axes | None = None) -> Axes:
    """Draw the ground lit from the north-west, the rocks as circles of their diameters, the paths.

    Args:
        world: The world.
        axes: Where to draw; new axes of pyplot by default.

    Returns:
        The axes, in metres east and north.
    """
    axes = _axes(axes)
    step = max(1, -(-max(world.ground.shape) // _PIXELS))
    west, south, east, north = world.ground.bounds
    axes.imshow(_shaded(world, step), extent=(west, east, south, north), origin="lower", zorder=0)
    smallest = max(east - west, north - south) / _PIXELS
    shown = world.field.diameter >= smallest
    _draw_circles(axes, world.field.position[shown, :2], world.field.diameter[shown])
    _draw_paths(axes, {path.name: path.position for path in world.trajectories})
    rocks = f"{len(world.field):,} rock{'s' * (len(world.field) != 1)}"
    title = f"{world.site.name}: {rocks} on {east - west:g} × {north - south:g} m"
    axes.set(xlim=(west, east), ylim=(south, north), title=title)
    axes.title.set_parse_math(False)
    return axes


def plot_site(site: Site, axes: Axes | None = None) -> Axes:
    """Draw what is known of a site before there is ground: its area, routes and exclusion zones."""
    axes = _axes(axes)
    for zone in site.exclusion_zones:
        _draw_circles(axes, np.array([zone.centre]), np.array([2.0 * zone.radius]), hollow=True)
    plot_area(axes, site.size, {route.name: route.position for route in site.routes})
    return axes


def plot_area(axes: Axes, size: tuple[float, float], paths: Mapping[str, Array]) -> None:
    """Draw a bare area with paths by their names, shape [points, 2]."""
    axes.set_facecolor(_BARE)
    _draw_paths(axes, paths)
    half = 0.5 * size[0], 0.5 * size[1]
    axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]))


@own_style()
def write_plot(world: World, path: Path, *, note: str, software: str) -> None:
    """Write `plot_world` as PNG, with a note under its title and what the file says made it."""
    west, south, east, north = world.ground.bounds
    figure, axes = _figure((east - west, north - south), width=9.0)
    plot_world(world, axes)
    axes.set_title(f"{axes.get_title()}\n{note}", fontsize=10)
    quickly = {"compress_level": 1}
    figure.savefig(path, metadata={"Software": software}, pil_kwargs=quickly)


@own_style()
def html(summary: str, size: tuple[float, float], draw: Callable[[Axes], Any]) -> str:
    """A line and a picture of an area of a size [m], for notebooks."""
    figure, axes = _figure(size, width=5.0)
    draw(axes)
    kept = io.BytesIO()
    figure.savefig(kept, format="png", metadata={"Software": None})
    return html_picture(summary, kept.getvalue())


def html_picture(summary: str, png: bytes) -> str:
    """A line and a PNG, for notebooks; the line alone, where there is no picture."""
    source = f"data:image/png;base64,{b64encode(png).decode()}"
    picture = f'<br><img alt="" style="max-width: 640px" src="{source}">' if png else ""
    return f"<div>{escape(summary)}{picture}</div>"


def _axes(given: Axes | None) -> Axes:
    """The axes that are given, or new ones.

    Raises:
        DataError: if these are no axes.
    """
    if given is not None and not hasattr(given, "imshow"):
        raise DataError(f"axes must be Matplotlib's Axes, found a {type(given).__name__}")
    return given or _new_axes()


def _new_axes() -> Axes:
    from matplotlib import pyplot

    return pyplot.subplots()[1]


def _figure(size: tuple[float, float], *, width: float) -> tuple[Figure, Axes]:
    """A figure that pyplot knows nothing of, for an area of a size [m]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    left, right, below, above = 0.8, 0.2, 0.6, 0.55  # inches for labels and title
    inner = width - left - right
    tall = min(max(inner * size[1] / size[0], 1.0), 2.0 * inner)
    height = below + tall + above
    figure = Figure(figsize=(width, height), dpi=100)
    FigureCanvasAgg(figure)
    place = left / width, below / height, inner / width, tall / height
    return figure, figure.add_axes(place)


def _shaded(world: World, step: int) -> NDArray[np.float64]:
    """The ground's colours under light from the north-west, 0 to 1, a node in `step` each way."""
    heights = world.ground.elevation[::step, ::step].astype(np.float64)
    if min(heights.shape) < 2:
        return np.full((*heights.shape, 3), 0.7)
    north, east = np.gradient(heights, world.ground.spacing * step)
    towards = np.array([np.sin(_AZIMUTH), np.cos(_AZIMUTH)]) * np.cos(_ALTITUDE)
    light = (np.sin(_ALTITUDE) - east * towards[0] - north * towards[1]) / np.sqrt(
        1.0 + east**2 + north**2
    )
    colours: Array = world.appearance.ground_rgb[::step, ::step] / 255.0
    bright = colours * (_LEVEL / max(float(colours.mean()), 1e-6))
    shade = np.clip(light / np.sin(_ALTITUDE), 0.05, 2.0) ** _CONTRAST
    return np.asarray(np.clip(bright * shade[..., None], 0.0, 1.0))


def _draw_circles(axes: Axes, centres: Array, diameters: Array, *, hollow: bool = False) -> None:
    from matplotlib.collections import EllipseCollection

    style = {"facecolors": "none", "edgecolors": _ROCK} if hollow else {"facecolors": _ROCK}
    circles = EllipseCollection(
        diameters,
        diameters,
        np.zeros(len(diameters)),
        units="xy",
        offsets=centres,
        offset_transform=axes.transData,
        linewidths=0.8 if hollow else 0.0,
        **style,
    )
    axes.add_collection(circles, autolim=False)


def _draw_paths(axes: Axes, paths: Mapping[str, Array]) -> None:
    for number, (name, points) in enumerate(paths.items()):
        colour = _PATHS[number % len(_PATHS)]
        axes.plot(*points[:, :2].T, color=colour, lw=1.6, label=" " * name.startswith("_") + name)
        axes.plot(*points[0, :2], color=colour, marker="o", ms=5, mec="black")
    if paths:
        style = {"fontsize": "small", "facecolor": "#555555", "labelcolor": "white"}
        for text in axes.legend(loc="upper right", **style).get_texts():
            text.set_parse_math(False)
    axes.set(aspect="equal", xlabel="East [m]", ylabel="North [m]")
