"""The ground's collision as a grey image: what Gazebo calls a heightmap, and what it loses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, ExportError, image_rows, portable
from terrain_forge.model import Heightfield
from terrain_forge.writers import Lines, element, leaves, write_png

from .model import Model, surface

IMAGE = "materials/textures/heights.png"
LARGEST = 4097
"""Samples each way that this export goes up to."""
_ROWS = 256
"""Rows that are looked at together."""
_MOVED = 1e-6
"""What a heightmap may be off its place [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Heightmap:
    """Heights as whole numbers on a square grid over the whole ground."""

    pixels: NDArray[Any]
    """uint8 or uint16, from 0 to the type's largest, rows run north, shape [samples, samples]."""
    lowest: float
    """Height of 0 [m]."""
    span: float
    """Height of the largest pixel above it [m]."""
    resampled: bool
    """Whether the samples are not the ground's own nodes."""

    @property
    def quantum(self) -> float:
        """Height of one grey level [m]."""
        return self.span / float(np.iinfo(self.pixels.dtype).max)


def make_heightmap(ground: Heightfield, *, bits: int) -> Heightmap:
    """The ground on the smallest square grid of 2^n + 1 samples that is not coarser than its own.

    Raises:
        ExportError: if that grid would be too large.
    """
    finest = max(ground.shape)
    if finest > LARGEST:
        cells = " × ".join(str(nodes - 1) for nodes in reversed(ground.shape))
        raise ExportError(
            f"a ground of {cells} cells is too large for a heightmap: at most {LARGEST - 1} each "
            "way; choose `ground: mesh`, a smaller size_m or a coarser spacing_m"
        )
    samples = 2 ** max(int(np.ceil(portable.log2(finest - 1))), 1) + 1
    resampled = ground.shape != (samples, samples)
    west, south, east, north = ground.bounds
    x, y = np.linspace(west, east, samples), np.linspace(south, north, samples)
    heights = _sampled(ground, x, y) if resampled else ground.elevation.astype(np.float64)
    lowest, span = float(heights.min()), float(np.ptp(heights)) or 1.0
    largest = 2**bits - 1
    grey = np.rint((heights - lowest) * (largest / span))
    kind = np.uint8 if bits == 8 else np.uint16
    return Heightmap(pixels=grey.astype(kind), lowest=lowest, span=span, resampled=resampled)


def heightmap_error(heightmap: Heightmap, ground: Heightfield) -> float:
    """The largest difference of a heightmap's surface from the ground at its nodes [m]."""
    heights = heightmap.lowest + heightmap.pixels * heightmap.quantum
    found = Heightfield(elevation=heights, spacing=1.0, origin=(0.0, 0.0))
    y, x = (np.linspace(0.0, len(heights) - 1, nodes) for nodes in ground.shape)
    return float(np.abs(_sampled(found, x, y) - ground.elevation).max())


def cut_error(ground: Heightfield) -> float:
    """How far cells cut from north-west to south-east are off ours, in their middle [m]."""
    z = ground.elevation.astype(np.float64)
    return float(np.abs(z[:-1, :-1] + z[1:, 1:] - z[:-1, 1:] - z[1:, :-1]).max() / 2.0)


def write_heightmap(
    heightmap: Heightmap, ground: Heightfield, model: Model, *, friction: float
) -> Lines:
    """Write the image; returns the collision.

    gz-physics spreads the samples over size · (samples - 1) / samples, so that its size is more
    than the ground's, and takes the place from the collision's pose alone: gz-sim leaves `pos` out.
    Classic's ODE takes the size as it is and of the place only the z of `pos`.

    Raises:
        ExportError: if Classic would move the heightmap.
    """
    west, south, east, north = ground.bounds
    samples, classic = len(heightmap.pixels), model.classic
    middle = (west + east) / 2, (south + north) / 2
    if classic and max(map(abs, middle)) > _MOVED:
        raise ExportError(
            f"Gazebo Classic puts a heightmap's middle at the origin, the ground's is at "
            f"{middle[0]:g}, {middle[1]:g} m; choose `ground: mesh`"
        )
    write_png(model.path(IMAGE), image_rows(heightmap.pixels))
    grown = 1.0 if classic else samples / (samples - 1)
    shape = leaves(
        uri=model.uri(IMAGE),
        size=((east - west) * grown, (north - south) * grown, heightmap.span),
        pos=(0, 0, heightmap.lowest if classic else 0),
        sampling=1,
    )
    pose = [] if classic else element("pose", (*middle, heightmap.lowest, 0, 0, 0))
    body = element("geometry", element("heightmap", *shape))
    return element("collision", pose, body, surface(friction), name="ground_heightmap")


def heightmap_losses(heightmap: Heightmap, ground: Heightfield) -> list[str]:
    """What the heightmap does not say of the ground."""
    bits = 8 * heightmap.pixels.dtype.itemsize
    samples = len(heightmap.pixels)
    kind = "at the ground's own nodes"
    if heightmap.resampled:
        kind = f"resampled to {samples}² samples (a square of 2^n cells would not be)"
    return [
        f"The ground's collision is a heightmap of {bits} bits {kind}: steps of "
        f"{1000 * heightmap.quantum:.3g} mm, nodes off by up to "
        f"{1000 * heightmap_error(heightmap, ground):.3g} mm.",
        "Engines may cut a heightmap's cells the other way, which is off by up to "
        f"{1000 * cut_error(ground):.3g} mm in their middle.",
    ]


def _sampled(field: Heightfield, x: Array, y: Array) -> Array:
    """Heights of a field on a grid, shape [y, x], some rows at a time to spare memory."""
    heights = np.empty((len(y), len(x)))
    for start in range(0, len(y), _ROWS):
        rows = y[start : start + _ROWS, None]
        across = np.broadcast_to(x, (len(rows), len(x)))
        heights[start : start + _ROWS] = field.height_at(across, rows)
    return heights
