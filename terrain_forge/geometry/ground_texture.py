"""The ground's picture finer than its grid: colours and normals baked for formats that show one.

It is what the preview shows of soil and small stones, down to the size of a pixel; it is addressed
by place, so that tiles meet without a seam and nothing repeats. It is visual only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Mask,
    Record,
    inner,
    kernel,
    linear_from_srgb,
    over_chunks,
    srgb_from_linear,
    stage_key,
)
from terrain_forge.model import GroundDetail, Heightfield, Tile, TileGrid, World
from terrain_forge.scene import ground_grain

_STEPS = 4096
_LEVEL = (128, 128, 255)
"""The normal of level ground in a picture of normals."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundTexture(Record):
    """Images of one tile of the ground for the texture coordinates of `ground_mesh`."""

    rgb: NDArray[np.uint8]
    """sRGB colours, rows run north, shape [rows, columns, 3]."""
    normals: NDArray[np.uint8]
    """Unit normals towards east, north and away from the mesh, -1 to 1 as 0 to 255, rows run north,
    shape [rows, columns, 3]."""

    def __post_init__(self) -> None:
        self.freeze("rgb", np.uint8, ("rows", "columns", 3))
        self.freeze("normals", np.uint8, self.rgb.shape)


def finest_texture(ground: Heightfield, largest: int) -> int:
    """Most pixels per node, 1 at least, that a picture of `largest` pixels a side has room for."""
    return max(largest // max(ground.shape), 1)


def detail_placement(
    ground: Heightfield, detail: GroundDetail
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Where the detail tile lies: at scale · (u, v) + offset for `grid_texture_coordinates`.

    Args:
        ground: The ground of the mesh, a tile or a whole one.
        detail: The tile, whose place is counted from the site's origin.

    Returns:
        The scales and the offsets, which are from 0 to 1, along east and north.
    """
    rows, columns = ground.shape
    cells = ground.spacing / detail.size
    west, south = ((place / detail.size - 0.5 * cells) % 1.0 for place in ground.origin)
    return (columns * cells, rows * cells), (west, south)


def bake_tile(tile: Tile, largest: int) -> GroundTexture:
    """The tile's part of a picture of the whole ground of `largest` pixels a side."""
    return bake_ground(tile.world, finer=finest_texture(tile.whole.ground, largest))


def bake_site_tile(tile: Tile, grid: TileGrid, largest: int) -> GroundTexture:
    """The picture of a tile of a site, of `largest` pixels a side where most tiles fill it."""
    return bake_ground(tile.world, finer=max(largest // grid.usual_nodes, 1))


def bake_ground(tile: World, *, finer: int) -> GroundTexture:
    """Colours and normals of a tile with `finer` × `finer` pixels for each node.

    A node lies in the middle of its pixels, as `grid_texture_coordinates` has it for any `finer`;
    half a cell beyond the outer nodes the picture goes on with their colour.
    """
    rows, columns = tile.ground.shape
    return bake_cells(tile, (0, 0), np.ones((rows - 1, columns - 1), np.bool_), finer=finer)


def bake_cells(tile: World, first: tuple[int, int], drawn: Mask, *, finer: int) -> GroundTexture:
    """Colours and normals of some cells of a tile, as `bake_ground` has them.

    Args:
        tile: The tile.
        first: Row and column of the south-western one.
        drawn: Which of the cells from there on have soil and stones; the others have the colour of
            a node alone. Shape [rows, columns].
        finer: Pixels for each node, each way.
    """
    row, column = first
    nodes = np.s_[row : row + drawn.shape[0] + 1, column : column + drawn.shape[1] + 1]
    ground, looks = tile.ground, tile.appearance.cut(nodes)
    rows, columns = (finer * (cells + 1) for cells in drawn.shape)
    rgb = np.empty((rows, columns, 3), np.uint8)
    normals = np.empty((rows, columns, 3), np.uint8)
    linear = linear_from_srgb(np.arange(256) / 255.0)
    encoded = np.rint(255.0 * srgb_from_linear((np.arange(_STEPS) / (_STEPS - 1)) ** 2))
    origin = (
        ground.origin[0] + column * ground.spacing,
        ground.origin[1] + row * ground.spacing,
    )
    grid = stage_key(tile.site.seed, "grain"), origin, ground.spacing, finer
    shown = looks.ground_rgb, looks.grain
    whole = np.ascontiguousarray(drawn)  # a piece of a larger one would be another type
    over_chunks(_bake, rows, *grid, whole, *shown, linear, encoded, rgb, normals)
    return GroundTexture(rgb=rgb, normals=normals)


@inner
def _of_node(grain, part, i, j, u, v):  # type: ignore[no-untyped-def]
    south = grain[j, i, part] * (1.0 - u) + grain[j, i + 1, part] * u
    north = grain[j + 1, i, part] * (1.0 - u) + grain[j + 1, i + 1, part] * u
    return 0.01 * (south + v * (north - south))


@kernel
def _bake(  # type: ignore[no-untyped-def]
    first, last, key, origin, spacing, finer, drawn, colours, grain, linear, encoded, rgb, normals
):
    rows, columns, _ = colours.shape
    pixel = spacing / finer
    for row in range(first, last):
        place_y = (row + 0.5) / finer - 0.5
        y = min(max(place_y, 0.0), rows - 1.0)
        j = min(np.int64(y), rows - 2)
        v = y - j
        for column in range(rgb.shape[1]):
            place_x = (column + 0.5) / finer - 0.5
            x = min(max(place_x, 0.0), columns - 1.0)
            i = min(np.int64(x), columns - 2)
            u = x - i
            if not drawn[j, i]:
                for channel in range(3):
                    rgb[row, column, channel] = colours[j, i, channel]
                    normals[row, column, channel] = _LEVEL[channel]
                continue
            east, north = origin[0] + place_x * spacing, origin[1] + place_y * spacing
            bright, rise_x, rise_y = ground_grain(
                key,
                (
                    _of_node(grain, 0, i, j, u, v),
                    _of_node(grain, 1, i, j, u, v),
                    _of_node(grain, 2, i, j, u, v),
                ),
                east,
                north,
                spacing,
                pixel,
            )
            for channel in range(3):
                south = linear[colours[j, i, channel]] * (1.0 - u)
                south += linear[colours[j, i + 1, channel]] * u
                upper = linear[colours[j + 1, i, channel]] * (1.0 - u)
                upper += linear[colours[j + 1, i + 1, channel]] * u
                light = bright * (south + v * (upper - south))
                step = np.sqrt(min(max(light, 0.0), 1.0)) * (_STEPS - 1)
                rgb[row, column, channel] = np.uint8(encoded[np.int64(step + 0.5)])
            scale = 127.5 / np.sqrt(rise_x * rise_x + rise_y * rise_y + 1.0)
            normals[row, column, 0] = np.uint8(128.0 - scale * rise_x)
            normals[row, column, 1] = np.uint8(128.0 - scale * rise_y)
            normals[row, column, 2] = np.uint8(128.0 + scale - 0.5)
