"""From the DTM's own grid to the site's: pointwise projection, then our own kernel."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array
from terrain_forge.dtm.conservative import FAR, add_cell_means
from terrain_forge.dtm.lattice import Nodes, PixelFrame, node_places
from terrain_forge.model import Site, Window


def dtm_heights(*, site: Site, window: Window) -> Array:
    """Heights of the DTM above the site's datum at the window's nodes [m], shape [rows, columns].

    Their mean over each pixel of the DTM is its post. Levelling is applied; a flat site is zero
    everywhere.
    """
    east, north = site.axes(window)
    heights = np.zeros((north.size, east.size))
    if site.dtm is None:
        return heights
    add_cell_means(
        heights,
        site.dtm.heights,
        places=node_places(site, Nodes.of(window)),
        cell=PixelFrame.of(site).extent(site.spacing),
        reach=FAR,
    )
    heights -= site.datum_height
    heights -= site.slope[0] * east[None, :]
    heights -= site.slope[1] * north[:, None]
    return heights
