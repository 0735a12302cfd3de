"""Repairs of a DTM's samples: holes are filled, stairs of coarse integers are smoothed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask

FILL_METHOD = "inverse-distance interpolation from the rim (GDAL FillNodata)"

_WIDTHS = (24.0, 12.0, 6.0, 3.0, 1.5)  # of the Gaussians that find the way, coarse to fine [posts]
_ROUNDS = 8
_POLISH = 300


def farthest_filled(valid: Mask, inside: tuple[NDArray[np.intp], ...]) -> tuple[int, int, int]:
    """Width [samples] of the widest hole of a site, and row and column of its middle.

    It is the diameter of the largest circle around a sample of the site that reaches no valid one.

    Args:
        valid: samples that are no holes, of the site and around it.
        inside: index of the site's samples.
    """
    from scipy.ndimage import distance_transform_edt

    distance = distance_transform_edt(~valid)[inside]
    n, m = np.unravel_index(int(np.argmax(distance)), distance.shape)
    width = int(np.ceil(2.0 * distance[n, m] - 1.0))
    return width, int(inside[0].ravel()[n]), int(inside[1].ravel()[m])


def fill_holes(heights: Array, valid: Mask) -> Array:
    """Heights whose holes are filled by `FILL_METHOD`; valid ones keep their bits."""
    if valid.all():
        return heights
    from rasterio.fill import fillnodata

    middle = np.median(heights[valid])  # keeps float32 precise inside GDAL
    relative = np.where(valid, heights - middle, 0.0).astype(np.float32)
    filled = fillnodata(relative, mask=valid, max_search_distance=float(max(heights.shape)))
    return np.where(valid, heights, filled + middle)


def destair(heights: Array, quantum: float) -> Array:
    """The smoothest ground whose heights all round to the given integer ones.

    Each height stays within half a quantum. Gaussians from wide to narrow find the way across the
    treads, then steps down the bending energy ½·Σ(∇²z)² polish it; after each step the heights are
    put back between their bounds, so that the result is always feasible.

    Args:
        heights: multiples of the quantum, shifted [m].
        quantum: height step of one unit [m].
    """
    from scipy.ndimage import gaussian_filter, laplace

    low, high = heights - 0.5 * quantum, heights + 0.5 * quantum
    smooth = heights
    for width in _WIDTHS:
        for _ in range(_ROUNDS):
            smooth = np.clip(gaussian_filter(smooth, width, mode="nearest"), low, high)
    for _ in range(_POLISH):
        bending = laplace(laplace(smooth, mode="nearest"), mode="nearest")
        smooth = np.clip(smooth - bending / 64.0, low, high)
    return np.asarray(smooth)
