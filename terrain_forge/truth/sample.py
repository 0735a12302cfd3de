"""The rocks of a world that its verification is about, and the ground that they lie on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.model import RockField, World, merge
from terrain_forge.rocks import corridor_area, in_corridor


class Sample:
    """The rocks of a world outside its corridors, and what of the ground they cover."""

    def __init__(self, world: World, rock_id: NDArray[np.int32]) -> None:
        cells = world.window.columns * world.window.rows
        whole = float(cells * world.ground.spacing**2)
        self.area = whole - corridor_area(world.site, world.window)
        """Area outside the corridors [m²]."""
        self.left_out = whole - self.area
        """Area of the corridors [m²]."""
        self.perimeter = 2.0 * world.ground.spacing * (world.window.columns + world.window.rows)
        """Length of the window's border [m]."""
        self.field = _outside(world.field, world)
        """The rocks whose centre lies in the window."""
        self.unplaced = dict(zip(world.field.populations, world.unplaced, strict=True))
        """Rocks of each population that found no place."""
        inside = in_corridor(world.site, world.field.position[:, :2])
        self.in_corridors = _count(world.field, inside)
        """Rocks of each population in corridors and exclusion zones."""
        self._seen = _outside(merge(world.field, world.neighbours), world)
        self._nodes = _count_nodes(self._seen, rock_id)
        self._node_area = world.ground.spacing**2

    def select(self, names: Sequence[str]) -> RockField:
        """The rocks of some populations."""
        return self.field.select(_named(self.field, names))

    def outline(self, names: Sequence[str]) -> tuple[float, float]:
        """Part of the area that some populations' rocks are seen to cover, and its standard error.

        A rock's place does not depend on the nodes, so they count without bias; the error is that
        of independent nodes, which is more than that of nodes on a lattice.
        """
        nodes = int(self._nodes[_named(self._seen, names)].sum())
        scale = self._node_area / self.area
        return nodes * scale, float(np.sqrt(nodes)) * scale


def _count(field: RockField, chosen: NDArray[np.bool_]) -> dict[str, int]:
    """How many of some rocks each population has."""
    counts = np.bincount(field.population[chosen], minlength=len(field.populations))
    return dict(zip(field.populations, counts.tolist(), strict=True))


def _outside(field: RockField, world: World) -> RockField:
    return field.select(~in_corridor(world.site, field.position[:, :2]))


def _named(field: RockField, names: Sequence[str]) -> NDArray[np.bool_]:
    """Which rocks belong to populations of these names."""
    asked = np.array([name in names for name in field.populations], np.bool_)
    result: NDArray[np.bool_] = asked[field.population]
    return result


def _count_nodes(field: RockField, rock_id: NDArray[np.int32]) -> NDArray[np.int64]:
    """Nodes at which each rock (ordered by id) is on top, one node for each cell of the window."""
    ids = rock_id[:-1, :-1]
    seen = ids[ids >= 0]
    row = np.searchsorted(field.id, seen)
    row = row[field.id[np.minimum(row, len(field) - 1)] == seen] if len(field) else row[:0]
    return np.bincount(row, minlength=len(field))
