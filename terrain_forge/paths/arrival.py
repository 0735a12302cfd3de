"""How hard a world is for a rover: from which part of random starts it arrives at its goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, stage_key, uniforms
from terrain_forge.paths.traversability_field import IMPASSABLE, Traversability

_TRIES = 64
_AT_ONCE = 512
"""Starts whose goals and lines are in memory at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrivals(Record):
    """How many of many drives arrive, by what ground and rocks let pass; nothing is simulated."""

    planned: float
    """Part of the starts from which some way leads to the goal, 0 to 1."""
    straight: float
    """Part of them from which the straight line does, 0 to 1."""
    passable: float
    """Part of the area on which the rover's centre can be, 0 to 1."""


def arrivals(
    field: Traversability, *, seed: int, starts: int, distance: float | None = None
) -> Arrivals:
    """Draw starts and goals, and see which of them a planner connects.

    Starts are drawn evenly over the area whose cost is known; one where the rover cannot be has not
    arrived. Each goal is the first of 64 draws at the distance that the rover can be at; where none
    is, the start has not arrived either. No way leads diagonally past what bars it.

    Args:
        field: What the rover can pass.
        seed: Of starts and goals.
        starts: How many.
        distance: From start to goal [m]; by default half of the shorter side.
    """
    from scipy.ndimage import label

    known, passable = field.cost >= 0.0, (field.cost >= 0.0) & (field.cost < IMPASSABLE)
    if not known.any():
        return Arrivals(planned=0.0, straight=0.0, passable=0.0)
    if distance is None:
        distance = 0.5 * (min(known.shape) - 1) * field.spacing
    every = uniforms(stage_key(seed, "arrivals"), starts * (1 + _TRIES)).reshape(starts, -1)
    nodes, (way, _) = np.argwhere(known), label(passable)
    planned = straight = 0
    for first in range(0, starts, _AT_ONCE):
        drawn = every[first : first + _AT_ONCE]
        begin = nodes[np.minimum((drawn[:, 0] * len(nodes)).astype(np.int64), len(nodes) - 1)]
        end, found = _goals(passable, begin, drawn[:, 1:], distance / field.spacing)
        own, goal = way[begin[:, 0], begin[:, 1]], way[end[:, 0], end[:, 1]]
        arrives = found & (own > 0) & (own == goal)
        planned += int(arrives.sum())
        straight += int((arrives & _free_lines(passable, begin, end)).sum())
    return Arrivals(
        planned=planned / starts,
        straight=straight / starts,
        passable=float(passable.sum() / known.sum()),
    )


def _goals(
    passable: NDArray[np.bool_], begin: NDArray[np.int64], drawn: Array, reach: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """For each start the first node at a distance [cells] that can be passed, and if there is."""
    turn = 2.0 * np.pi * drawn
    row = np.rint(begin[:, :1] + reach * np.sin(turn)).astype(np.int64)
    column = np.rint(begin[:, 1:] + reach * np.cos(turn)).astype(np.int64)
    rows, columns = passable.shape
    within = (row >= 0) & (column >= 0) & (row < rows) & (column < columns)
    free = within & passable[row.clip(0, rows - 1), column.clip(0, columns - 1)]
    first = free.argmax(axis=1)
    each = np.arange(len(begin))
    found = free[each, first]
    end = np.stack([row[each, first], column[each, first]], -1)
    return np.where(found[:, None], end, begin), found


def _free_lines(
    passable: NDArray[np.bool_], begin: NDArray[np.int64], end: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Which straight lines between nodes pass over passable ones alone."""
    longest = int(np.abs(end - begin).max(initial=1))
    part = np.linspace(0.0, 1.0, 2 * longest + 1)[:, None, None]
    row, column = np.moveaxis(np.rint(begin + part * (end - begin)).astype(np.int64), -1, 0)
    return np.asarray(passable[row, column].all(axis=0))
