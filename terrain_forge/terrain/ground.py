"""The ground of a window: the DTM on the site's lattice, then the layers in the recipe's order."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terrain_forge.dtm import dtm_heights
from terrain_forge.model import Heightfield, Site, Window
from terrain_forge.terrain.layer import Layer

STRIP = 1024
"""Most rows that are worked on at once in double precision."""


def shape_ground(*, site: Site, window: Window, layers: tuple[Layer, ...]) -> Heightfield:
    """The bare ground at the window's nodes."""
    east, north = site.axes(window)
    elevation = np.empty((north.size, east.size), np.float32)
    strips = -(-north.size // STRIP)
    for first, last in pairwise(north.size * n // strips for n in range(strips + 1)):
        strip = _strip(window, first, last - first)
        elevation[first:last] = _shape(site, strip, layers)[: last - first]
    return Heightfield(
        elevation=elevation, spacing=site.spacing, origin=(float(east[0]), float(north[0]))
    )


def _strip(window: Window, first: int, rows: int) -> Window:
    """Some rows of nodes of a window, two at least, since a window has cells."""
    return Window(
        column=window.column,
        row=window.row + first,
        columns=window.columns,
        rows=max(rows - 1, 1),
    )


def _shape(site: Site, window: Window, layers: tuple[Layer, ...]) -> NDArray[np.float64]:
    """Heights of a strip's nodes, made with the ground around it that its layers look at."""
    margin = sum(layer.margin(site) for layer in layers)
    around = site.padded(window, margin) if margin > 0.0 else window
    elevation = dtm_heights(site=site, window=around)
    for layer in layers:
        elevation += layer.masked_relief(site=site, window=around, elevation=elevation)
    if not np.isfinite(elevation).all():
        raise ValueError(f"{_culprit(site, around, layers)} makes heights that are not finite")
    south, west = window.row - around.row, window.column - around.column
    return elevation[south : south + window.rows + 1, west : west + window.columns + 1]


def _culprit(site: Site, window: Window, layers: tuple[Layer, ...]) -> str:
    """What first makes a height that is not finite."""
    elevation = dtm_heights(site=site, window=window)
    if not np.isfinite(elevation).all():
        return "the DTM"
    for number, layer in enumerate(layers):
        elevation += layer.masked_relief(site=site, window=window, elevation=elevation)
        if not np.isfinite(elevation).all():
            return f"terrain.layers[{number}] ({type(layer).__name__})"
    raise AssertionError("all heights are finite")
