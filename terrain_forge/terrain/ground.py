"""The ground of a window: the DTM on the site's lattice, then the layers in the recipe's order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.dtm.gridify import dtm_heights
from terrain_forge.site import Site, Window
from terrain_forge.terrain.layer import Layer
from terrain_forge.world import Heightfield


def shape_ground(*, site: Site, window: Window, layers: tuple[Layer, ...]) -> Heightfield:
    """The bare ground at the window's nodes."""
    east, north = site.axes(window)
    elevation = dtm_heights(site=site, window=window)
    for layer in layers:
        elevation = elevation + layer.relief(site=site, window=window, elevation=elevation)
    return Heightfield(
        elevation=_checked(elevation),
        spacing=site.spacing,
        origin=(float(east[0]), float(north[0])),
    )


def _checked(elevation: NDArray[np.float64]) -> NDArray[np.float32]:
    if not np.isfinite(elevation).all():
        raise ValueError("the ground holds values that are not finite")
    return elevation.astype(np.float32)
