"""Levels of detail of a tile's ground that meet without cracks, whichever the neighbours show.

A coarser level has every n-th node of the tile, and all nodes of its border and of the ring within.
So all levels have one border, and neighbours share it, with its normals; only the cells between it
and the ring look as fine as it. Cells within the ring are cut into fans from a corner inside.
Coordinates are whole multiples of a power of two (`TileGrid.step`), and so is the point that a
tile's are counted from: their sum is the same number from either side.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel
from terrain_forge.geometry.ground_mesh import grid_normals
from terrain_forge.model import RockField, RockPrototype, Tile, TileGrid, World

_FEWEST = 2
"""Cells of a level each way at least."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundLevel:
    """A tile's ground, coarser or not."""

    stride: int
    """Cells of the ground to a cell of the level, each way."""
    nodes: NDArray[np.int64]
    """Which of the tile's nodes its vertices are, row by row, shape [vertices]."""
    vertices: NDArray[np.float32]
    """Places from the tile's anchor [m], shape [vertices, 3]."""
    faces: NDArray[np.int32]
    """Corners, counter-clockwise from above, shape [faces, 3]."""
    error: float
    """How far it is from the ground at most [m]."""


def rocks_error(
    rocks: RockField,
    shapes: Sequence[RockPrototype],
    *,
    details: NDArray[np.int64],
    shown: NDArray[np.bool_],
) -> float:
    """How far what a level shows of rocks is off at most [m]: outlines, and rocks left out.

    Args:
        rocks: All rocks, with their shapes.
        shapes: The library's.
        details: Level of detail of each rock's shape, shape [rocks].
        shown: Which of the rocks are shown.
    """
    rough = np.zeros((len(shapes), max(len(shape.meshes) for shape in shapes)))
    for row, shape in zip(rough, shapes, strict=True):
        row[: len(shape.meshes)] = shape.outline_errors
    off = (rough[rocks.prototype, details] * rocks.scale)[shown].max(initial=0.0)
    return float(max(off, rocks.height[~shown].max(initial=0.0)))


def tile_anchor(tile: Tile, grid: TileGrid) -> Array:
    """The point that a tile's coordinates count from [m], near its middle, shape [3]."""
    west, south, east, north = tile.ground.bounds
    low, high = float(tile.ground.elevation.min()), float(tile.ground.elevation.max())
    middle = np.array([0.5 * (west + east), 0.5 * (south + north), 0.5 * (low + high)])
    step = grid.step(tile.ground.spacing)
    return np.asarray(np.rint(middle / step) * step)


def ground_levels(tile: Tile, grid: TileGrid, strides: tuple[int, ...]) -> Iterator[GroundLevel]:
    """The levels of a tile with so many cells to one of theirs; those it is too small for apart."""
    site, ground = tile.whole.site, tile.ground
    step, anchor = grid.step(ground.spacing), tile_anchor(tile, grid)
    east, north = site.axes(tile.world.window)  # the same numbers in every window
    places = np.empty((*ground.shape, 3))
    places[..., 0], places[..., 1] = east, north[:, None]
    places[..., 2] = ground.elevation
    local = (np.rint(places / step) * step - anchor).astype(np.float32).reshape(-1, 3)
    rows, columns = ground.shape[0] - 1, ground.shape[1] - 1
    for stride in strides:
        if stride > 1 and min(rows, columns) < _FEWEST * stride:
            continue
        nodes, faces = level_faces(rows, columns, stride)
        error = _error(ground.elevation, stride) if stride > 1 else 0.0
        yield GroundLevel(
            stride=stride, nodes=nodes, vertices=local[nodes], faces=faces, error=error + step
        )


def level_normals(tile: Tile, level: GroundLevel) -> NDArray[np.float32]:
    """Unit normals at a level's vertices, shape [vertices, 3].

    Of a coarse one they are means around each, but on the border, where all levels' are alike.
    """
    from scipy.ndimage import uniform_filter1d

    fine = grid_normals(tile.ground, tile.whole.ground)
    if level.stride == 1:
        return fine[level.nodes]
    fine = fine.reshape(*tile.ground.shape, 3)
    mean = partial(uniform_filter1d, size=level.stride + 1, mode="nearest")
    smooth = mean(mean(fine, axis=0), axis=1)
    smooth /= np.sqrt((smooth**2).sum(axis=2, keepdims=True))
    for side in (0, -1):
        smooth[side], smooth[:, side] = fine[side], fine[:, side]
    return np.asarray(smooth.reshape(-1, 3)[level.nodes], np.float32)


def shifted(world: World, anchor: Array) -> World:
    """A world whose places count from another point [m]."""
    ground = world.ground
    return world.replace(
        ground=ground.replace(
            elevation=(ground.elevation - anchor[2]).astype(np.float32),
            origin=(ground.origin[0] - float(anchor[0]), ground.origin[1] - float(anchor[1])),
        ),
        field=world.field.replace(position=world.field.position - anchor),
        neighbours=world.neighbours.replace(position=world.neighbours.position - anchor),
    )


def _lines(cells: int, stride: int) -> NDArray[np.int64]:
    """Nodes at which a level's cells begin and end along a side; a coarse one's within its ring."""
    if stride == 1:
        return np.arange(cells + 1)
    return np.unique([1, *range(stride, cells - stride // 2, stride), cells - 1])


@lru_cache(maxsize=32)
def level_faces(
    rows: int, columns: int, stride: int
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Nodes of a tile of so many cells that a level has, and its faces between them."""
    down, across = _lines(rows, stride), _lines(columns, stride)
    kept = np.zeros((rows + 1, columns + 1), np.bool_)
    kept[np.ix_(down, across)] = True
    ring = [0, 1, -2, -1] if stride > 1 else [0, -1]
    kept[ring] = kept[:, ring] = True
    index = np.full(kept.shape, -1, np.int32)
    index[kept] = np.arange(np.count_nonzero(kept), dtype=np.int32)
    corners = index[np.ix_(down, across)]
    found = [_halves(corners if stride == 1 else corners[1:-1, 1:-1])]
    if stride > 1:
        found.append(np.array(list(_fans(index, down, across)), np.int32).reshape(-1, 3))
        strips = index[:2], index[-2:], index[1:-1, :2], index[1:-1, -2:]
        found += map(_halves, strips)
    return np.flatnonzero(kept), np.concatenate(found)


def _halves(corners: NDArray[np.int32]) -> NDArray[np.int32]:
    """Two faces for each cell between nodes, shape of these [rows, columns]."""
    southwest, southeast = corners[:-1, :-1], corners[:-1, 1:]
    northwest, northeast = corners[1:, :-1], corners[1:, 1:]
    parts = (southwest, southeast, northeast, southwest, northeast, northwest)
    return np.stack(parts, axis=-1).reshape(-1, 3)


def _fans(
    index: NDArray[np.int32], down: NDArray[np.int64], across: NDArray[np.int64]
) -> Iterator[tuple[int, int, int]]:
    """Faces of the cells within the ring, with all nodes of it."""
    last_row, last_column = len(down) - 2, len(across) - 2
    for row in range(last_row + 1):
        ring = range(last_column + 1) if row in (0, last_row) else (0, last_column)
        for column in ring:
            rows = int(down[row]), int(down[row + 1])
            columns = int(across[column]), int(across[column + 1])
            rim = _rim(
                rows,
                columns,
                south=row == 0,
                north=row == last_row,
                west=column == 0,
                east=column == last_column,
            )
            apex = int(down[row + (row == 0)]), int(across[column + (column == 0)])
            begin = rim.index(apex)
            walk = [*rim[begin + 1 :], *rim[:begin]]
            for one, other in pairwise(walk):
                yield int(index[apex]), int(index[one]), int(index[other])


def _rim(
    rows: tuple[int, int],
    columns: tuple[int, int],
    *,
    south: bool,
    north: bool,
    west: bool,
    east: bool,
) -> list[tuple[int, int]]:
    """Nodes around a cell, counter-clockwise from the south-west: all of those on the ring."""
    (low, high), (left, right) = rows, columns
    return [
        *((low, n) for n in (range(left, right) if south else (left,))),
        *((n, right) for n in (range(low, high) if east else (low,))),
        *((high, n) for n in (range(right, left, -1) if north else (right,))),
        *((n, left) for n in (range(high, low, -1) if west else (high,))),
    ]


def _error(elevation: NDArray[np.float32], stride: int) -> float:
    rows, columns = elevation.shape
    return float(
        _largest_error(elevation, _lines(rows - 1, stride), _lines(columns - 1, stride), stride)
    )


@kernel
def _largest_error(elevation, down, across, stride):  # type: ignore[no-untyped-def]
    """Largest distance of a level from the ground [m], in height.

    Within, both are straight between the nodes, since the level's diagonals lie on the ground's. In
    cells at the ring, and those of another size, it is at most the range of what the nodes are
    above a plane: either surface is a mean of nodes.
    """
    largest = 0.0
    for j in range(len(down) - 1):
        for i in range(len(across) - 1):
            south, north, west, east = down[j], down[j + 1], across[i], across[i + 1]
            plain = 0 < j < len(down) - 2 and 0 < i < len(across) - 2
            if plain and north - south == stride and east - west == stride:
                found = _within(elevation, south, west, stride)
            else:
                found = _range(elevation, south, north, west, east)
            largest = max(largest, found)
    return largest


@inner
def _within(elevation, south, west, stride):  # type: ignore[no-untyped-def]
    southwest = np.float64(elevation[south, west])
    southeast = np.float64(elevation[south, west + stride])
    northwest = np.float64(elevation[south + stride, west])
    northeast = np.float64(elevation[south + stride, west + stride])
    largest = 0.0
    for j in range(stride + 1):
        for i in range(stride + 1):
            u, v = i / stride, j / stride
            if u >= v:
                height = southwest + u * (southeast - southwest) + v * (northeast - southeast)
            else:
                height = southwest + v * (northwest - southwest) + u * (northeast - northwest)
            largest = max(largest, abs(height - elevation[south + j, west + i]))
    return largest


@inner
def _range(elevation, south, north, west, east):  # type: ignore[no-untyped-def]
    base = np.float64(elevation[south, west])
    rise_east = (np.float64(elevation[south, east]) - base) / (east - west)
    rise_north = (np.float64(elevation[north, west]) - base) / (north - south)
    low, high = 0.0, 0.0
    for j in range(south, north + 1):
        for i in range(west, east + 1):
            above = elevation[j, i] - base - rise_east * (i - west) - rise_north * (j - south)
            low, high = min(low, above), max(high, above)
    return high - low
