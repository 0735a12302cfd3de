"""Where the rocks lie in plan: Poisson numbers, sizes drawn from their law, no two overlapping.

Every population is cut into classes of one octave of diameter. A class has its own cells, which
divide the site evenly; a cell's rocks are drawn by hashing their address (population, octave, cell,
number), so what is drawn depends neither on the window, on other populations nor on the order.

Overlap is solved by moving, never by dropping a rock or redrawing its size: either would bend the
law. Larger classes are placed first; within a class the cells of each of four checkerboard colours
are independent of each other, since a cell is wider than two rocks. A rock that overlaps one that
lies already tries other hashed places within its own cell. So the place of a rock depends on a
bounded neighbourhood, and a window is computed from itself and a margin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.records import Record
from terrain_forge.rocks import placement
from terrain_forge.rocks.corridor import corridors
from terrain_forge.rocks.outline import footprint
from terrain_forge.rocks.placement import (
    BURIED,
    EAST,
    NORTH,
    PENDING,
    PLACED,
    PROTOTYPE,
    SIZE,
    UNPLACED,
    YAW,
    Layout,
    Rocks,
    draw,
    words,
)
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.rocks.size_classes import Rectangle, Region, SizeClass, regions, size_classes
from terrain_forge.site import Site, Window
from terrain_forge.world import RockLibrary

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Scattered(Record):
    """Rocks in plan, before there is any ground; one row each, ordered by id."""

    populations: tuple[str, ...]
    """Names of the populations; rocks name them by index."""
    id: NDArray[np.int32]
    """Unique within the site and the same in every window of it, shape [rocks]."""
    population: NDArray[np.int32]
    """Index into `populations`, shape [rocks]."""
    prototype: NDArray[np.int32]
    """Index into the library, shape [rocks]."""
    xy: Array
    """East and north of the centre of mass [m], shape [rocks, 2]."""
    yaw: Array
    """Turn about the ground's normal [rad], shape [rocks]."""
    buried: Array
    """Part of the rock's extent that should lie below the ground, 0 to 1, shape [rocks]."""
    diameter: Array
    """Exposed plan diameter [m], shape [rocks]."""
    loose: NDArray[np.bool_]
    """Which rocks lie unburied, as bodies that can be pushed, shape [rocks]."""
    solid: NDArray[np.bool_]
    """Which rocks can be touched, shape [rocks]."""
    unplaced: tuple[int, ...]
    """Rocks of each population, of those first put into the window, that found no free place."""

    def __post_init__(self) -> None:
        for name in ("id", "population", "prototype"):
            self.freeze(name, np.int32, ("rocks",))
        self.freeze("xy", np.float64, ("rocks", 2))
        for name in ("yaw", "buried", "diameter"):
            self.freeze(name, np.float64, ("rocks",))
        for name in ("loose", "solid"):
            self.freeze(name, np.bool_, ("rocks",))

    def __len__(self) -> int:
        return len(self.id)


def scatter(
    *,
    site: Site,
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    window: Window,
) -> Scattered:
    """The rocks whose centre lies in a window of the site, and all that could reach into it.

    No two rocks' footprints overlap; a footprint holds all of a rock, buried parts too, however it
    comes to rest (`outline.footprint`). The circle around it (the prototype's `reach` times the
    diameter) stays on the site. A rock that could stand above a corridor's clearance is left out if
    it falls into the corridor, and kept off it with all of its circle if it falls beside; no move
    takes a rock across a corridor's border.

    Raises:
        RecipeError: if a population is too dense to be placed without overlap, or too numerous.
    """
    classes = size_classes(site=site, populations=populations, library=library)
    east, north = site.axes(window)
    area = float(east[0]), float(north[0]), float(east[-1]), float(north[-1])
    needed = regions(classes, area, site)
    drawn = _draw(classes, needed, populations, library, site)
    reach, rise = (np.array([getattr(p, n) for p in library.prototypes]) for n in ("reach", "rise"))
    radius = reach[drawn.prototype] * drawn.diameter
    layout = _layout(classes, needed, site)
    rocks = Rocks(
        circle=np.column_stack([drawn.xy, radius]),
        prototype=drawn.prototype,
        diameter=drawn.diameter,
        yaw=drawn.yaw,
        height=rise[drawn.prototype] * drawn.diameter,
        address=drawn.address,
        state=np.full(len(radius), PENDING, dtype=np.int8),
        first_in_bin=np.full(layout.first_bin[-1], -1),
        next_in_bin=np.full(len(radius), -1),
    )
    footprints = np.array([footprint(prototype.meshes[0]) for prototype in library.prototypes])
    placement.place(layout, rocks, footprints, corridors(site.routes))
    xy = rocks.circle[:, :2]
    lost = (rocks.state == UNPLACED) & (_distance(drawn.xy, area) == 0.0)
    kept = np.flatnonzero((rocks.state == PLACED) & (_distance(xy, area) <= radius))
    kept = kept[np.argsort(drawn.id[kept])]
    return Scattered(
        populations=tuple(p.name for p in populations),
        id=drawn.id[kept].astype(np.int32),
        population=drawn.population[kept].astype(np.int32),
        prototype=drawn.prototype[kept].astype(np.int32),
        xy=xy[kept],
        yaw=drawn.yaw[kept],
        buried=drawn.buried[kept],
        diameter=drawn.diameter[kept],
        loose=np.zeros(len(kept), np.bool_),
        solid=np.ones(len(kept), np.bool_),
        unplaced=tuple(
            int(np.count_nonzero(lost & (drawn.population == n))) for n in range(len(populations))
        ),
    )


def margin(*, site: Site, populations: tuple[PopulationSpec, ...], library: RockLibrary) -> float:
    """Ground [m] that must be known around a window for its rocks to rest on.

    A rock that reaches into the window has its centre up to its own reach outside, and looks as far
    again for its ground.
    """
    area = site.size[0] * site.size[1]
    largest = max((p.diameter_range(area)[1] for p in populations), default=0.0)
    reach = max(prototype.reach for prototype in library.prototypes)
    return 2.0 * (reach * largest + site.spacing)


class _Drawn(NamedTuple):
    """What chance gives the rocks, ordered by class, cell and number."""

    id: NDArray[np.int64]
    population: NDArray[np.int64]
    address: NDArray[np.uint64]
    xy: Array
    diameter: Array
    prototype: NDArray[np.int64]
    yaw: Array
    buried: Array


def _draw(
    classes: list[SizeClass],
    needed: list[Region],
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    site: Site,
) -> _Drawn:
    shapes = len(library.prototypes)
    parts = [
        _draw_class(size_class, region, populations[size_class.population], shapes, site)
        for size_class, region in zip(classes, needed, strict=True)
    ]
    if not parts:
        real, whole, address = np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.uint64)
        return _Drawn(whole, whole, address, np.zeros((0, 2)), real, whole, real, real)
    return _Drawn(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def _draw_class(
    size_class: SizeClass, region: Region, population: PopulationSpec, shapes: int, site: Site
) -> _Drawn:
    counts = region.cut(size_class.counts)
    rows, columns = np.indices(counts.shape).reshape(2, -1).repeat(counts.ravel(), axis=1)
    address = placement.addresses(size_class.key, region.column, region.row, counts)
    number = np.arange(len(address)) - np.repeat(np.cumsum(counts) - counts.ravel(), counts.ravel())
    x = site.west + (region.column + columns + draw(address, EAST)) * size_class.side[0]
    y = site.south + (region.row + rows + draw(address, NORTH)) * size_class.side[1]
    shallow, deep = population.buried_fraction
    return _Drawn(
        id=np.repeat(region.cut(size_class.first_id), counts.ravel()) + number,
        population=np.full(len(address), size_class.population),
        address=address,
        xy=np.column_stack([x, y]),
        diameter=population.size_frequency.sample(
            words(address, SIZE), size_class.smallest, size_class.largest
        ),
        prototype=(draw(address, PROTOTYPE) * shapes).astype(np.int64),
        yaw=2.0 * np.pi * draw(address, YAW),
        buried=shallow + (deep - shallow) * draw(address, BURIED),
    )


def _layout(classes: list[SizeClass], needed: list[Region], site: Site) -> Layout:
    counts = [r.cut(c.counts).ravel() for c, r in zip(classes, needed, strict=True)]
    cells = np.array([0, *map(len, counts)])
    split = np.array([c.split for c in classes], dtype=np.int64)
    return Layout(
        bounds=np.array([site.west, site.south, -site.west, -site.south]),
        region=np.array([(r.column, r.row, r.columns, r.rows) for r in needed], np.int64).reshape(
            -1, 4
        ),
        side=np.array([c.side for c in classes], np.float64).reshape(-1, 2),
        radius=np.array([c.radius for c in classes], np.float64),
        first_cell=np.cumsum(cells)[:-1],
        first_rock=np.concatenate([[0], *counts]).astype(np.int64).cumsum(),
        split=split,
        first_bin=np.concatenate([[0], np.cumsum(cells[1:] * split**2)]),
    )


def _distance(xy: Array, area: Rectangle) -> Array:
    """Distance [m] of points to a rectangle, 0 within."""
    west, south, east, north = area
    outside_x = np.maximum(np.maximum(west - xy[:, 0], xy[:, 0] - east), 0.0)
    outside_y = np.maximum(np.maximum(south - xy[:, 1], xy[:, 1] - north), 0.0)
    return np.hypot(outside_x, outside_y)
