"""The bare ground: a grid of nodes and the surface that triangulates it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, DataError, Record, checked, require_alike, shaped

Bounds = tuple[float, float, float, float]
"""West, south, east, north edge [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Heightfield(Record):
    """A grid of nodes; the surface triangulates it, cells cut south-west to north-east."""

    elevation: NDArray[np.float32] = field(metadata=shaped("rows", "columns", dtype=np.float32))
    """Heights [m], shape [rows, columns]; rows run north, columns run east."""
    spacing: Annotated[float, Gt(0)]
    """Distance of neighbouring nodes [m]."""
    origin: tuple[float, float]
    """East and north coordinate [m] of the first node of the first row."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of nodes."""
        return self.elevation.shape[0], self.elevation.shape[1]

    @property
    def east(self) -> Array:
        """East coordinates of the columns [m]."""
        return self.origin[0] + np.arange(self.shape[1], dtype=np.float64) * self.spacing

    @property
    def north(self) -> Array:
        """North coordinates of the rows [m]."""
        return self.origin[1] + np.arange(self.shape[0], dtype=np.float64) * self.spacing

    @property
    def bounds(self) -> Bounds:
        """West, south, east, north edge [m]."""
        west, south = self.origin
        rows, columns = self.shape
        return west, south, west + (columns - 1) * self.spacing, south + (rows - 1) * self.spacing

    @checked
    def covers(self, east: ArrayLike, north: ArrayLike) -> NDArray[np.bool_]:
        """Which points lie on the grid (edges count, to a billionth of a cell).

        Raises:
            DataError: for numbers of shapes that do not go together.
        """
        require_alike(east=east, north=north)
        column = (np.asarray(east, np.float64) - self.origin[0]) / self.spacing
        row = (np.asarray(north, np.float64) - self.origin[1]) / self.spacing
        rows, columns = self.shape
        slack = 1e-9
        inside_east = (column >= -slack) & (column <= columns - 1 + slack)
        return inside_east & (row >= -slack) & (row <= rows - 1 + slack)

    @checked
    def holds(self, points: Array, *, margin: float) -> bool:
        """Whether all points, shape [n, 2], lie at least `margin` [m] within the grid.

        Raises:
            DataError: for points of another shape.
        """
        if points.ndim != 2 or points.shape[1] != 2:
            raise DataError(f"points of shape {points.shape}: a pair for each point")
        west, south, east, north = self.bounds
        low, high = np.array([west, south]) + margin, np.array([east, north]) - margin
        return bool(np.all((points >= low) & (points <= high)))

    @checked
    def height_at(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Height [m] of the triangulated surface under points of the grid [m].

        Raises:
            DataError: if a point lies outside the grid.
        """
        if not np.all(self.covers(east, north)):
            raise DataError(f"point outside the grid (west, south, east, north: {self.bounds})")
        column = (np.asarray(east, np.float64) - self.origin[0]) / self.spacing
        row = (np.asarray(north, np.float64) - self.origin[1]) / self.spacing
        rows, columns = self.shape
        i = np.clip(np.floor(column).astype(np.int64), 0, columns - 2)
        j = np.clip(np.floor(row).astype(np.int64), 0, rows - 2)
        u, v = column - i, row - j
        z = self.elevation
        sw, se = z[j, i].astype(np.float64), z[j, i + 1].astype(np.float64)
        nw, ne = z[j + 1, i].astype(np.float64), z[j + 1, i + 1].astype(np.float64)
        below = sw + u * (se - sw) + v * (ne - se)
        above = sw + v * (nw - sw) + u * (ne - nw)
        return np.asarray(np.where(u >= v, below, above))

    @checked
    def cut(self, *, column: int, row: int, columns: int, rows: int) -> Heightfield:
        """The sub-grid that starts at node (column, row) and has so many cells each way.

        Raises:
            DataError: if it has none, or does not lie in the grid.
        """
        height, width = self.shape
        inside = 0 <= column < column + columns < width and 0 <= row < row + rows < height
        if not inside:
            raise DataError(
                f"columns {column} to {column + columns} and rows {row} to {row + rows} of nodes: "
                f"the grid has columns 0 to {width - 1} and rows 0 to {height - 1}"
            )
        origin = (self.origin[0] + column * self.spacing, self.origin[1] + row * self.spacing)
        nodes = self.elevation[row : row + rows + 1, column : column + columns + 1]
        return Heightfield(elevation=nodes, spacing=self.spacing, origin=origin)
