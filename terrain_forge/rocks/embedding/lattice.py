"""Ground on the lattice of its site: a place has the same height in every window, bit for bit."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner
from terrain_forge.model import Heightfield


class Lattice(NamedTuple):
    """A grid of ground, placed on the lattice of its site, whichever window it was made for."""

    elevation: NDArray[np.float32]
    """Heights of the nodes [m], rows run north, shape [rows, columns]."""
    spacing: float
    """Distance of neighbouring nodes [m]."""
    fraction: tuple[float, float]
    """Where the lattice's nodes lie, east and north, in parts of a cell."""
    corner: tuple[int, int]
    """Whole cells from the site's origin to the south-western node."""


def lattice(ground: Heightfield) -> Lattice:
    """The ground on the lattice of its site."""
    # In cells, and rounded, the origin of every window of a site has the same fraction of a cell.
    east, north = np.round(np.array(ground.origin) / ground.spacing, 6).tolist()
    corner = math.floor(east), math.floor(north)
    fraction = east - corner[0], north - corner[1]
    return Lattice(ground.elevation, ground.spacing, fraction, corner)


def piece(grid: Lattice, *, centre: Array, half_width: float) -> tuple[Heightfield, Array]:
    """A square of the ground around a point, in coordinates of its own.

    It goes `half_width` [m] around it at least, as far as the ground goes.

    Returns:
        The piece, relative to a place near the point; that place's east, north and height [m],
        shape [3]. Both are the same, bit for bit, whatever part of the site the ground is.
    """
    fraction, corner = np.array(grid.fraction), np.array(grid.corner)
    cell = np.floor(centre / grid.spacing - fraction).astype(np.int64)
    around = int(np.ceil(half_width / grid.spacing))
    rows, columns = grid.elevation.shape
    last = np.array([columns - 1, rows - 1])
    low = np.clip(cell - around - corner, 0, last - 1)
    high = np.clip(cell + 1 + around - corner, 1, last)
    nodes = grid.elevation[low[1] : high[1] + 1, low[0] : high[0] + 1]
    base = float(nodes.min())
    west, south = ((low + corner - cell) * grid.spacing).tolist()
    place = np.array([*((cell + fraction) * grid.spacing), base])
    relative = (nodes.astype(np.float64) - base).astype(np.float32)
    return Heightfield(elevation=relative, spacing=grid.spacing, origin=(west, south)), place


@inner
def onto(grid, x, y):  # type: ignore[no-untyped-def]
    """The nearest point of the grid's rectangle [m]."""
    rows, columns = grid.elevation.shape
    west, south = grid.corner[0] + grid.fraction[0], grid.corner[1] + grid.fraction[1]
    east, north = west + (columns - 1), south + (rows - 1)
    x, y = max(x, west * grid.spacing), max(y, south * grid.spacing)
    return min(x, east * grid.spacing), min(y, north * grid.spacing)


@inner
def height(grid, x, y):  # type: ignore[no-untyped-def]
    """Height [m] of the triangulated ground, cells cut from south-west to north-east."""
    elevation = grid.elevation
    rows, columns = elevation.shape
    u, v = x / grid.spacing - grid.fraction[0], y / grid.spacing - grid.fraction[1]
    i = max(min(int(np.floor(u)) - grid.corner[0], columns - 2), 0)
    j = max(min(int(np.floor(v)) - grid.corner[1], rows - 2), 0)
    u, v = u - (i + grid.corner[0]), v - (j + grid.corner[1])
    sw, ne = np.float64(elevation[j, i]), np.float64(elevation[j + 1, i + 1])
    # The south-eastern triangle or the other, without a branch: it would be mispredicted often.
    middle = np.float64(elevation[j + (u < v), i + (u >= v)])
    return sw + max(u, v) * (middle - sw) + min(u, v) * (ne - middle)
