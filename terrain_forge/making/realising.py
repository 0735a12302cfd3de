"""Site to World: library, ground, rocks, paths of a window."""

from __future__ import annotations

from functools import partial

from terrain_forge.base import Stopwatch
from terrain_forge.making.horizon import make_horizon
from terrain_forge.making.lighting import light_of
from terrain_forge.model import Route, Site, Window, World, owned, touches
from terrain_forge.paths import make_trajectories
from terrain_forge.rocks import (
    find_library,
    place_rocks,
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
    recipe = site.recipe
    populations, lists = recipe.rocks.populations, recipe.rocks.lists

    progress("rock library", 0.0)
    library = find_library(recipe.rocks.library, custom=site.meshes)
    progress("ground", 0.0)
    margin = rock_margin(site=site, populations=populations, lists=lists, library=library)
    around = site.padded(
        window, max(margin, stencil_reach(site, recipe.terrain.layers, recipe.terrain.materials))
    )
    land = shape_ground(site=site, window=around, layers=recipe.terrain.layers)
    ground = land.cut(
        column=window.column - around.column,
        row=window.row - around.row,
        columns=window.columns,
        rows=window.rows,
    )
    progress("rocks", 0.0)
    scattered = scatter(
        site=site,
        populations=populations,
        lists=lists,
        library=library,
        window=window,
        ground=land,
    )
    rocks = place_rocks(
        scattered,
        site=site,
        library=library,
        ground=land,
        settled=settled,
        progress=partial(progress, "rocks: settling the dynamic ones"),
    )
    own = owned(rocks, ground, site.bounds)
    appearance = paint(site, window, land)
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
