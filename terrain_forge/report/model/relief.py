"""The ground that the 3-D view shows: fewer nodes over the same area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import Heightfield

MOST_CELLS = 256
"""Cells of the shown ground along its longer side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relief:
    """A coarser grid over a ground's whole area; its cells need not be square."""

    unit: Heightfield
    """Its heights [m] over a grid whose cells measure 1 and which begins at 0."""
    cell: tuple[float, float]
    """Length of its cells along east and north [m]."""
    corner: tuple[float, float]
    """East and north of its first node [m]."""

    def height_at(self, points: Array) -> Array:
        """Height [m] of its surface under points, shape [n, 2]; at its edge for those beyond."""
        rows, columns = self.unit.shape
        cells = (points - self.corner) / self.cell
        inside = np.clip(cells, 0.0, (columns - 1, rows - 1))
        return self.unit.height_at(inside[:, 0], inside[:, 1])

    def vertices(self) -> NDArray[np.float32]:
        """Its nodes in the world frame [m], row by row from the south-west, shape [nodes, 3]."""
        rows, columns = self.unit.shape
        nodes = np.empty((rows, columns, 3), np.float32)
        nodes[..., 0] = self.corner[0] + self.cell[0] * np.arange(columns)
        nodes[..., 1] = (self.corner[1] + self.cell[1] * np.arange(rows))[:, None]
        nodes[..., 2] = self.unit.elevation
        return nodes.reshape(-1, 3)

    def texture_coordinates(self) -> NDArray[np.float32]:
        """Where its nodes lie in a picture of the area, v downwards, shape [nodes, 2]."""
        rows, columns = self.unit.shape
        u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(1, 0, rows))
        return np.stack([u, v], axis=-1, dtype=np.float32).reshape(-1, 2)


def coarsen(ground: Heightfield, cells: int = MOST_CELLS) -> Relief:
    """The ground at nodes as far apart as `cells` along its longer side make them, or its own."""
    west, south, east, north = ground.bounds
    rows, columns = ground.shape
    step = max(max(rows, columns) - 1, 1) / cells
    number = [1 + max(1, round((nodes - 1) / max(step, 1.0))) for nodes in (columns, rows)]
    x, y = np.linspace(west, east, number[0]), np.linspace(south, north, number[1])
    elevation = ground.height_at(*np.meshgrid(x, y))
    return Relief(
        unit=Heightfield(elevation=elevation.astype(np.float32), spacing=1.0, origin=(0.0, 0.0)),
        cell=((east - west) / (number[0] - 1), (north - south) / (number[1] - 1)),
        corner=(west, south),
    )
