"""What chance gives the rocks, by address: first places, sizes, shapes, yaws and burials."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import RockLibrary, Site
from terrain_forge.rocks.arrangement import Clustered
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.rocks.scattering.addresses import (
    BURIED,
    EAST,
    KEEP,
    NORTH,
    PROTOTYPE,
    SIZE,
    YAW,
    addresses,
    draw,
    words,
)
from terrain_forge.rocks.scattering.cells import Region
from terrain_forge.rocks.scattering.clusters import TRUNCATION, Parents, offspring
from terrain_forge.rocks.scattering.intensity import Intensity, weights
from terrain_forge.rocks.scattering.size_classes import SizeClass, is_dynamic, shapes_of


class Candidates(NamedTuple):
    """Rocks at their first places, ordered by class, cell and id; shapes begin with [rocks]."""

    id: NDArray[np.int64]
    """Id."""
    population: NDArray[np.int64]
    """Index of the population."""
    address: NDArray[np.uint64]
    """Hashed address."""
    xy: Array
    """East and north [m], shape [rocks, 2]."""
    diameter: Array
    """Exposed plan diameter [m]."""
    prototype: NDArray[np.int64]
    """Index into the library."""
    yaw: Array
    """Turn about the ground's normal [rad]."""
    buried: Array
    """Part of the rock's extent below the ground."""
    dynamic: NDArray[np.bool_]
    """Whether it can be pushed."""


def join(parts: list[Candidates]) -> Candidates:
    """One after the other."""
    if parts:
        return Candidates(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    real, whole = np.zeros(0), np.zeros(0, np.int64)
    address, dynamic = np.zeros(0, np.uint64), np.zeros(0, np.bool_)
    return Candidates(whole, whole, address, np.zeros((0, 2)), real, whole, real, real, dynamic)


class _Unthinned(NamedTuple):
    """Rocks of a class before thinning, ordered by cell and id."""

    id: NDArray[np.int64]
    address: NDArray[np.uint64]
    xy: Array
    cell: NDArray[np.int64]
    """Cell within the region, counted row by row."""

    def of(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> _Unthinned:
        """Those of a mask or of an index array."""
        return _Unthinned(self.id[rows], self.address[rows], self.xy[rows], self.cell[rows])


def draw_class(
    size_class: SizeClass,
    region: Region,
    *,
    population: PopulationSpec,
    library: RockLibrary,
    site: Site,
    intensity: Intensity,
) -> tuple[Candidates, NDArray[np.int64]]:
    """The rocks of a class whose first place lies in a region, and how many each cell has.

    Returns:
        The rocks; their number in each cell of the region, row by row.
    """
    if size_class.parents is None:
        found = _in_cells(size_class, region, site)
    else:
        found = _in_clusters(size_class, size_class.parents, region, population, site)
    diameter = population.size_frequency.sample(
        words(found.address, SIZE), size_class.smallest, size_class.largest
    )
    if intensity.thins(size_class.population):
        kept = _thinned(size_class, region, found, diameter, intensity)
        found, diameter = found.of(kept), diameter[kept]
    shapes = shapes_of(population.families, library, ("rocks", "populations"))
    shallow, deep = population.buried_fraction
    dynamic = is_dynamic(population, diameter)
    buried = shallow + (deep - shallow) * draw(found.address, BURIED)
    drawn = Candidates(
        id=found.id,
        population=np.full(len(found.id), size_class.population),
        address=found.address,
        xy=found.xy,
        diameter=diameter,
        prototype=shapes[(draw(found.address, PROTOTYPE) * len(shapes)).astype(np.int64)],
        yaw=2.0 * np.pi * draw(found.address, YAW),
        buried=np.where(dynamic, 0.0, buried),
        dynamic=dynamic,
    )
    return drawn, np.bincount(found.cell, minlength=region.columns * region.rows)


def _in_cells(size_class: SizeClass, region: Region, site: Site) -> _Unthinned:
    """Rocks evenly at random in each cell."""
    cells, counts = size_class.cells, region.cut(size_class.counts)
    rows, columns = np.indices(counts.shape).reshape(2, -1).repeat(counts.ravel(), axis=1)
    address = addresses(size_class.key, region.column, region.row, np.ascontiguousarray(counts))
    first_id = size_class.first_id + _before(size_class.counts)
    x = site.west + (region.column + columns + draw(address, EAST)) * cells.side[0]
    y = site.south + (region.row + rows + draw(address, NORTH)) * cells.side[1]
    return _Unthinned(
        id=_numbered(region.cut(first_id), counts),
        address=address,
        xy=np.column_stack([x, y]),
        cell=rows * region.columns + columns,
    )


def _in_clusters(
    size_class: SizeClass,
    parents: Parents,
    region: Region,
    population: PopulationSpec,
    site: Site,
) -> _Unthinned:
    """Rocks about their parents, those of a region's cells."""
    assert isinstance(population.arrangement, Clustered)
    radius, cells = population.arrangement.radius_m, size_class.cells
    west, south, east, north = region.rectangle(cells, site)
    low, high = np.array([west, south]), np.array([east, north])
    reach = TRUNCATION * radius
    near = np.all((parents.xy >= low - reach) & (parents.xy <= high + reach), axis=1)
    close = Parents(xy=parents.xy[near], address=parents.address[near])
    counts = size_class.counts[near]
    address, xy = offspring(close, counts, size_class.key, radius)
    first_id = size_class.first_id + _before(size_class.counts)
    ids = _numbered(first_id[near], counts)
    column, row = (cells.of(xy, site) - (region.column, region.row)).T
    inside = (column >= 0) & (column < region.columns) & (row >= 0) & (row < region.rows)
    inside &= np.all(np.abs(xy) <= (-site.west, -site.south), axis=1)
    found = _Unthinned(ids, address, xy, row * region.columns + column).of(inside)
    return found.of(np.argsort(found.cell, kind="stable"))


def _thinned(
    size_class: SizeClass,
    region: Region,
    found: _Unthinned,
    diameter: Array,
    intensity: Intensity,
) -> NDArray[np.bool_]:
    """Which candidates are kept: a share that is the weight of their place over its bound."""
    kept = weights(intensity, size_class.population, found.xy, diameter)
    bound: Array | float = 1.0
    if size_class.bounds is not None:
        bound = region.cut(size_class.bounds).ravel()[found.cell]
    result: NDArray[np.bool_] = draw(found.address, KEEP) * bound < kept
    return result


def _before(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sum of all counts before each, of the same shape."""
    sums: NDArray[np.int64] = np.cumsum(counts.ravel()).reshape(counts.shape) - counts
    return sums


def _numbered(first: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """`first` and the numbers that follow, as many as `counts` says, one list after the other."""
    shift = first.ravel() - _before(counts).ravel()
    return np.repeat(shift, counts.ravel()) + np.arange(int(counts.sum()))
