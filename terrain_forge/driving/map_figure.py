"""The map that tracks are drawn on: shaded ground and rocks."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection

from terrain_forge.base import Array
from terrain_forge.model import World

PATH, TRACK, INK, HIT = "#f2c230", "#1668a8", "#4a433d", "#c0392b"
"""Colours of the planned path, the driven track, the text, and what was hit."""
_MAP_NODES = 800
_SMALLEST_SHOWN = 0.3
_MARGIN = 4.0


def draw_ground(axes: Axes, world: World, *, touched: Collection[str], around: Array) -> None:
    """Draw the shaded ground and the rocks that a map of this size can show.

    Args:
        axes: where to draw.
        world: the world.
        touched: names of rocks that are shown in the colour of hits.
        around: points that the map shows, with a margin [m], shape [points, 2].
    """
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
    _draw_rocks(axes, world, touched)
    low = np.maximum(around.min(0) - _MARGIN, ground.bounds[:2])
    high = np.minimum(around.max(0) + _MARGIN, ground.bounds[2:])
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
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
    return np.asarray(normal @ towards_sun)
