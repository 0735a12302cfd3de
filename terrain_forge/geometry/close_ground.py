"""The ground near paths in pictures as fine as a camera at a metre asks for."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Mask
from terrain_forge.geometry.ground_texture import GroundTexture, bake_cells, finest_texture
from terrain_forge.model import Tile, Trajectory, World, path_points

FINEST = 0.004
"""Pixels are no finer: a camera of 1 mrad a pixel sees 1 to 4 mm from a metre up [m]."""
_MOST = 2**24
"""Pixels beside all paths together: about 7 s of processor time, and 8 MB."""
_SIDE = 4.0
"""About how much ground a picture shows, each way [m]."""
_LARGEST = 4096
"""Pixels of a picture, each way."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosePatch:
    """Some cells of a tile's ground, with a picture of their own."""

    number: int
    """Among the tile's."""
    cells: NDArray[np.int64]
    """The cells, row by row from the south-west, shape [cells]."""
    texture: GroundTexture
    """Colours and normals; the middles of the outer pixels lie half a cell beyond its nodes."""
    scale: tuple[float, float]
    """Its texture coordinates are scale · (u, v) + offset for the tile's, `ground_mesh`'s."""
    offset: tuple[float, float]


def close_pixel(world: World, within: float) -> float:
    """Size of the pixels of the ground up to `within` [m] from a world's paths [m]."""
    length = sum(_length_within(path, world.ground.bounds, within) for path in world.trajectories)
    return pixel_beside(length, within)


def pixel_beside(length: float, within: float) -> float:
    """Size of the pixels of the ground up to `within` [m] from so many metres of paths [m].

    It is 4 mm, or coarser where that would be more than 2²⁴ of them.
    """
    return max(FINEST, math.sqrt(2.0 * within * length / _MOST))


def _length_within(
    path: Trajectory, bounds: tuple[float, float, float, float], around: float
) -> float:
    """Length of what of a path lies within bounds, or so far around them [m]."""
    steps = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
    middle = 0.5 * (path.position[1:, :2] + path.position[:-1, :2])
    low, high = np.array(bounds[:2]) - around, np.array(bounds[2:]) + around
    inside = ((middle >= low) & (middle <= high)).all(axis=1)
    return float(steps[inside].sum())


def close_patches(tile: Tile, *, within: float, largest: int) -> Iterator[ClosePatch]:
    """Pictures of a tile's ground near paths, where they are finer than the tile's own.

    Args:
        tile: The tile.
        within: How far from a path they reach, to about a cell [m]; 0 for none.
        largest: Pixels of the usual picture along the longer side of the whole ground.
    """
    near, spacing = cells_near_paths(tile, within=within), tile.ground.spacing
    if not near.any():
        return
    side = max(round(_SIDE / spacing), 1)
    finer = min(math.ceil(spacing / close_pixel(tile.whole, within)), _LARGEST // (side + 1))
    if finer <= finest_texture(tile.whole.ground, largest):
        return
    rows, columns = tile.ground.shape
    starts = ((j, i) for j in range(0, rows - 1, side) for i in range(0, columns - 1, side))
    for number, (row, column) in enumerate(starts):
        drawn = near[row : row + side, column : column + side]
        if not drawn.any():
            continue
        j, i = np.nonzero(drawn)
        tall, wide = (cells + 1 for cells in drawn.shape)
        yield ClosePatch(
            number=number,
            cells=(row + j) * (columns - 1) + column + i,
            texture=bake_cells(tile.world, (row, column), drawn, finer=finer),
            scale=(columns / wide, rows / tall),
            offset=(-column / wide, -row / tall),
        )


def cells_near_paths(tile: Tile, *, within: float) -> Mask:
    """Which cells of a tile's ground lie within so many metres of a path, to about a cell.

    Returns:
        Shape [rows, columns].
    """
    from scipy.ndimage import distance_transform_edt

    ground = tile.ground
    cells = ground.shape[0] - 1, ground.shape[1] - 1
    if within <= 0.0:
        return np.zeros(cells, np.bool_)
    places = np.floor(
        (path_points(tile.whole.trajectories) - ground.origin) / ground.spacing
    ).astype(np.int64)
    outside = max(-places.min(initial=0), (places - cells[::-1]).max(initial=0)) + 1
    reach = min(math.ceil(within / ground.spacing), int(outside)) + 1
    away = np.ones((cells[0] + 2 * reach, cells[1] + 2 * reach), np.bool_)
    column, row = (places + reach).T
    inside = (row >= 0) & (row < away.shape[0]) & (column >= 0) & (column < away.shape[1])
    away[row[inside], column[inside]] = False
    if away.all():
        return np.zeros(cells, np.bool_)
    near = distance_transform_edt(away) * ground.spacing <= within
    return np.asarray(near[reach:-reach, reach:-reach])


def close_loss(pixel: float, within: float) -> str:
    """How fine the ground near paths is by the size of its pixels [m], as a sentence."""
    return (
        f"Within {within:g} m of paths the ground's texture has pixels of about "
        f"{1000.0 * pixel:.2g} mm."
    )
