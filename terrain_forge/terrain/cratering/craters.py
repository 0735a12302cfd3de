"""The craters of a ground: what is known of each."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, Rows, kernel, portable, shaped
from terrain_forge.terrain.cratering.degradation import ROWS, STEP, worn_shapes

_DEEP = 0.04
"""Depth over diameter from which a crater shows: its walls still reach some 5°. Those of an
equilibrium end at 0.046."""
_KEPT_DEPTH = 0.5
"""Part of the fresh depth from which one that was never as deep shows, too."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Craters(Rows):
    """Craters, one row each, the youngest first."""

    id: NDArray[np.uint64] = field(metadata=shaped("craters", dtype=np.uint64))
    """Address, the same in every window of the site, shape [craters]."""
    listed: NDArray[np.bool_] = field(metadata=shaped("craters", dtype=np.bool_))
    """Which ones the user has listed, shape [craters]."""
    xy: Array = field(metadata=shaped("craters", 2))
    """East and north of the centre [m], shape [craters, 2]."""
    diameter: Array = field(metadata=shaped("craters"))
    """Rim-to-rim diameter [m], shape [craters]."""
    age: Array = field(metadata=shaped("craters"))
    """Age [10⁹ years], shape [craters]."""
    fresh_depth: Array = field(metadata=shaped("craters"))
    """Depth when it was fresh, crest to floor [m], shape [craters]."""
    fresh_rim: Array = field(metadata=shaped("craters"))
    """Height of the crest above the ground around when it was fresh [m], shape [craters]."""
    fresh_ejecta: Array = field(metadata=shaped("craters"))
    """Thickness of the ejecta at the crest when it was fresh [m], shape [craters]."""
    wear: Array = field(metadata=shaped("craters"))
    """τ = κ t / D², what diffusion has done to it, shape [craters]."""

    @property
    def weights(self) -> Array:
        """Factors of the three shapes of a profile [m], shape [craters, 3]."""
        return np.column_stack(
            [self.fresh_depth, self.fresh_rim - self.fresh_ejecta, self.fresh_ejecta]
        )

    @property
    def reach(self) -> Array:
        """Where a crater ends [m], 0 for one that is gone, shape [craters]."""
        _, reach = worn_shapes()
        row, _ = table_place(self.wear)
        ends = np.maximum(reach[row], reach[row + 1])
        return np.asarray(np.where(self.wear < 1.0, 0.5 * self.diameter * ends, 0.0))

    @property
    def depth(self) -> Array:
        """Depth as it is now, highest to lowest point of its own profile [m], shape [craters]."""
        row, share = table_place(self.wear)
        depth = _relief(worn_shapes()[0], row, share, self.weights)
        return np.asarray(np.where(self.wear < 1.0, depth, 0.0))

    @property
    def shows(self) -> Mask:
        """Which ones are deep enough now to be called craters, shape [craters]."""
        least = np.minimum(_DEEP * self.diameter, _KEPT_DEPTH * self.fresh_depth)
        return np.asarray(self.depth >= least)

    def profile(self, number: int, distance: Array) -> Array:
        """Height [m] above the ground around of one crater at distances from its centre [m]."""
        row, share = table_place(self.wear[number : number + 1])
        table, _ = worn_shapes()
        between = (1.0 - share[0]) * table[row[0]] + share[0] * table[row[0] + 1]
        heights = portable.product(between, self.weights[number])
        x = np.asarray(distance) / (0.5 * self.diameter[number])
        height = np.interp(x, STEP * np.arange(len(heights)), heights, right=0.0)
        return np.asarray(height * (self.wear[number] < 1.0))


def table_place(wear: Array) -> tuple[NDArray[np.int64], Array]:
    """Row of the table of worn shapes below each τ, and how far it is to the next, 0 to 1."""
    place = np.sqrt(np.minimum(wear, 1.0)) * (ROWS - 1)
    row = np.minimum(place.astype(np.int64), ROWS - 2)
    return row, place - row


@kernel
def _relief(table, row, share, weights):  # type: ignore[no-untyped-def]
    """Highest minus lowest point of each profile."""
    found = np.empty(len(row))
    for n in range(len(row)):
        low = high = 0.0
        below, above = table[row[n]], table[row[n] + 1]
        for x in range(table.shape[1]):
            height = 0.0
            for s in range(3):
                value = below[x, s] + share[n] * (above[x, s] - below[x, s])
                height += weights[n, s] * value
            low, high = min(low, height), max(high, height)
        found[n] = high - low
    return found
