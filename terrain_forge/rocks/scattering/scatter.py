"""Where the rocks lie in plan: their numbers, places and sizes, no two overlapping.

Every population is cut into classes of one octave of diameter. A class has its own cells, which
divide the site evenly. A cell's rocks are drawn by hashing their address (population, octave, cell,
number), and so are the rocks of a cluster (population, octave, parent, number), so that what is
drawn depends neither on the window, on other populations nor on the order. Where an image, a slope
limit or craters say so, rocks are thinned out (`intensity`).

Overlap is solved by moving, never by dropping a rock or redrawing its size: either would bend the
law. The user's own rocks lie already; then larger classes are placed first. Within a class the
cells of each of four checkerboard colours are independent of each other, since a cell is wider than
two rocks; within a cell larger rocks are placed first. Where the site has rocks that would fill a
cell, rocks are placed in wider ones than they were drawn by. A rock that overlaps one that lies
already tries other hashed places within its own cell: anywhere, or ever farther from its first
place if rocks are not to lie everywhere alike. So the place of a rock depends on a bounded
neighbourhood, and a window is computed from itself and a margin.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, NotNegative, Rows, checked, shaped
from terrain_forge.model import Heightfield, RockLibrary, Site, Window
from terrain_forge.rocks.embedding.burial import PATTERN, PITCH
from terrain_forge.rocks.embedding.footprint import FOOTPRINT_DIRECTIONS, footprints
from terrain_forge.rocks.populations import PopulationSpec, RockListSpec
from terrain_forge.rocks.scattering import placement
from terrain_forge.rocks.scattering.candidates import Candidates, draw_class, draw_list, join
from terrain_forge.rocks.scattering.cells import Cells, Rectangle, Region, regions
from terrain_forge.rocks.scattering.corridor import corridors
from terrain_forge.rocks.scattering.intensity import (
    Intensity,
    make_intensity,
    require_place,
    with_slopes,
)
from terrain_forge.rocks.scattering.placement import PENDING, PLACED, UNPLACED, Layout, Rocks
from terrain_forge.rocks.scattering.size_classes import DYNAMIC_SPACE, size_classes


@dataclass(frozen=True, kw_only=True, eq=False)
class Scattered(Rows):
    """Rocks in plan, before there is any ground; one row each, ordered by id."""

    populations: tuple[str, ...]
    """Names of the populations, then of the lists; rocks name them by index."""
    id: NDArray[np.int32] = field(metadata=shaped("rocks", dtype=np.int32))
    """Unique within the site and the same in every window of it, shape [rocks]."""
    population: NDArray[np.int32] = field(metadata=shaped("rocks", dtype=np.int32))
    """Index into `populations`, shape [rocks]."""
    prototype: NDArray[np.int32] = field(metadata=shaped("rocks", dtype=np.int32))
    """Index into the library, shape [rocks]."""
    xy: Array = field(metadata=shaped("rocks", 2))
    """East and north of the centre of mass [m], shape [rocks, 2]."""
    yaw: Array = field(metadata=shaped("rocks"))
    """Turn about the ground's normal [rad], shape [rocks]."""
    buried: Array = field(metadata=shaped("rocks"))
    """Part of the rock's extent that should lie below the ground, 0 to 1, shape [rocks]."""
    diameter: Array = field(metadata=shaped("rocks"))
    """Exposed plan diameter [m], shape [rocks]."""
    dynamic: NDArray[np.bool_] = field(metadata=shaped("rocks", dtype=np.bool_))
    """Which rocks lie unburied, as bodies that can be pushed, shape [rocks]."""
    collides: NDArray[np.bool_] = field(metadata=shaped("rocks", dtype=np.bool_))
    """Which rocks can be touched, shape [rocks]."""
    unplaced: tuple[int, ...]
    """Rocks of each population, of those first put into the window, that found no free place."""


@checked
def scatter(
    *,
    site: Site,
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    window: Window,
    lists: tuple[RockListSpec, ...] = (),
    ground: Heightfield | None = None,
    margin: NotNegative = 0.0,
) -> Scattered:
    """The rocks whose centre lies in a window of the site, and all that could reach into it.

    With a margin [m] also those that come so near to it.

    No two rocks' footprints overlap, but those of listed rocks; a footprint holds all of a rock,
    buried parts too, however it comes to rest (`footprint.footprint`), and of a dynamic rock
    `DYNAMIC_SPACE` times as much. The circle around it (the prototype's `reach` times the diameter)
    stays on the site. A rock that could stand above a corridor's or exclusion zone's clearance is
    left out if it falls into it, and kept off it with all of its circle if it falls beside; no move
    takes a rock across its border. Listed rocks lie where the user has them, there too.

    Args:
        site: The site.
        populations: Who is scattered.
        library: The shapes.
        window: Part of the site.
        lists: The user's own rocks.
        ground: Ground that is known already, for slope limits; what it lacks is shaped.
        margin: How far around the window rocks count too [m].

    Raises:
        RecipeError: if a population is too dense to be placed without overlap, or too numerous, or
            if no place of the whole site is flat enough for it.
        DataError: if a density image holds no densities.
    """
    area, near = _rectangle(site, window), _rectangle(site, site.padded(window, margin))
    drawn, layout, intensity = _draw(site, populations, lists, library, near, ground)
    if intensity.limits_slope and window == site.window:
        require_place(populations, site, intensity)
    rocks = _at_first_places(drawn, layout, library)
    supports = np.zeros((len(library.prototypes), FOOTPRINT_DIRECTIONS))
    for n, support in footprints(library.prototypes, rocks.prototype).items():
        supports[n] = support
    placement.place(
        layout,
        rocks,
        footprints=supports,
        strips=corridors(site),
        intensity=intensity,
    )
    xy, radius = rocks.circle[:, :2], rocks.circle[:, 2]
    lost = (rocks.state == UNPLACED) & (_distance(drawn.xy, area) == 0.0)
    kept = np.flatnonzero((rocks.state == PLACED) & (_distance(xy, near) <= radius))
    kept = kept[np.argsort(drawn.id[kept])]
    smallest = np.array([p.collision_min_m for p in populations] + [0.0] * len(lists))
    names = ("id", "population", "prototype", "yaw", "buried", "diameter", "dynamic")
    columns: dict[str, Any] = {name: getattr(drawn, name)[kept] for name in names}
    return Scattered(
        **columns,
        populations=(*(p.name for p in populations), *(spec.name for spec in lists)),
        xy=xy[kept],
        collides=(drawn.dynamic | (drawn.diameter >= smallest[drawn.population]))[kept],
        unplaced=tuple(np.bincount(drawn.population[lost], minlength=len(smallest)).tolist()),
    )


def reaching(
    found: Scattered, *, site: Site, library: RockLibrary, window: Window
) -> NDArray[np.bool_]:
    """Which of some rocks could reach into a window, as `scatter` has them without a margin."""
    reach = np.array([prototype.reach for prototype in library.prototypes])[found.prototype]
    radius = reach * (np.where(found.dynamic, DYNAMIC_SPACE, 1.0) * found.diameter)
    return np.asarray(_distance(found.xy, _rectangle(site, window)) <= radius)


def rock_margin(
    *,
    site: Site,
    populations: tuple[PopulationSpec, ...],
    library: RockLibrary,
    lists: tuple[RockListSpec, ...] = (),
) -> float:
    """Ground [m] that must be known around a window for its rocks to rest on.

    A rock that reaches into the window has its centre up to its own reach outside, and looks as far
    again for its ground, from each place of the pattern that tells its burial; a dynamic one
    somewhat farther.
    """
    diameters = [0.0]
    for population in populations:
        _, dynamic = population.dynamic_diameters or (0.0, 0.0)
        diameters += [population.diameters[1], DYNAMIC_SPACE * dynamic]
    for spec in lists:
        diameters.append(float(site.table(spec.file).column("diameter_m").max(initial=0.0)))
    reach = max(prototype.reach for prototype in library.prototypes)
    return 2.0 * (reach * max(diameters) + site.spacing) + PITCH * (PATTERN - 1) * max(diameters)


def _draw(
    site: Site,
    populations: tuple[PopulationSpec, ...],
    lists: tuple[RockListSpec, ...],
    library: RockLibrary,
    area: Rectangle,
    ground: Heightfield | None,
) -> tuple[Candidates, Layout, Intensity]:
    """All rocks at their first places, the cells they are placed in, and their weights."""
    intensity = make_intensity(populations, site)
    classes = size_classes(site=site, populations=populations, library=library, intensity=intensity)
    listed = [
        part
        for n, spec in enumerate(lists)
        for part in draw_list(
            spec, index=len(populations) + n, number=n, site=site, library=library
        )
    ]
    cells = [*(cells for _, cells in listed), *(c.cells for c in classes)]
    needed = regions(cells, area, site)
    areas = [area, *(region.rectangle(c, site) for c, region in zip(cells, needed, strict=True))]
    (west, south), (east, north) = np.min(areas, axis=0)[:2], np.max(areas, axis=0)[2:]
    around = float(west), float(south), float(east), float(north)
    intensity = with_slopes(intensity, site=site, area=around, ground=ground)
    parts = [(rocks, np.array([len(rocks.id)])) for rocks, _ in listed] + [
        draw_class(
            size_class,
            region,
            population=populations[size_class.population],
            library=library,
            site=site,
            intensity=intensity,
        )
        for size_class, region in zip(classes, needed[len(listed) :], strict=True)
    ]
    population = [-1] * len(listed) + [c.population for c in classes]
    layout = _layout(site, cells, needed, population, [counts for _, counts in parts])
    return join([rocks for rocks, _ in parts]), layout, intensity


def _at_first_places(drawn: Candidates, layout: Layout, library: RockLibrary) -> Rocks:
    reach, rise = (np.array([getattr(p, n) for p in library.prototypes]) for n in ("reach", "rise"))
    space = np.where(drawn.dynamic, DYNAMIC_SPACE, 1.0) * drawn.diameter
    return Rocks(
        circle=np.column_stack([drawn.xy, reach[drawn.prototype] * space]),
        prototype=drawn.prototype,
        diameter=drawn.diameter,
        space=space,
        yaw=drawn.yaw,
        height=rise[drawn.prototype] * drawn.diameter,
        address=drawn.address,
        state=np.full(len(space), PENDING, dtype=np.int8),
        first_in_bin=np.full(layout.first_bin[-1], -1),
        next_in_bin=np.full(len(space), -1),
    )


def _layout(
    site: Site,
    cells: list[Cells],
    needed: list[Region],
    population: list[int],
    counts: list[NDArray[np.int64]],
) -> Layout:
    """The cells that matter, class by class, with the rocks in each of them."""
    sizes = np.array([0, *map(len, counts)])
    split = np.array([c.split for c in cells], np.int64)
    return Layout(
        bounds=np.array(site.bounds),
        region=np.array(needed, np.int64).reshape(-1, 4),
        side=np.array([c.side for c in cells], np.float64).reshape(-1, 2),
        radius=np.array([c.radius for c in cells], np.float64),
        first_cell=np.cumsum(sizes)[:-1],
        first_rock=np.concatenate([[0], *counts]).astype(np.int64).cumsum(),
        split=split,
        first_bin=np.concatenate([[0], np.cumsum(sizes[1:] * split**2)]),
        population=np.array(population, np.int64),
        local=np.array([c.local for c in cells], np.bool_),
    )


def _rectangle(site: Site, window: Window) -> Rectangle:
    east, north = site.axes(window)
    return float(east[0]), float(north[0]), float(east[-1]), float(north[-1])


def _distance(xy: Array, area: Rectangle) -> Array:
    """Distance [m] of points to a rectangle, 0 within."""
    west, south, east, north = area
    outside_x = np.maximum(np.maximum(west - xy[:, 0], xy[:, 0] - east), 0.0)
    outside_y = np.maximum(np.maximum(south - xy[:, 1], xy[:, 1] - north), 0.0)
    return np.hypot(outside_x, outside_y)
