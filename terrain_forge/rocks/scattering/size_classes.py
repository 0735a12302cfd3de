"""Size classes: the octaves of diameter in which a population's rocks are scattered."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Key, RecipeError, mix, stage_key
from terrain_forge.model import RockLibrary, Site
from terrain_forge.rocks.arrangement import Clustered, crowding
from terrain_forge.rocks.populations import LAST_ID, MAX_ROCKS, PopulationSpec
from terrain_forge.rocks.scattering import clusters
from terrain_forge.rocks.scattering.cells import (
    Cells,
    Region,
    cell_counts,
    divide,
    region_counts,
)
from terrain_forge.rocks.scattering.clusters import Parents
from terrain_forge.rocks.scattering.intensity import Intensity, crater_bounds

DYNAMIC_SPACE = 1.25
"""Space that a dynamic rock is given, over what it needs at rest: it is yet to settle on the
ground, and no neighbour may hold it."""

_MAX_ROCKS_PER_CELL = 500.0
_BOUNDED_PARTS = 1024
_SPREAD, _SPARE = 10.0, 20
"""Standard deviations above the mean, and so many more, for which a cell has ids: a cell with more
rocks, of which there is none in 10^20, has no more than that."""
_MOST_PARTS = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class SizeClass:
    """One octave of diameter of one population."""

    population: int
    """Index of the population."""
    key: np.uint64
    """Address of all that is drawn for the class."""
    smallest: float
    """Smallest diameter [m]."""
    largest: float
    """Largest diameter [m]."""
    cells: Cells
    """The cells in which its rocks are placed."""
    drawing: Cells
    """The cells by which its rocks are drawn, whatever else lies on the site; most often the same.
    """
    bounds: Array | None
    """How much denser than the law the rocks are drawn in each cell, shape [rows, columns]; None
    for 1 everywhere."""
    parents: Parents | None
    """The clusters that the rocks belong to, if any."""
    counts: NDArray[np.int64] | None
    """Rocks that are drawn in each cell, shape [rows, columns], or for each parent; None where they
    are drawn for the cells that are asked for alone."""
    mean: float
    """Expected number of rocks in a cell, where none is denser than another."""
    most: int
    """Ids that a cell has; 0 where ids go on cell by cell or parent by parent."""
    first_id: int
    """Id of the first rock."""

    def ids_of(self, region: Region) -> NDArray[np.int64]:
        """The first id of each cell of a region of `drawing`, shape [rows, columns]."""
        if self.counts is None:
            rows = region.row + np.arange(region.rows)
            columns = region.column + np.arange(region.columns)
            return self.first_id + self.most * (rows[:, None] * self.drawing.columns + columns)
        before = np.cumsum(self.counts.ravel()).reshape(self.counts.shape) - self.counts
        return region.cut(self.first_id + before)

    def counts_of(self, region: Region) -> NDArray[np.int64]:
        """Rocks that are drawn in each cell of a region of `drawing`, shape [rows, columns]."""
        if self.counts is None:
            found: NDArray[np.int64] = region_counts(self.key, *region, self.mean, self.most)
            return found
        return region.cut(self.counts)


def size_classes(
    *,
    site: Site,
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    intensity: Intensity,
) -> list[SizeClass]:
    """The size classes of all populations, in the order in which they are placed: largest first.

    Raises:
        RecipeError: if a population is too dense to be placed without overlap, or too numerous.
    """
    found: list[SizeClass] = []
    circle = _largest_circle(site, populations, library, intensity)
    many = any(population.is_many(site.size) for population in populations)
    next_id = sum(len(site.table(spec.file).values) for spec in site.recipe.rocks.lists) * many
    for index, population in enumerate(populations):
        first_id = next_id if many else index * MAX_ROCKS
        classes, next_id = _octaves(site, population, index, library, intensity, circle, first_id)
        found += classes
    if many and next_id > LAST_ID:
        raise RecipeError(
            f"the rocks need {next_id:.3g} ids, at most {LAST_ID:.3g}: raise the smallest "
            "diameters",
            key=("rocks", "populations"),
        )
    return sorted(found, key=lambda c: (-c.largest, c.population, -c.smallest))


def shapes_of(
    families: tuple[str, ...] | None, library: RockLibrary, where: Key
) -> NDArray[np.int64]:
    """Indices of the library's shapes that belong to some families, or of all of them."""
    there = [prototype.family for prototype in library.prototypes]
    for family in families or ():
        if family not in there:
            raise RecipeError(
                f"the library has no shape of the family {family!r}, it has: "
                f"{', '.join(dict.fromkeys(there))}",
                key=(*where, "families"),
            )
    chosen = np.array([families is None or family in families for family in there])
    return np.flatnonzero(chosen)


def is_dynamic(population: PopulationSpec, diameter: Array) -> NDArray[np.bool_]:
    """Which diameters [m] are those of dynamic rocks."""
    smallest, largest = population.dynamic_m or (np.inf, np.inf)
    return (diameter >= smallest) & (diameter <= largest)


def _octaves(
    site: Site,
    population: PopulationSpec,
    index: int,
    library: RockLibrary,
    intensity: Intensity,
    circle: float,
    first_id: int,
) -> tuple[list[SizeClass], int]:
    """The classes of one population, smallest first, and the id after those of its rocks."""
    where, arrangement = ("rocks", "populations", index), population.arrangement
    shapes = shapes_of(population.families, library, where)
    reach = max(library.prototypes[shape].reach for shape in shapes)
    low, last = population.diameters
    last = min(last, intensity.largest_rock(index))
    dynamic_low, dynamic_high = population.dynamic_m or (np.inf, np.inf)
    key = stage_key(site.seed, f"rocks/{population.name}")
    parents = None
    if isinstance(arrangement, Clustered):
        parents = clusters.parents(arrangement, site=site, key=key, where=where)
    next_id, many = first_id, population.is_many(site.size)
    found: list[SizeClass] = []
    while low < last:
        high = min(2.0 * low, last)
        space = DYNAMIC_SPACE if dynamic_low <= high and dynamic_high >= low else 1.0
        drawing, cells = divide(
            site,
            density=population.density(low, high) * max(crowding(arrangement), 1.0),
            diameter=high,
            radius=reach * high * space,
            largest=circle,
            local=intensity.thins(index) or parents is not None,
        )
        bounds = _bounds(intensity, index, low, drawing) if intensity.around[index] else None
        class_key = np.uint64(mix(key, len(found)))
        mean = population.density(low, high) * drawing.side[0] * drawing.side[1]
        counts, most = None, 0
        if many:
            most = math.ceil(mean + _SPREAD * math.sqrt(mean)) + _SPARE
        else:
            counts = _counts(population, (low, high), class_key, drawing, bounds, parents, where)
        found.append(
            SizeClass(
                population=index,
                key=class_key,
                smallest=low,
                largest=high,
                cells=cells,
                drawing=drawing,
                bounds=bounds,
                parents=parents,
                counts=counts,
                mean=mean,
                most=most,
                first_id=next_id,
            )
        )
        used = most * drawing.rows * drawing.columns if counts is None else int(counts.sum())
        next_id, low = next_id + used, high
    if not many and next_id > first_id + MAX_ROCKS:
        raise RecipeError(
            f"{population.name}: {next_id - first_id} rocks, at most {MAX_ROCKS}: "
            "raise the smallest diameter",
            key=where,
        )
    return found, next_id


def _largest_circle(
    site: Site,
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    intensity: Intensity,
) -> float:
    """Radius [m] of a circle that holds any rock of the site."""
    largest = [0.0]
    for index, population in enumerate(populations):
        _, dynamic = population.dynamic_diameters or (0.0, 0.0)
        found = min(population.diameters[1], intensity.largest_rock(index))
        largest += [found, DYNAMIC_SPACE * min(found, dynamic)]
    for spec in site.recipe.rocks.lists:
        largest.append(float(site.table(spec.file).column("diameter_m").max(initial=0.0)))
    return max(prototype.reach for prototype in library.prototypes) * max(largest)


def _counts(
    population: PopulationSpec,
    sizes: tuple[float, float],
    key: np.uint64,
    cells: Cells,
    bounds: Array | None,
    parents: Parents | None,
    where: Key,
) -> NDArray[np.int64]:
    """Poisson numbers of rocks of a class in each cell, or of each parent."""
    density, arrangement = population.density(*sizes), population.arrangement
    most = density * (1.0 if bounds is None else float(bounds.max()))
    if most * cells.area > _MAX_ROCKS_PER_CELL:
        raise RecipeError(
            f"{population.name}: {most:.3g} rocks of {sizes[0]:.3g} to {sizes[1]:.3g} m on a "
            "square metre: so many cannot be packed without overlap",
            key=where,
        )
    if parents is not None and isinstance(arrangement, Clustered):
        mean = density / arrangement.clusters_per_m2
        counts: NDArray[np.int64] = clusters.numbers(parents.address, key, mean)
        return counts
    means = np.full((cells.rows, cells.columns), density * cells.side[0] * cells.side[1])
    counts = cell_counts(key, means if bounds is None else means * bounds)
    return counts


def _bounds(intensity: Intensity, index: int, smallest: float, cells: Cells) -> Array:
    """Upper bound of the craters' weight in each cell, the largest of those in parts of it.

    A cell of large rocks holds many small craters, whose weights are not largest at one place.
    """
    parts = int(np.clip(_BOUNDED_PARTS // max(cells.columns, cells.rows), 1, _MOST_PARTS))
    rows, columns = cells.rows * parts, cells.columns * parts
    fine = crater_bounds(intensity, index, smallest, columns, rows)
    return np.asarray(fine.reshape(cells.rows, parts, cells.columns, parts).max(axis=(1, 3)))
