"""The rocks that a window should have above each diameter, and those that it has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array
from terrain_forge.model import RockField, World, merge
from terrain_forge.rocks import Expectation, SizeLaw, corridor_area, expected, in_corridor

if TYPE_CHECKING:
    from terrain_forge.rocks import PopulationSpec


@dataclass(frozen=True, kw_only=True)
class ExpectedCounts:
    """The rocks of one population that a window should have."""

    law: SizeLaw
    """The law without limits."""
    smallest: float
    """Least diameter [m]."""
    expectation: Expectation
    """Where the law holds, up to which diameter, and how sure that is."""

    @staticmethod
    def of(spec: PopulationSpec, world: World) -> ExpectedCounts:
        """What a population of a world should have."""
        smallest, _ = spec.diameters
        expectation = expected(spec, site=world.site, window=world.window, ground=world.ground)
        return ExpectedCounts(law=spec.size_frequency, smallest=smallest, expectation=expectation)

    @property
    def largest(self) -> float:
        """Largest diameter anywhere [m]."""
        return max((largest for _, largest in self.expectation.parts), default=self.smallest)

    def number_above(self, diameter: ArrayLike) -> Array:
        """Expected number of rocks above each diameter [m]."""
        return self._above(diameter, self.law.cumulative_number)

    def area_above(self, diameter: ArrayLike) -> Array:
        """Expected sum of πD²/4 of rocks above each diameter [m²]."""
        return self._above(diameter, self.law.cumulative_area)

    def _above(self, diameter: ArrayLike, cumulative: Callable[[ArrayLike], Array]) -> Array:
        total = np.zeros(np.shape(diameter))
        for area, largest in self.expectation.parts:
            total += area * (cumulative(self._clipped(diameter, largest)) - cumulative(largest))
        return total

    def number_variance_above(self, diameter: ArrayLike) -> Array:
        """Variance of the number of rocks above each diameter: more than Poisson's in clusters."""
        number = self.number_above(diameter)
        return number + self._excess * number**2

    def area_variance_above(self, diameter: ArrayLike) -> Array:
        """Variance of the sum of πD²/4 of rocks above each diameter [m⁴]."""
        at = np.asarray(diameter, np.float64)
        variance = self._excess * self.area_above(at) ** 2
        for area, largest in self.expectation.parts:
            limits = self._clipped(at, largest).ravel().tolist()
            single = [self.law.cover_variance(low, largest, 1.0) for low in limits]
            variance = variance + area * np.reshape(single, at.shape)
        return np.asarray(variance)

    @property
    def _excess(self) -> float:
        """Relative variance of the effective area, which all diameters share."""
        area = self.expectation.area
        return self.expectation.area_variance / area**2 if area > 0.0 else 0.0

    def _clipped(self, diameter: ArrayLike, largest: float) -> Array:
        return np.clip(np.asarray(diameter, np.float64), min(self.smallest, largest), largest)


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
        populations = world.field.populations
        self.unsupported = dict(zip(populations, world.unsupported_number, strict=True))
        """Rocks of each population that the ground does not hold."""
        inside = in_corridor(world.site, world.field.position[:, :2])
        counts = np.bincount(world.field.population[inside], minlength=len(populations))
        self.in_corridors = dict(zip(populations, counts.tolist(), strict=True))
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
        nodes = self.nodes(names)
        scale = self._node_area / self.area
        return nodes * scale, float(np.sqrt(nodes)) * scale

    def nodes(self, names: Sequence[str]) -> int:
        """Nodes at which some populations' rocks are on top, one node for each cell."""
        return int(self._nodes[_named(self._seen, names)].sum())


def _outside(field: RockField, world: World) -> RockField:
    return field.select(~in_corridor(world.site, field.position[:, :2]))


def _named(field: RockField, names: Sequence[str]) -> NDArray[np.bool_]:
    """Which rocks belong to populations of these names."""
    asked = np.array([name in names for name in field.populations], np.bool_)
    return np.asarray(asked[field.population])


def _count_nodes(field: RockField, rock_id: NDArray[np.int32]) -> NDArray[np.int64]:
    """Nodes at which each rock (ordered by id) is on top, one node for each cell of the window."""
    ids = rock_id[:-1, :-1]
    seen = ids[ids >= 0]
    row = np.searchsorted(field.id, seen)
    row = row[field.id[np.minimum(row, len(field) - 1)] == seen] if len(field) else row[:0]
    return np.bincount(row, minlength=len(field))
