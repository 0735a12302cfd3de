"""What lies beyond a site in tiles: it goes on from strips of its outer tiles along its border."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import read_arrays
from terrain_forge.making import horizon_around
from terrain_forge.model import Appearance, Heightfield, Horizon, Tile, TileGrid, World
from terrain_forge.terrain import Border, joined_strips
from terrain_forge.tiling.order import TileOrder, reading_of_tile

FILE = "border.npz"
"""A tile's strips, in its folder."""
_DEEP = 64
"""Cells that a strip is deep: mostly as far as masks of materials look."""


def shows_horizon(order: TileOrder) -> bool:
    """Whether an export of a site in tiles shows what lies beyond it."""
    if order.site.recipe.horizon.reach_m == 0.0:
        return False
    return any(getattr(export.opened()[1], "horizon", False) for export in order.exports)


def write_strips(tile: Tile, grid: TileGrid, folder: Path) -> None:
    """Write the strips that a tile has of the site's sides, if it lies at any."""
    arrays = dict[str, NDArray[Any]]()
    step = grid.step(tile.ground.spacing)
    heights = np.rint(tile.ground.elevation.astype(np.float64) / step) * step
    looks = tile.world.appearance
    for side, nodes in _sides(grid, tile.number).items():
        arrays[f"{side}_heights"] = heights[nodes].astype(np.float32)
        arrays[f"{side}_rgb"] = looks.ground_rgb[nodes]
        if looks.material is not None:
            arrays[f"{side}_material"] = looks.material[nodes]
    if arrays:
        np.savez(folder / FILE, allow_pickle=False, **arrays)  # type: ignore[arg-type]


def site_horizon(
    order: TileOrder, world: World, *, lowest: float, highest: float
) -> Horizon | None:
    """What lies beyond a site whose tiles are there; None where the recipe wants nothing.

    Colours of the land and shares of materials go by the strips alone.

    Args:
        order: The site and its tiles.
        world: That of a corner, for what all tiles share.
        lowest: Lowest height of all of its ground [m].
        highest: Highest height of all of its ground [m].

    Raises:
        OutputError: if a tile's strips are damaged.
    """
    up, across = order.grid.up, order.grid.across
    strips = [
        joined_strips(
            [_read(order, world, side, row * across + column) for row, column in places],
            along=int(side in ("south", "north")),
        )
        for side, places in {
            "south": [(0, column) for column in range(across)],
            "east": [(row, across - 1) for row in range(up)],
            "north": [(up - 1, column) for column in range(across)],
            "west": [(row, 0) for row in range(up)],
        }.items()
    ]
    (south, east, north, west) = strips
    border = Border(
        sides=(south[0], east[0], north[0], west[0]),
        looks=(south[1], east[1], north[1], west[1]),
        lowest=lowest,
        highest=highest,
    )
    return horizon_around(order.site, border, world.library)


def _sides(grid: TileGrid, number: int) -> dict[str, tuple[slice, slice]]:
    """The sides of the site at which a tile lies, and its nodes there."""
    row, column = grid.place(number)
    near, far, all_of_it = slice(_DEEP + 1), slice(-_DEEP - 1, None), slice(None)
    at = {
        "south": (row == 0, (near, all_of_it)),
        "east": (column == grid.across - 1, (all_of_it, far)),
        "north": (row == grid.up - 1, (far, all_of_it)),
        "west": (column == 0, (all_of_it, near)),
    }
    return {side: nodes for side, (touched, nodes) in at.items() if touched}


def _read(order: TileOrder, world: World, side: str, number: int) -> tuple[Heightfield, Appearance]:
    """A tile's part of a strip, and its looks."""
    path, site, window = order.folder(number) / FILE, order.site, order.grid.window(number)
    with reading_of_tile(path, path.parent):
        arrays = read_arrays(path)
        heights, rgb = (arrays[f"{side}_{what}"] for what in ("heights", "rgb"))
        nodes = _sides(order.grid, number)[side]
        wanted = np.empty((window.rows + 1, window.columns + 1), np.bool_)[nodes].shape
        if heights.shape != wanted:
            raise ValueError(f"{heights.shape} nodes, not {wanted}")
        material = arrays.get(f"{side}_material")
        looks = world.appearance.replace(ground_rgb=rgb, material=material, drift=None)
        rows, columns = heights.shape
        row = window.row + (window.rows + 1 - rows if side == "north" else 0)
        column = window.column + (window.columns + 1 - columns if side == "east" else 0)
        corner = site.west + column * site.spacing, site.south + row * site.spacing
        return Heightfield(elevation=heights, spacing=site.spacing, origin=corner), looks
