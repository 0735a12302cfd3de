"""Pictures of tiles from above, and the map of all of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from terrain_forge.base import image_rows, portable, reading, require_file
from terrain_forge.geometry import grid_normals
from terrain_forge.model import Tile, TileGrid, merge
from terrain_forge.writers import write_png

PICTURE = "map.png"
"""A tile's picture, in its folder; of the whole map, in the site's."""
_TILE, _WHOLE = 512, 2048
"""Pixels of a tile's picture and of the whole map along a side at most."""
_DARK = 0.35
"""Brightness of what the Sun does not meet."""


def tile_step(grid: TileGrid) -> int:
    """Cells for each pixel of a tile's picture, each way."""
    return -(-min(grid.cells, max(grid.columns, grid.rows)) // _TILE)


def write_picture(tile: Tile, rock_id: NDArray[np.int32], path: Path, *, step: int) -> None:
    """Write a tile as it looks from above, lit by the Sun, no shadows; a pixel for some cells."""
    world = tile.world
    colours = world.appearance.ground_rgb.astype(np.float64)
    rocks = merge(world.field, world.neighbours)
    covered = rock_id >= 0
    if covered.any():
        rows = np.searchsorted(rocks.id, rock_id[covered])
        colours[covered] = world.appearance.rock_rgb[rocks.population[rows]]
    normals = grid_normals(tile.ground, tile.whole.ground).reshape(*tile.ground.shape, 3)
    light = np.maximum(portable.product(normals, world.lighting.towards_sun), 0.0)
    level = max(float(world.lighting.towards_sun[2]), 0.2)  # what flat ground has
    lit = colours * (_DARK + (1.0 - _DARK) * np.minimum(light / level, 1.6))[..., None]
    pixels = np.clip(lit[:-1, :-1], 0.0, 255.0).astype(np.uint8)
    write_png(path, image_rows(_means(pixels, step)))


def _means(pixels: NDArray[np.uint8], step: int) -> NDArray[np.uint8]:
    """Means over squares of pixels, smaller ones at the end."""
    rows, columns = (np.arange(0, size, step) for size in pixels.shape[:2])
    sums = np.add.reduceat(np.add.reduceat(pixels.astype(np.uint32), rows, 0), columns, 1)
    heights = np.diff([*rows, pixels.shape[0]])
    widths = np.diff([*columns, pixels.shape[1]])
    return np.asarray((sums // (heights[:, None] * widths)[..., None]).astype(np.uint8))


def write_map(grid: TileGrid, out: Path) -> tuple[int, int]:
    """Write the map of all tiles from their pictures; returns its width and height in pixels."""
    step = 1
    while max(grid.columns, grid.rows) > step * _WHOLE:
        step *= 2
    width, height = -(-grid.columns // step), -(-grid.rows // step)
    whole = Image.new("RGB", (width, height))
    for number in range(len(grid)):
        window = grid.window(number)
        left, right = window.column // step, -(-(window.column + window.columns) // step)
        top = height - -(-(window.row + window.rows) // step)
        bottom = height - window.row // step
        place = out / grid.folder(number) / PICTURE
        require_file(place, str(place))
        with reading(str(place)), Image.open(place) as picture:
            size = max(right - left, 1), max(bottom - top, 1)
            part = picture.convert("RGB").resize(size, Image.Resampling.BOX)
        whole.paste(part, (left, top))
    write_png(out / PICTURE, np.asarray(whole))
    return width, height
