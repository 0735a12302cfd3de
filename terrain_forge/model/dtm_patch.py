"""The piece of a DTM that a site is made from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Record


@dataclass(frozen=True, kw_only=True, eq=False)
class DtmPatch(Record):
    """Heights of a DTM over a site and its context, holes filled, in the source's grid."""

    heights: NDArray[np.float64]
    """Heights above the body's datum [m], shape [rows, columns], in the source's row order."""
    to_pixel: tuple[float, ...]
    """Affine (a, b, c, d, e, f): column = a·x + b·y + c, row = d·x + e·y + f, where x, y are source
    coordinates and whole numbers are sample centres."""
    crs: str
    """WKT of the source's CRS; empty where x, y are the site's own metres."""
    wrap: tuple[float, float]
    """Period of x where a meridian has several x (0 where not), and the x around which they are."""
    posting: float
    """Distance of the samples on the ground [m], the coarser of the two directions."""
    filled: int
    """Samples within the site that were holes."""
    repairs: tuple[str, ...] = ()
    """What was repaired and how, for the report."""
    planar_fraction: float = 0.0
    """Part of the samples in and around the site that lie in exact planes, as triangles that fill
    gaps of stereo images do, 0 to 1."""

    noise: float = 0.0
    """RMS noise that was found in the DTM and taken away [m]."""

    def __post_init__(self) -> None:
        self.freeze("heights", np.float64, ("rows", "columns"))
