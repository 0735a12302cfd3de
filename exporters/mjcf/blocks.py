"""The ground cut into height fields so small that MuJoCo keeps every contact with them.

Of a pair of geoms MuJoCo keeps 50 contacts and drops the others without a word, row by row: a slab
that lies on more than 4 × 4 cells of one field loses its support on one side and tips over. Under
dynamic rocks that wide the ground becomes fields of 4 × 4 cells, which make 32 contacts at most;
further away fields of doubling size do.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import ExportError, portable
from terrain_forge.model import Heightfield, RockField

CELLS = 4
"""Cells of the smallest fields each way, and the widest that may lie on one larger field."""
MOST = 20_000
"""Height fields that an export may have: each costs some 0.1 µs of every step."""
_REACH = 0.6
"""How far from its centre the ground of a rock is cut [diameters]."""


class Block(NamedTuple):
    """A rectangle of the ground's cells."""

    row: int
    """First row."""
    column: int
    """First column."""
    rows: int
    """Rows of cells."""
    columns: int
    """Columns of cells."""


def wide_rocks(field: RockField, spacing: float) -> RockField:
    """The dynamic rocks that lie on more cells than one height field can hold them on."""
    return field.select(field.dynamic & (field.diameter > CELLS * spacing))


def split_ground(ground: Heightfield, rocks: RockField) -> list[Block]:
    """The blocks of the ground: small under the rocks, large elsewhere; they cover each cell once.

    Raises:
        ExportError: if there would be too many.
    """
    near = _near(ground, rocks)
    whole = CELLS * 2 ** int(np.ceil(portable.log2(max(near.shape))))
    blocks = list(_split(near, Block(0, 0, whole, whole), ground.shape))
    if len(blocks) > MOST:
        raise ExportError(
            f"{len(rocks)} dynamic rocks are wider than {CELLS} cells of the ground, which would "
            f"become {len(blocks)} height fields, at most {MOST}: choose a coarser spacing_m, "
            "fewer or smaller dynamic rocks, or `split_ground: false`, with which they may tip over"
        )
    return blocks


def _near(ground: Heightfield, rocks: RockField) -> NDArray[np.bool_]:
    """Which squares of 4 × 4 cells lie under the rocks or beside them."""
    rows, columns = (-(-(nodes - 1) // CELLS) for nodes in ground.shape)
    near = np.zeros((rows, columns), np.bool_)
    side = CELLS * ground.spacing
    centre = (rocks.position[:, :2] - ground.origin) / side
    reach = (_REACH * rocks.diameter / side)[:, None]
    low = np.floor(centre - reach).astype(np.int64).clip(0)
    high = np.floor(centre + reach).astype(np.int64) + 1
    for (west, south), (east, north) in zip(low.tolist(), high.tolist(), strict=True):
        near[south:north, west:east] = True
    return near


def _split(near: NDArray[np.bool_], block: Block, nodes: tuple[int, int]) -> Iterator[Block]:
    """The block within the grid, in quarters of quarters where something is near."""
    rows = min(block.rows, nodes[0] - 1 - block.row)
    columns = min(block.columns, nodes[1] - 1 - block.column)
    if rows <= 0 or columns <= 0:
        return
    squares = [slice(n // CELLS, (n + block.rows) // CELLS) for n in (block.row, block.column)]
    if block.rows <= CELLS or not near[squares[0], squares[1]].any():
        yield Block(block.row, block.column, rows, columns)
        return
    half = block.rows // 2
    for row in (block.row, block.row + half):
        for column in (block.column, block.column + half):
            yield from _split(near, Block(row, column, half, half), nodes)
