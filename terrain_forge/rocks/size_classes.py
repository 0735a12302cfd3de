"""Size classes: the octaves of diameter in which rocks are scattered, and their cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.errors import RecipeError
from terrain_forge.rocks.placement import cell_counts
from terrain_forge.rocks.populations import MAX_ROCKS, PopulationSpec
from terrain_forge.seeds import mix, stage_key
from terrain_forge.site import Site
from terrain_forge.world import RockLibrary

Rectangle = tuple[float, float, float, float]
"""West, south, east, north [m]."""

_ROCKS_PER_CELL = 40.0
_DIAMETERS_PER_CELL = 40.0
_MAX_ROCKS_PER_CELL = 500.0
_COLOURS = 4


@dataclass(frozen=True, kw_only=True)
class SizeClass:
    """One octave of diameter of one population, and the cells that divide the site for it."""

    population: int
    """Index of the population."""
    key: np.uint64
    """Address of all that is drawn for the class."""
    smallest: float
    """Smallest diameter [m]."""
    largest: float
    """Largest diameter [m]."""
    radius: float
    """Radius [m] of the largest rock's circle."""
    columns: int
    """Cells of the site from west to east."""
    rows: int
    """Cells of the site from south to north."""
    side: tuple[float, float]
    """Size of a cell, east and north [m]."""
    split: int
    """Bins that a cell is cut into each way, of about one rock each."""
    counts: NDArray[np.int64]
    """Rocks in each cell of the site, shape [rows, columns]."""
    first_id: NDArray[np.int64]
    """Id of each cell's first rock, shape [rows, columns]."""


@dataclass(frozen=True, kw_only=True)
class Region:
    """A rectangle of the cells of a class."""

    column: int
    """First cell, from the west."""
    row: int
    """First cell, from the south."""
    columns: int
    """Cells from west to east."""
    rows: int
    """Cells from south to north."""

    def cut(self, grid: NDArray[np.int64]) -> NDArray[np.int64]:
        """The region's part of a grid of all cells, shape [rows, columns]."""
        return grid[self.row : self.row + self.rows, self.column : self.column + self.columns]

    def rectangle(self, size_class: SizeClass, site: Site) -> Rectangle:
        """The ground that the cells cover [m]."""
        width, depth = size_class.side
        west, south = site.west + self.column * width, site.south + self.row * depth
        return west, south, west + self.columns * width, south + self.rows * depth


def size_classes(
    *, site: Site, populations: tuple[PopulationSpec, ...], library: RockLibrary
) -> list[SizeClass]:
    """The size classes of all populations, in the order in which they are placed: largest first.

    Raises:
        RecipeError: if a population is too dense to be placed without overlap, or too numerous.
    """
    reach = max(prototype.reach for prototype in library.prototypes)
    found = []
    for index, population in enumerate(populations):
        found += _octaves(site, population, index, reach)
    return sorted(found, key=lambda c: (-c.largest, c.population, -c.smallest))


def _octaves(site: Site, population: PopulationSpec, index: int, reach: float) -> list[SizeClass]:
    """The classes of one population, smallest first."""
    law = population.size_frequency
    low, last = population.diameter_range(site.size[0] * site.size[1])
    key = stage_key(site.seed, f"rocks/{population.name}")
    next_id, octave, classes = index * MAX_ROCKS, 0, []
    while low < last:
        high = min(2.0 * low, last)
        density = float(law.cumulative_number(low) - law.cumulative_number(high))
        columns, rows = _divide(site, density, high, reach)
        side = site.size[0] / columns, site.size[1] / rows
        mean = density * side[0] * side[1]
        if mean > _MAX_ROCKS_PER_CELL:
            raise RecipeError(
                f"{population.name}: {density:.3g} rocks of {low:.3g} to {high:.3g} m on a square "
                "metre: so many cannot be packed without overlap",
                key=("rocks", "populations", index),
            )
        class_key = np.uint64(mix(key, octave))
        counts = cell_counts(class_key, columns, rows, mean)
        ids = next_id + np.cumsum(counts.ravel())
        classes.append(
            SizeClass(
                population=index,
                key=class_key,
                smallest=low,
                largest=high,
                radius=reach * high,
                columns=columns,
                rows=rows,
                side=side,
                split=max(int(mean**0.5), 1),
                counts=counts,
                first_id=ids.reshape(counts.shape) - counts,
            )
        )
        next_id, low, octave = int(ids[-1]), high, octave + 1
    if next_id > (index + 1) * MAX_ROCKS:
        raise RecipeError(
            f"{population.name}: {next_id - index * MAX_ROCKS} rocks, at most {MAX_ROCKS}: "
            "raise the smallest diameter",
            key=("rocks", "populations", index),
        )
    return classes


def _divide(site: Site, density: float, diameter: float, reach: float) -> tuple[int, int]:
    """Columns and rows of cells for a density [1/m²] of rocks up to a diameter [m].

    A cell must be wider than two rocks, so that cells of one colour are independent. It is large
    enough for its rocks to find room in it, even where larger rocks crowd it, and no larger, so
    that a window depends on little around it.
    """
    roomy = _DIAMETERS_PER_CELL * diameter
    if density * roomy**2 > _ROCKS_PER_CELL:
        roomy = (_ROCKS_PER_CELL / density) ** 0.5
    side = max(roomy, 4.0 * reach * diameter)
    columns, rows = (max(int(length / side), 1) for length in site.size)
    return columns, rows


def regions(classes: list[SizeClass], window: Rectangle, site: Site) -> list[Region]:
    """The cells of each class that the rocks of a window [m] depend on.

    From the smallest class to the largest: what can reach into the window, or into the cells that
    smaller classes need, and around it three more rings of cells, since a cell of the last colour
    depends on its neighbours of the third, these on theirs of the second, these on the first.
    """
    found: list[Region] = []
    needed: list[tuple[Rectangle, float]] = [(window, 0.0)]
    for size_class in reversed(classes):
        grown = [_grow(area, radius + size_class.radius) for area, radius in needed]
        lows, highs = np.min(grown, axis=0)[:2], np.max(grown, axis=0)[2:]
        region = _cells(size_class, (*lows, *highs), site)
        found.append(region)
        needed.append((region.rectangle(size_class, site), size_class.radius))
    return found[::-1]


def _grow(area: Rectangle, margin: float) -> Rectangle:
    west, south, east, north = area
    return west - margin, south - margin, east + margin, north + margin


def _cells(size_class: SizeClass, area: Rectangle, site: Site) -> Region:
    """The cells that touch an area, and three rings around, as far as the site goes."""
    rings = _COLOURS - 1
    first, last = [], []
    for axis, count in enumerate((size_class.columns, size_class.rows)):
        edge = (site.west, site.south)[axis]
        low, high = ((area[axis + n] - edge) / size_class.side[axis] for n in (0, 2))
        first.append(int(np.clip(np.floor(low) - rings, 0, count - 1)))
        last.append(int(np.clip(np.floor(high) + rings, 0, count - 1)))
    return Region(
        column=first[0],
        row=first[1],
        columns=last[0] - first[0] + 1,
        rows=last[1] - first[1] + 1,
    )
