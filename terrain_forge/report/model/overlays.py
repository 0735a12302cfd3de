"""What the ground of the 3-D view can be painted with instead of its picture: slope and height."""

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


@dataclass(frozen=True)
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
