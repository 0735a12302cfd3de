"""Site to World: library, ground, rocks, paths of a window."""

from __future__ import annotations

from functools import partial

import numpy as np

from terrain_forge.base import Stopwatch
from terrain_forge.model import Lighting, Site, Window, World, owned, touches
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


def make_world(site: Site, window: Window, *, settled: bool, progress: Stopwatch) -> World:
    """The world of a window of a site, as `realise` says."""
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
    progress("paths", 0.0)
    rover = rover_of(site)
    return World(
        site=site,
        window=window,
        ground=ground,
        appearance=paint(site, window, land),
        library=library,
        field=rocks.select(own),
        neighbours=rocks.select(touches(rocks, ground, library) & ~own),
        trajectories=make_trajectories(site, window, ground, rocks, library, rover),
        rover=rover,
        lighting=_light(site),
        unplaced=scattered.unplaced,
    )


def _light(site: Site) -> Lighting:
    sun = site.recipe.sun
    return Lighting(
        sun_azimuth=float(np.radians(sun.azimuth_deg)),
        sun_elevation=float(np.radians(sun.elevation_deg)),
        irradiance=site.body.solar_irradiance,
        sky_rgb=site.body.sky_rgb,
    )
