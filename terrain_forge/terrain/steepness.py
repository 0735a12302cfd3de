"""How steep the ground is over a baseline."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array


def stencil_cells(baseline: float, spacing: float) -> int:
    """Cells from a node to each end of a baseline [m] that is centred on it, at least 1."""
    return max(1, round(0.5 * baseline / spacing))


def steepness(elevation: Array, cells: int, spacing: float) -> Array:
    """Rise per metre of the steepest way up at each node, shape [rows, columns].

    From differences over so many cells to either side, fewer at the border.

    Args:
        elevation: heights of the nodes [m].
        cells: half of the baseline, in cells.
        spacing: distance of the nodes [m].
    """
    east = _differences(elevation, cells, spacing)
    north = _differences(elevation.T, cells, spacing).T
    return np.asarray(np.sqrt(east * east + north * north))


def _differences(elevation: Array, cells: int, spacing: float) -> Array:
    """Rise per metre along the columns."""
    index = np.arange(elevation.shape[1])
    low, high = np.maximum(index - cells, 0), np.minimum(index + cells, len(index) - 1)
    return np.asarray((elevation[:, high] - elevation[:, low]) / ((high - low) * spacing))
