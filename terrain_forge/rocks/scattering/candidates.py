"""Rocks at their first places: what chance gives them, by address, and what the user lists.

Listed rocks are placed as they are listed, before all others, and never moved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable, stage_key, uniforms_at
from terrain_forge.model import RockLibrary, Site, Table
from terrain_forge.rocks.arrangement import Clustered
from terrain_forge.rocks.populations import MAX_ROCKS, PopulationSpec, RockListSpec
from terrain_forge.rocks.scattering.cells import (
    BURIED,
    EAST,
    KEEP,
    NORTH,
    PROTOTYPE,
    SIZE,
    YAW,
    Cells,
    Region,
    addresses,
    words,
)
from terrain_forge.rocks.scattering.clusters import TRUNCATION, Parents, offspring
from terrain_forge.rocks.scattering.intensity import Intensity, weights
from terrain_forge.rocks.scattering.size_classes import SizeClass, is_dynamic, shapes_of


class Candidates(NamedTuple):
    """Rocks at their first places, ordered by class, cell and id: columns as of `Scattered`."""

    id: NDArray[np.int64]
    population: NDArray[np.int64]
    address: NDArray[np.uint64]
    """Hashed address, shape [rocks]."""
    xy: Array
    diameter: Array
    prototype: NDArray[np.int64]
    yaw: Array
    buried: Array
    dynamic: NDArray[np.bool_]


def join(parts: list[Candidates]) -> Candidates:
    """One after the other."""
    if parts:
        return Candidates(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    real, whole = np.zeros(0), np.zeros(0, np.int64)
    address, dynamic = np.zeros(0, np.uint64), np.zeros(0, np.bool_)
    return Candidates(whole, whole, address, np.zeros((0, 2)), real, whole, real, real, dynamic)


_Unthinned = tuple[NDArray[np.int64], NDArray[np.uint64], Array, NDArray[np.int64]]
"""Id, address, place [m] and cell within the region, counted row by row, of rocks of a class before
thinning, ordered by cell and id."""


def draw_class(
    size_class: SizeClass,
    region: Region,
    *,
    population: PopulationSpec,
    library: RockLibrary,
    site: Site,
    intensity: Intensity,
) -> tuple[Candidates, NDArray[np.int64]]:
    """The rocks of a class whose first place lies in a region; their number in each cell of it."""
    cells, drawing = size_class.cells, size_class.drawing
    drawn_in = region
    if size_class.parents is None:
        if drawing is not cells:
            drawn_in = drawing.covering(region.rectangle(cells, site), site)
        ids, address, xy, cell = _in_cells(size_class, drawn_in, site)
    else:
        ids, address, xy, cell = _in_clusters(
            size_class, size_class.parents, region, population, site
        )
    diameter = population.size_frequency.sample(
        words(address, SIZE), size_class.smallest, size_class.largest
    )
    if intensity.thins(size_class.population):
        # A share is kept that is the weight of the place over its bound.
        bound: Array | float = 1.0
        if size_class.bounds is not None:
            bound = drawn_in.cut(size_class.bounds).ravel()[cell]
        likely = weights(intensity, size_class.population, xy, diameter)
        kept = uniforms_at(address, KEEP) * bound < likely
        ids, address, xy, cell = ids[kept], address[kept], xy[kept], cell[kept]
        diameter = diameter[kept]
    if size_class.parents is None and drawing is not cells:
        kept, cell = cells.home(xy, region, site)
        ids, address, xy, diameter = ids[kept], address[kept], xy[kept], diameter[kept]
    shapes = shapes_of(population.families, library, ("rocks", "populations"))
    shallow, deep = population.buried_fraction
    dynamic = is_dynamic(population, diameter)
    buried = shallow + (deep - shallow) * uniforms_at(address, BURIED)
    drawn = Candidates(
        id=ids,
        population=np.full(len(ids), size_class.population),
        address=address,
        xy=xy,
        diameter=diameter,
        prototype=shapes[(uniforms_at(address, PROTOTYPE) * len(shapes)).astype(np.int64)],
        yaw=2.0 * np.pi * uniforms_at(address, YAW),
        buried=np.where(dynamic, 0.0, buried),
        dynamic=dynamic,
    )
    return drawn, np.bincount(cell, minlength=region.columns * region.rows)


def _in_cells(size_class: SizeClass, region: Region, site: Site) -> _Unthinned:
    """Rocks evenly at random in each cell of a region of those to draw by."""
    cells, counts = size_class.drawing, size_class.counts_of(region)
    rows, columns = np.indices(counts.shape).reshape(2, -1).repeat(counts.ravel(), axis=1)
    address = addresses(size_class.key, region.column, region.row, np.ascontiguousarray(counts))
    x = site.west + (region.column + columns + uniforms_at(address, EAST)) * cells.side[0]
    y = site.south + (region.row + rows + uniforms_at(address, NORTH)) * cells.side[1]
    ids = _numbered(size_class.ids_of(region), counts)
    return ids, address, np.column_stack([x, y]), rows * region.columns + columns


def _in_clusters(
    size_class: SizeClass,
    parents: Parents,
    region: Region,
    population: PopulationSpec,
    site: Site,
) -> _Unthinned:
    """Rocks about their parents, those of a region's cells."""
    assert isinstance(population.arrangement, Clustered)
    assert size_class.counts is not None
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
    kept, cell = cells.home(xy, region, site)
    return ids[kept], address[kept], xy[kept], cell


def _before(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sum of all counts before each, of the same shape."""
    return np.cumsum(counts.ravel()).reshape(counts.shape) - counts


def _numbered(first: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """`first` and the numbers that follow, as many as `counts` says, one list after the other."""
    shift = first.ravel() - _before(counts).ravel()
    return np.repeat(shift, counts.ravel()) + np.arange(int(counts.sum()))


def draw_list(
    spec: RockListSpec, *, index: int, number: int, site: Site, library: RockLibrary
) -> list[tuple[Candidates, Cells]]:
    """The rocks of a list; what its table does not give is drawn as for other rocks.

    They come in octaves of diameter, each with one cell, so that near ones are found fast.
    `index` is the list's among all populations, of which lists come last, `number` its own.
    """
    table = site.table(spec.file)
    count = len(table.values)
    key = stage_key(site.seed, f"rocks/{spec.name}")
    address = addresses(key, 0, 0, np.array([[count]]))
    shapes = shapes_of(spec.families, library, ("rocks", "lists", number))
    prototype = _column(table, "prototype")
    if prototype is None:
        prototype = shapes[(uniforms_at(address, PROTOTYPE) * len(shapes)).astype(np.int64)]
    yaw, buried = _column(table, "yaw_deg"), _column(table, "buried_fraction")
    shallow, deep = spec.buried_fraction
    drawn = Candidates(
        id=_first_of_list(site, number, index) + np.arange(count),
        population=np.full(count, index),
        address=address,
        xy=np.column_stack([table.column("x_m"), table.column("y_m")]),
        diameter=table.column("diameter_m"),
        prototype=prototype.astype(np.int64),
        yaw=2.0 * np.pi * uniforms_at(address, YAW) if yaw is None else np.radians(yaw),
        buried=shallow + (deep - shallow) * uniforms_at(address, BURIED)
        if buried is None
        else buried,
        dynamic=np.zeros(count, np.bool_),
    )
    octave = np.floor(portable.log2(drawn.diameter / drawn.diameter.min(initial=np.inf)))
    reach = np.array([prototype.reach for prototype in library.prototypes])
    found = []
    for n in np.unique(octave)[::-1]:
        part = Candidates(*(column[octave == n] for column in drawn))
        radius = float((reach[part.prototype] * part.diameter).max())
        bins = min(len(part.id) ** 0.5, min(site.size) / (2.0 * radius))
        split = max(int(bins), 1)
        found.append((part, Cells(radius=radius, columns=1, rows=1, side=site.size, split=split)))
    return found


def _first_of_list(site: Site, number: int, index: int) -> int:
    """Id of a list's first rock: lists come last, or first where rocks are numbered by cells."""
    rocks = site.recipe.rocks
    if not any(population.is_many(site.size) for population in rocks.populations):
        return index * MAX_ROCKS
    return sum(len(site.table(spec.file).values) for spec in rocks.lists[:number])


def _column(table: Table, name: str) -> Array | None:
    """A table's column, or None where it has none of that name."""
    return table.column(name) if name in table.columns else None
