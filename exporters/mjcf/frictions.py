"""The ground of several frictions: MuJoCo has one for a height field, so there are several fields.

Each is as high as the ground where its own cells are, and a little lower beside them, so that what
is highest has the friction of its cell and no slope at a border catches a wheel. It cannot sink
where its cells have all corners of a triangle of another cell: such cells are in several fields.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from terrain_forge.model import Heightfield

from .blocks import Block

_SUNK = 0.005
"""How far a height field sinks below the ground where another has its friction [m]: more than
wheels press in, and so little that its slope there catches nothing."""
_DEEP = 0.5
"""How far it sinks from the second node on [m]: MuJoCo passes over what is below all of a wheel."""
_SIDE = 256
"""Cells along a side of the squares that the ground is cut into: each wheel meets all fields of its
square, and each field costs a file."""
_APART = 3
"""Cells so far from each other along an axis lift no cell together."""

Cells = NDArray[np.bool_]


def fields_by_friction(
    ground: Heightfield, blocks: list[Block], felt: dict[float, Cells]
) -> Iterator[tuple[str, Heightfield, float]]:
    """The height fields of the ground's blocks, with their names and frictions."""
    pieces = [piece for block in blocks for piece in _pieces(block)]
    for layer, (friction, own) in enumerate(_layers(felt)):
        kept = _corners(own)
        sunk = np.where(_around(kept), np.float32(_SUNK), np.float32(_DEEP))
        layered = ground.replace(elevation=ground.elevation - np.where(kept, np.float32(0.0), sunk))
        for number, piece in enumerate(pieces):
            if (span := _span(own, piece)) is not None:
                yield f"block_{number}_{layer}", layered.cut(**span._asdict()), friction


def _layers(felt: dict[float, Cells]) -> Iterator[tuple[float, Cells]]:
    """The cells of each friction, apart where they would lift another's between them."""
    for friction, cells in felt.items():
        left = cells.copy()
        while left.any():
            own = _separable(left, cells)
            left &= ~own
            yield friction, own


def _pieces(block: Block) -> Iterator[Block]:
    """A block in squares, so that few have cells of many frictions."""
    for row, column in product(range(0, block.rows, _SIDE), range(0, block.columns, _SIDE)):
        rows, columns = min(_SIDE, block.rows - row), min(_SIDE, block.columns - column)
        yield Block(block.row + row, block.column + column, rows, columns)


def _span(own: Cells, piece: Block) -> Block | None:
    """The part of a piece that some cells span, and a cell more each way, if any are there."""
    row, column, rows, columns = piece
    near = own[row : row + rows, column : column + columns]
    if not near.any():
        return None
    (south, north), (west, east) = (
        np.flatnonzero(near.any(axis=axis))[[0, -1]].tolist() for axis in (1, 0)
    )
    low, left = max(south - 1, 0), max(west - 1, 0)
    height, width = min(north + 2, rows) - low, min(east + 2, columns) - left
    return Block(row + low, column + left, height, width)


def _separable(left: Cells, cells: Cells) -> Cells:
    """As many of the cells that are left as lift none of another friction.

    Those that lift none with any other are taken at once, the others in turns of which no two lift
    a cell together.
    """
    own = left & ~_around(_lifted(left) & ~cells)
    rest = left & ~own
    for row, column in product(range(_APART), repeat=2):
        more = np.zeros_like(own)
        more[row::_APART, column::_APART] = rest[row::_APART, column::_APART]
        if more.any():
            own |= more & ~_around(_lifted(own | more) & ~cells)
    return own


def _corners(cells: Cells) -> Cells:
    """The nodes at the corners of some cells."""
    nodes = np.zeros(tuple(count + 1 for count in cells.shape), np.bool_)
    for j, i in product((0, 1), (0, 1)):
        nodes[j : j + cells.shape[0], i : i + cells.shape[1]] |= cells
    return nodes


def _lifted(cells: Cells) -> Cells:
    """The cells of which a triangle is as high as the ground if the corners of some cells are."""
    kept = _corners(cells)
    both = kept[:-1, :-1] & kept[1:, 1:]  # the ends of the cut
    return both & (kept[:-1, 1:] | kept[1:, :-1])


def _around(marked: Cells) -> Cells:
    """What is marked, and its eight neighbours."""
    return _corners(_corners(marked))[1:-1, 1:-1]
