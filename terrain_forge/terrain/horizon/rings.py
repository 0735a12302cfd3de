"""Rings of nodes around a world, of falling resolution, and the triangles between them.

The innermost ring has the border's own nodes, so that there is no step and no crack; each further
one lies farther out, first by a cell, later by a part of the distance that it has come.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import Bounds

_RINGS = (0, 1, 1, 2, 4)
"""Rings before their nodes are halved, from the border on; the last goes on."""
_FEWEST = 96
"""Cells along the shorter side below which nothing is halved any more."""
_GROWTH = 0.12
"""Least distance of a ring from the last one, over that from the border."""


class Lattice(Protocol):
    """The nodes of a ground, wherever its heights are."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        ...

    @property
    def spacing(self) -> float:
        """Their distance [m]."""
        ...

    @property
    def bounds(self) -> Bounds:
        """West, south, east, north edge [m]."""
        ...

    @property
    def east(self) -> Array:
        """East coordinates of the columns [m]."""
        ...

    @property
    def north(self) -> Array:
        """North coordinates of the rows [m]."""
        ...


@dataclass(frozen=True, eq=False)
class Ring:
    """A closed polygon of nodes, counter-clockwise from the south-western corner."""

    away: float
    """Distance from the border, along the axes [m]."""
    cell: float
    """Distance of its nodes [m]."""
    parts: tuple[Array, ...]
    """How far along their side the nodes lie, both corners among them, 0 to 1: S, E, N, W."""
    kept: NDArray[np.int64]
    """Rows of the last ring's nodes that it goes on from."""
    points: Array
    """East and north [m], shape [nodes, 2]."""


def rings_around(ground: Lattice, reach: float) -> list[Ring]:
    """Rings around a ground, the first on its border, out to a distance from it [m]."""
    rows, columns = ground.shape
    west, south, east, north = ground.bounds
    sides = east - west, north - south
    parts = tuple(np.linspace(0.0, 1.0, n) for n in (columns, rows, columns, rows))
    border = border_points(ground)
    rings = [Ring(0.0, ground.spacing, parts, np.arange(len(border)), border)]
    left, level = _RINGS[0], 0
    while (away := rings[-1].away) < reach:
        kept = [np.arange(len(part) - 1) for part in parts]
        if left == 0 and min(len(part) for part in parts) > _FEWEST:
            ends = [len(part) - 1 for part in parts]
            every = [np.append(np.arange(0, n, 2), n) for n in ends]
            parts = tuple(part[rows] for part, rows in zip(parts, every, strict=True))
            kept = [rows[:-1] for rows in every]
            level = min(level + 1, len(_RINGS) - 1)
            left = _RINGS[level]
        left = max(left - 1, 0)
        first = np.cumsum([0, *(len(part) - 1 for part in rings[-1].parts)])[:-1]
        perimeter = 2.0 * sum(sides) + 8.0 * away
        cell = perimeter / sum(len(part) - 1 for part in parts)
        step = max(cell, _GROWTH * away)
        away = reach if away + 1.5 * step > reach else away + step
        keep = np.concatenate([f + rows for f, rows in zip(first, kept, strict=True)])
        rings.append(Ring(away, cell, parts, keep, ring_points(ground, parts, away)))
    return rings


def border_points(ground: Lattice) -> Array:
    """East and north of the border's nodes [m], counter-clockwise from the south-west."""
    (rows, columns), east, north = ground.shape, ground.east, ground.north
    return np.concatenate(
        [
            np.column_stack([east, np.full(columns, north[0])])[:-1],
            np.column_stack([np.full(rows, east[-1]), north])[:-1],
            np.column_stack([east, np.full(columns, north[-1])])[:0:-1],
            np.column_stack([np.full(rows, east[0]), north])[:0:-1],
        ]
    )


def ring_points(ground: Lattice, parts: tuple[Array, ...], away: float) -> Array:
    """Nodes at some distance from the border [m], shape [nodes, 2]; a negative one is within."""
    west, south, east, north = ground.bounds
    west, south, east, north = west - away, south - away, east + away, north + away
    corners = np.array([[west, south], [east, south], [east, north], [west, north]])
    ends = np.roll(corners, -1, axis=0)
    return np.concatenate(
        [a + part[:-1, None] * (b - a) for part, a, b in zip(parts, corners, ends, strict=True)]
    )


def ring_faces(rings: list[Ring]) -> NDArray[np.int32]:
    """Triangles between rings, counter-clockwise from above, shape [faces, 3]."""
    starts = np.cumsum([0, *(len(ring.points) for ring in rings)])[:-1]
    faces = []
    for (start, ring), (next_start, outer) in pairwise(zip(starts, rings, strict=True)):
        first = next_first = 0
        for part, outer_part in zip(ring.parts, outer.parts, strict=True):
            fine, coarse = np.arange(len(part)), np.arange(len(outer_part))
            own = start + (first + fine) % len(ring.points)
            far = next_start + (next_first + coarse) % len(outer.points)
            outward, inward = partners(len(part) - 1, len(outer_part) - 1)
            faces.append(np.column_stack([own[:-1], far[outward], own[1:]]))
            faces.append(np.column_stack([far[:-1], far[1:], own[inward]]))
            first, next_first = first + len(part) - 1, next_first + len(outer_part) - 1
    return np.concatenate(faces or [np.empty((0, 3), np.int32)]).astype(np.int32)


def partners(fine: int, coarse: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The outer node of each inner cell's triangle, and the inner node of each outer cell's."""
    if fine == coarse:
        return np.arange(fine), np.arange(1, coarse + 1)
    return (np.arange(fine) + 1) // 2, np.minimum(2 * np.arange(coarse) + 1, fine)
