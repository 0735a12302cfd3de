"""From a path over grid nodes to a smooth line: shortcuts of any angle, then a bending beam."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel

Weight = NDArray[np.float32]

_ROUNDS = 400
"""Rounds of smoothing: they round corners over about four of the line's points to each side."""

_DEARER = 3.0
"""Weight by which smoothing may make a point dearer: less leaves bends where the cost is uneven."""


def straighten(weight: Weight, nodes: NDArray[np.int64], *, step: float) -> Array:
    """A line of straight legs from the first to the last of some nodes, where they cost no more.

    Args:
        weight: As for `cheapest_path`, shape [rows, columns].
        nodes: Rows and columns of a path over them, shape [nodes, 2].
        step: Distance of the line's points [cells].

    Returns:
        Columns and rows, shape [points, 2].
    """
    line = np.asarray(nodes[:, ::-1], np.float64)
    corners = line[_shortcuts(np.ascontiguousarray(weight), line)]
    points = [corners[:1]]
    for begin, end in pairwise(corners):
        count = max(math.ceil(math.dist(begin, end) / step), 1)
        share = np.arange(1, count + 1)[:, None] / count
        points.append((1.0 - share) * begin + share * end)
    return np.concatenate(points)


def bend(weight: Weight, line: Array, fixed: NDArray[np.bool_]) -> Array:
    """The line without kinks, nowhere barred.

    Args:
        weight: As for `cheapest_path`, shape [rows, columns].
        line: Columns and rows, shape [points, 2].
        fixed: Which points stay where they are, as both ends do, shape [points].
    """
    smooth = np.array(line, np.float64)
    _bend(weight, smooth, fixed, _ROUNDS)
    return smooth


@kernel
def _shortcuts(weight, line):  # type: ignore[no-untyped-def]
    """Indices of the points that remain when straight legs replace what costs no less."""
    kept = np.empty(len(line), np.int64)
    kept[0], count, anchor, way = 0, 1, 0, 0.0
    for n in range(1, len(line)):
        way += line_cost(weight, line[n - 1], line[n])
        if line_cost(weight, line[anchor], line[n]) > way * (1.0 + 1e-9):
            anchor = n - 1
            kept[count] = anchor
            count += 1
            way = line_cost(weight, line[anchor], line[n])
    kept[count] = len(line) - 1
    return kept[: count + 1]


@inner
def line_cost(weight, begin, end):  # type: ignore[no-untyped-def]
    """Length times weight along a straight line of columns and rows, infinite where barred."""
    right, up = end[0] - begin[0], end[1] - begin[1]
    length = np.sqrt(right * right + up * up)
    count = int(np.ceil(4.0 * length))
    total = 0.0
    for n in range(count):
        share = (n + 0.5) / count
        total += weight[round(begin[1] + share * up), round(begin[0] + share * right)]
    return total * length / max(count, 1)


@kernel
def _bend(weight, line, fixed, rounds):  # type: ignore[no-untyped-def]
    """Move inner points to where an elastic beam through their neighbours would be (Gauss-Seidel).

    A point stays where the move would lead onto a barred node or to a much dearer one.
    """
    count = len(line)
    for _ in range(rounds):
        for n in range(1, count - 1):
            if fixed[n]:
                continue
            if n == 1 or n == count - 2:
                x = 0.5 * (line[n - 1, 0] + line[n + 1, 0])
                y = 0.5 * (line[n - 1, 1] + line[n + 1, 1])
            else:
                near_x, near_y = line[n - 1] + line[n + 1]
                far_x, far_y = line[n - 2] + line[n + 2]
                x, y = (4.0 * near_x - far_x) / 6.0, (4.0 * near_y - far_y) / 6.0
            was = weight[round(line[n, 1]), round(line[n, 0])]
            if weight[round(y), round(x)] <= was + _DEARER:
                line[n, 0], line[n, 1] = x, y
