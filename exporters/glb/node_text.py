"""The nodes of many rocks as JSON text, at the speed of the disk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inlined, kernel, xyzw
from terrain_forge.model import RockField
from terrain_forge.writers import ROCK, put_integer, put_number

_PIECES = tuple(
    np.frombuffer(piece, np.uint8)
    for piece in (
        f'{{"name":"{ROCK}'.encode(),
        b'","mesh":',
        b',"translation":[',
        b'],"rotation":[',
        b'],"scale":[',
        b"]},",
    )
)
_DECIMALS = 7
"""Of places, turns and sizes: a tenth of a micrometre, finer than the float32 of readers."""
_WIDEST = 400
"""Bytes of a node at most: its words, two numbers of 10 digits and ten of 22 with a comma."""


def rock_nodes(rocks: RockField, meshes: NDArray[np.int64]) -> str:
    """The nodes of rocks, with commas between them.

    Args:
        rocks: The rocks, at least one.
        meshes: Index of each one's mesh, shape [rocks].
    """
    size = np.repeat(rocks.scale[:, None], 3, axis=1)
    places = np.hstack([rocks.position, xyzw(rocks.quaternion), size])
    text = np.empty(_WIDEST * len(rocks), np.uint8)
    used = _put_nodes(text, _PIECES, rocks.id, meshes, places)
    return text[: used - 1].tobytes().decode("ascii")


@inlined
def _put_piece(text, at, piece):  # type: ignore[no-untyped-def]
    for place in range(len(piece)):
        text[at + place] = piece[place]
    return at + len(piece)


@kernel
def _put_nodes(text, pieces, ids, meshes, places):  # type: ignore[no-untyped-def]
    unit = 10**_DECIMALS
    at = 0
    for rock in range(len(ids)):
        at = _put_piece(text, at, pieces[0])
        at = put_integer(text, at, np.int64(ids[rock]))
        at = _put_piece(text, at, pieces[1])
        at = put_integer(text, at, meshes[rock])
        first = 0
        for piece, count in ((pieces[2], 3), (pieces[3], 4), (pieces[4], 3)):
            at = _put_piece(text, at, piece)
            for number in range(first, first + count):
                at = put_number(text, at, places[rock, number], _DECIMALS, unit)
                text[at] = 44
                at += 1
            at -= 1
            first += count
        at = _put_piece(text, at, pieces[5])
    return at
