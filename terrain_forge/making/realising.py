"""Site to World: library, ground, rocks, paths of a window."""

from __future__ import annotations

from functools import partial

import numpy as np

from terrain_forge.base import Stopwatch
from terrain_forge.making.horizon import make_horizon
from terrain_forge.making.lighting import light_of
from terrain_forge.model import (
    Heightfield,
    RockLibrary,
    Route,
    Site,
    Window,
    World,
    owned,
    touches,
)
from terrain_forge.paths import make_trajectories
from terrain_forge.rocks import (
    FILLED,
    Banked,
    Scattered,
    bank_reach,
    bank_soil,
    drifted_soil,
    find_library,
    place_rocks,
    reaching,
    rock_margin,
    scatter,
)
from terrain_forge.rovers import rover_of
from terrain_forge.terrain import (
    paint,
    shape_ground,
    stencil_reach,
)


def make_world(
    site: Site,
    window: Window,
    *,
    settled: bool,
    progress: Stopwatch,
    horizon: bool = True,
    planned: tuple[Route, ...] = (),
) -> World:
    """The world of a window of a site, as `realise` says; on demand without what lies beyond.

    Routes of planned paths are given where they were found on all of the site.
    """
    progress("rock library", 0.0)
    library = find_library(site.recipe.rocks.library, custom=site.meshes)
    progress("ground", 0.0)
    around, margin = _around(site, window, library)
    bare = shape_ground(site=site, window=around, layers=site.recipe.terrain.layers)
    progress("rocks", 0.0)
    scattered, banked = _lay_soil(site, window, library, bare, margin)
    land = banked.ground if banked else bare
    row, column = window.row - around.row, window.column - around.column
    ground = land.cut(column=column, row=row, columns=window.columns, rows=window.rows)
    rocks = place_rocks(
        scattered.select(reaching(scattered, site=site, library=library, window=window)),
        site=site,
        library=library,
        ground=land,
        bare=bare,
        settled=settled,
        progress=partial(progress, "rocks: settling the dynamic ones"),
    )
    own = owned(rocks, ground, site.bounds)
    laid = None
    if banked:
        own_nodes = np.s_[row : row + window.rows + 1, column : column + window.columns + 1]
        laid = banked.raised[own_nodes], drifted_soil(site)
    appearance = paint(site, window, bare, laid=laid)
    progress("paths", 0.0)
    rover = rover_of(site)
    return World(
        site=site,
        window=window,
        ground=ground,
        appearance=appearance,
        library=library,
        field=rocks.select(own),
        neighbours=rocks.select(touches(rocks, ground, library) & ~own),
        trajectories=make_trajectories(site, window, ground, rocks, library, rover, planned),
        rover=rover,
        lighting=light_of(site),
        unplaced=scattered.unplaced,
        horizon=make_horizon(site, ground, appearance, library) if horizon else None,
    )


def make_ground(site: Site, window: Window) -> Heightfield:
    """The ground of a window of a site, with the soil at its rocks."""
    library = find_library(site.recipe.rocks.library, custom=site.meshes)
    around, margin = _around(site, window, library)
    bare = shape_ground(site=site, window=around, layers=site.recipe.terrain.layers)
    _, banked = _lay_soil(site, window, library, bare, margin)
    return (banked.ground if banked else bare).cut(
        column=window.column - around.column,
        row=window.row - around.row,
        columns=window.columns,
        rows=window.rows,
    )


def _around(site: Site, window: Window, library: RockLibrary) -> tuple[Window, float]:
    """The window with what its ground and rocks hang on, and how far rocks reach for ground [m]."""
    recipe, rocks = site.recipe, site.recipe.rocks
    margin = rock_margin(
        site=site, populations=rocks.populations, lists=rocks.lists, library=library
    )
    known = margin + (FILLED * site.spacing if bank_reach(site, library) else 0.0)
    stencil = stencil_reach(site, recipe.terrain.layers, recipe.terrain.materials)
    return site.padded(window, max(known, stencil)), margin


def _lay_soil(
    site: Site, window: Window, library: RockLibrary, bare: Heightfield, margin: float
) -> tuple[Scattered, Banked | None]:
    """The rocks in plan, and the ground with the soil that lies at them."""
    rocks, reach = site.recipe.rocks, bank_reach(site, library)
    scattered = scatter(
        site=site,
        populations=rocks.populations,
        lists=rocks.lists,
        library=library,
        window=window,
        ground=bare,
        margin=margin + reach if reach else 0.0,
    )
    return scattered, bank_soil(site=site, scattered=scattered, library=library, ground=bare)
