"""Paths over a grid: the cheapest one by A* (Hart, Nilsson & Raphael 1968), made smooth.

The search: doi:10.1109/TSSC.1968.300136. Smoothing: shortcuts of any angle, then a bending beam.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, heap_pop, heap_push, inner, kernel

MOVES = np.array(
    [
        *((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)),
        *((2, 1), (1, 2), (-1, 2), (-2, 1), (-2, -1), (-1, -2), (1, -2), (2, -1)),
    ]
)
"""Steps from a node in rows and columns, shape [16, 2]; no turn is sharper than 26.6°."""
Weight = NDArray[np.float32]
_ROUNDS = 400
"""Rounds of smoothing: they round corners over about four of the line's points to each side."""
_DEARER = 3.0
"""Weight by which smoothing may make a point dearer: less leaves bends where the cost is uneven."""


class GridPath(NamedTuple):
    """What a search found."""

    nodes: NDArray[np.int64]
    """Rows and columns from start to goal, shape [nodes, 2]; none where there is no path."""
    cost: float
    """Sum of length [cells] times weight; infinite where there is no path."""
    nearest: tuple[int, int]
    """Row and column of the node nearest to the goal that can be reached."""
    reached: int
    """Number of nodes that were reached."""


def cheapest_path(
    weight: NDArray[np.float32], *, start: tuple[int, int], goal: tuple[int, int]
) -> GridPath:
    """The cheapest path between two nodes, each a row and a column of a grid, in 16 directions.

    A step costs its length times the mean weight of the nodes that it joins and, for a knight's
    step, of the two between them. No step leads over or diagonally past a node of infinite weight;
    other weights are at least 1.
    """
    columns = weight.shape[1]
    first, last = start[0] * columns + start[1], goal[0] * columns + goal[1]
    parent, cost, nearest, reached = _search(np.ascontiguousarray(weight), first, last, MOVES)
    near = (int(nearest) // columns, int(nearest) % columns)
    if not np.isfinite(cost):
        return GridPath(np.zeros((0, 2), np.int64), np.inf, near, int(reached))
    nodes = [last]
    while nodes[-1] != first:
        nodes.append(int(parent[nodes[-1]]))
    flat = np.array(nodes[::-1])
    return GridPath(
        np.stack([flat // columns, flat % columns], -1), float(cost), near, int(reached)
    )


@kernel
def _search(weight, start, goal, moves):  # type: ignore[no-untyped-def]
    """Parents, cost of the goal, the reached node nearest to it, and how many were reached."""
    columns = weight.shape[1]
    best = np.full(weight.size, np.inf)
    parent = np.full(weight.size, -1, np.int32)
    settled = np.zeros(weight.size, np.bool_)
    keys, nodes = np.empty(1024), np.empty(1024, np.int32)
    target = goal // columns, goal % columns
    nearest, least, reached = start, np.inf, 0
    if not np.isfinite(weight[start // columns, start % columns]):
        return parent, np.inf, nearest, reached
    best[start] = 0.0
    size = heap_push(keys, nodes, 0, 0.0, start)
    while size:
        node = nodes[0]
        size = heap_pop(keys, nodes, size)
        if settled[node]:
            continue
        settled[node] = True
        reached += 1
        ahead = np.hypot(node // columns - target[0], node % columns - target[1])
        if ahead < least:
            nearest, least = node, ahead
        if node == goal:
            break
        if size + len(moves) > len(keys):
            keys = np.concatenate((keys, np.empty(size)))
            nodes = np.concatenate((nodes, np.empty(size, np.int32)))
        size = _relax(weight, moves, node, target, best, parent, keys, nodes, size)
    return parent, best[goal], nearest, reached


@inner
def _relax(weight, moves, node, target, best, parent, keys, nodes, size):  # type: ignore[no-untyped-def]
    """Put the nodes that are cheaper by way of this one into the heap; returns its new size."""
    rows, columns = weight.shape
    j, i = node // columns, node % columns
    for move in range(len(moves)):
        down, right = moves[move, 0], moves[move, 1]
        row, column = j + down, i + right
        if row < 0 or column < 0 or row >= rows or column >= columns:
            continue
        other = row * columns + column
        # Weights are at least 1: most nodes around are settled for less than the bare length.
        length = np.sqrt(down * down + right * right)
        if best[node] + length * 0.25 * (3.0 + weight[row, column]) >= best[other]:
            continue
        total = best[node] + _step_cost(weight, j, i, down, right)
        if total < best[other]:
            best[other], parent[other] = total, node
            ahead = np.hypot(row - target[0], column - target[1])
            size = heap_push(keys, nodes, size, total + ahead, other)
    return size


@inner
def _step_cost(weight, j, i, down, right):  # type: ignore[no-untyped-def]
    """Length times mean weight of a step; infinite where it is barred."""
    ends = np.float64(weight[j, i]) + weight[j + down, i + right]
    if down == 0 or right == 0:
        return 0.5 * ends
    if abs(down) == abs(right):
        beside = np.float64(weight[j + down, i]) + weight[j, i + right]
        return np.sqrt(2.0) * 0.5 * ends if np.isfinite(beside) else np.inf
    half_down, half_right = int(down / 2), int(right / 2)
    rest_down, rest_right = down - half_down, right - half_right
    between = np.float64(weight[j + half_down, i + half_right])
    between += weight[j + rest_down, i + rest_right]
    return np.sqrt(5.0) * 0.25 * (ends + between)


def straighten(weight: Weight, nodes: NDArray[np.int64], *, step: float) -> Array:
    """A line of straight legs from the first to the last of some nodes, where they cost no more.

    Nodes are rows and columns, the line's points columns and rows, `step` apart [cells].
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
    """The line of columns and rows without kinks, nowhere barred; fixed points and ends stay."""
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
