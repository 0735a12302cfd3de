"""The ground that the 3-D view shows: fewer nodes of it, and what it is painted with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import Heightfield

_MOST_PIXELS = 512
_STEEP = 30.0
_LIGHT = np.array([-0.5, 0.5, 0.7071])
_DARKEST = 0.55
_SLOPES = ((46, 125, 80), (235, 210, 90), (214, 96, 48), (120, 22, 60))
_HEIGHTS = ((38, 48, 110), (40, 130, 140), (120, 190, 110), (245, 225, 130), (250, 246, 235))
MOST_CELLS = 256
"""Cells of the shown ground along its longer side."""


@dataclass(frozen=True, eq=False)
class Overlay:
    """A picture of the area in the colours of a scale."""

    name: str
    """What it shows."""
    pixels: NDArray[np.uint8]
    """SRGB, north up, shape [height, width, 3]."""
    colours: tuple[tuple[int, int, int], ...]
    """Colours of the scale, evenly from its low to its high end."""
    ends: tuple[str, str]
    """What the ends of the scale stand for."""


def overlays(ground: Heightfield) -> tuple[Overlay, ...]:
    """Slope and height of the ground, both shaded from the north-west.

    Slopes are taken over the grid's own spacing; a picture that is coarser than the grid shows
    some of its nodes.
    """
    step = -(-max(ground.shape) // _MOST_PIXELS)
    normals = _normals(ground, step)
    heights = ground.elevation[::step, ::step].astype(np.float64)
    shade = _DARKEST + (1.0 - _DARKEST) * np.clip(normals @ _LIGHT, 0.0, 1.0)
    slope = np.degrees(np.arccos(np.clip(normals[..., 2], -1.0, 1.0)))
    low, high = float(heights.min()), float(heights.max())
    ends = f"{low:.1f} m".replace("-", "\u2212"), f"{high:.1f} m".replace("-", "\u2212")
    level = (heights - low) / max(high - low, 1e-9)
    return (
        Overlay("Slope", _paint(slope / _STEEP, shade, _SLOPES), _SLOPES, ("0°", f"{_STEEP:g}° +")),
        Overlay("Height", _paint(level, shade, _HEIGHTS), _HEIGHTS, ends),
    )


def _normals(ground: Heightfield, step: int) -> Array:
    """Unit normals at every `step`th node, from central differences of its neighbours."""
    rows, columns = (np.arange(0, nodes, step) for nodes in ground.shape)
    south, north = np.maximum(rows - 1, 0), np.minimum(rows + 1, ground.shape[0] - 1)
    west, east = np.maximum(columns - 1, 0), np.minimum(columns + 1, ground.shape[1] - 1)
    z = ground.elevation
    to_east = z[np.ix_(rows, east)].astype(np.float64) - z[np.ix_(rows, west)]
    to_north = z[np.ix_(north, columns)].astype(np.float64) - z[np.ix_(south, columns)]
    x = -to_east / ((east - west) * ground.spacing)
    y = -to_north / ((north - south)[:, None] * ground.spacing)
    normals = np.stack([x, y, np.ones_like(x)], axis=-1)
    return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))


def _paint(
    level: Array, shade: Array, colours: tuple[tuple[int, int, int], ...]
) -> NDArray[np.uint8]:
    """Colours of a scale from 0 to 1, darker where shaded, turned north up."""
    stops = np.linspace(0.0, 1.0, len(colours))
    painted = [np.interp(level, stops, channel) * shade for channel in zip(*colours, strict=True)]
    return np.stack(painted, axis=-1).round().astype(np.uint8)[::-1]


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
