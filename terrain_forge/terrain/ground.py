"""The ground of a window: the DTM on the site's lattice, then the layers in the recipe's order."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import checked, is_ours, returning
from terrain_forge.dtm import dtm_heights
from terrain_forge.model import Heightfield, Site, Window
from terrain_forge.terrain.layer import Layer

STRIP = 1024
"""Most rows of cells that are worked on at once in double precision."""
_HIGHEST = 1e6
"""Heights beyond it are no ground's of any body, and soon none that floats of files hold [m]."""


@checked
def shape_ground(*, site: Site, window: Window, layers: tuple[Layer, ...]) -> Heightfield:
    """The bare ground at the window's nodes."""
    east, north = site.axes(window)
    elevation = np.empty((north.size, east.size), np.float32)
    for strip in window.strips(STRIP):
        first = strip.row - window.row
        elevation[first : first + strip.rows + 1] = _shape(site, strip, layers)
    return Heightfield(
        elevation=elevation, spacing=site.spacing, origin=(float(east[0]), float(north[0]))
    )


def _shape(site: Site, window: Window, layers: tuple[Layer, ...]) -> NDArray[np.float64]:
    """Heights of a strip's nodes, made with the ground around it that its layers look at."""
    margin = sum(_margin(site, layer) for layer in layers)
    around = site.padded(window, margin) if margin > 0.0 else window
    elevation = dtm_heights(site=site, window=around)
    _require_finite(elevation, "the DTM")
    for number, layer in enumerate(layers):
        seen = elevation.view()
        # Kernels of ours are compiled for arrays that could be written.
        seen.flags.writeable = is_ours(type(layer).__module__)
        what = f"layer {layer.kind!r} (terrain.layers[{number}]): relief"
        with returning(layer, what, "a finite height [m] for each node, shape [rows, columns]"):
            elevation += layer.masked_relief(site=site, window=around, elevation=seen)
            _require_finite(elevation, f"terrain.layers[{number}] ({type(layer).__name__})")
    return elevation[window.nodes_in(around)]


def _margin(site: Site, layer: Layer) -> float:
    """How far around a node a layer looks at the ground [m]."""
    with returning(layer, f"layer {layer.kind!r}: reach", "a finite length of at least 0 [m]"):
        if not 0.0 <= (reach := layer.reach(site)) < math.inf:
            raise ValueError(f"found {reach:g}")
    return layer.margin(site)


def _require_finite(elevation: NDArray[np.float64], made_by: str) -> None:
    if not (np.abs(elevation) <= _HIGHEST).all():
        raise ValueError(f"{made_by} makes heights that are not finite or beyond {_HIGHEST:g} m")
