"""Faces of a grid as OBJ text, several times as fast as those of any mesh.

Each node is a corner of six triangles, so its text is made once and copied.
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from terrain_forge.base import inlined, kernel

# A blank, three indices of up to ten digits, two slashes, and the rest to make whole words of it.
_WIDEST = 40


def write_obj_grid_faces(file: BinaryIO, rows: int, columns: int) -> None:
    """Write OBJ lines `f a/a/a …` of the triangles of `ground_mesh.grid_faces`.

    Position, texture and normal of a node share an index; the grid's nodes are the file's first.
    """
    text = np.empty(2 * (columns - 1) * (2 + 3 * _WIDEST) + _WIDEST, np.uint8)
    south, north = (np.empty((columns, _WIDEST), np.uint8) for _ in range(2))
    _put_nodes(south, 1)
    for row in range(1, rows):
        _put_nodes(north, 1 + row * columns)
        used = _put_cells(text, south, north)
        file.write(text[:used].data)
        south, north = north, south


@kernel
def _put_nodes(nodes, first):  # type: ignore[no-untyped-def]
    """Write ` a/a/a` of a row of nodes; the last byte of each is the length of its text."""
    for column in range(len(nodes)):
        node = nodes[column]
        number = first + column
        width = 1
        power = 10
        while number >= power:
            width += 1
            power *= 10
        node[0] = 32
        node[1 + width] = 47
        node[2 + 2 * width] = 47
        for place in range(width):
            digit = 48 + number % 10
            number //= 10
            last = width - place
            node[last] = digit
            node[1 + width + last] = digit
            node[2 + 2 * width + last] = digit
        node[_WIDEST - 1] = 3 * (width + 1)


@inlined
def _copy(text, at, node):  # type: ignore[no-untyped-def]
    """Copy a node's text; returns where it ends. What is copied beyond that is overwritten."""
    for place in range(_WIDEST):
        text[at + place] = node[place]
    return at + node[_WIDEST - 1]


@kernel
def _put_cells(text, south, north):  # type: ignore[no-untyped-def]
    """Write the two triangles of each cell between two rows of nodes; returns the text's length."""
    at = 0
    for column in range(len(south) - 1):
        text[at] = 102
        at = _copy(text, at + 1, south[column])
        at = _copy(text, at, south[column + 1])
        at = _copy(text, at, north[column + 1])
        text[at] = 10
        text[at + 1] = 102
        at = _copy(text, at + 2, south[column])
        at = _copy(text, at, north[column + 1])
        at = _copy(text, at, north[column])
        text[at] = 10
        at += 1
    return at
