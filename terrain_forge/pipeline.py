"""The pipeline: plan a Site from a recipe, realise a World of a window of it.

    recipe ─plan─► Site (+ Routes) ─realise(window)─► World: ground ► rock library ► rock field ►
    paths

Writing the World is `build`'s task (terrain_forge/building.py).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.bodies import BODIES
from terrain_forge.dtm.survey import survey
from terrain_forge.inputs import hash_inputs, portable_json, read_images
from terrain_forge.limits import (
    driven_path,
    require_centre,
    require_fits,
    require_lattice,
    require_paths,
)
from terrain_forge.paths.plan import plan_route, require_inside
from terrain_forge.paths.trajectory import lay_trajectory
from terrain_forge.recipe import Recipe, recipe_from_json, recipe_json
from terrain_forge.rocks.library import make_library
from terrain_forge.rocks.populations import PopulationSpec, check_rocks, largest_rock
from terrain_forge.rocks.rest import rest
from terrain_forge.rocks.scatter import scatter
from terrain_forge.rovers.catalogue import find_rover
from terrain_forge.site import Site, Window
from terrain_forge.terrain.appearance import colour_ground, stencil_reach
from terrain_forge.terrain.ground import shape_ground
from terrain_forge.world import Appearance, Lighting, World, owned, touches

Progress = Callable[[str, float], None]
"""Told the name of each stage as it begins, and the share of it that is done, 0 to 1."""


def silent(stage: str, share: float) -> None:
    """Tell nobody."""
    del stage, share


def plan(
    recipe: Recipe, *, folder: Path | str = ".", heights: NDArray[np.float64] | None = None
) -> Site:
    """Resolve a recipe once: read its inputs and fix everything that no window may change.

    Args:
        recipe: what to make.
        folder: what the recipe's paths are relative to.
        heights: the heights [m] of a recipe with `dtm: {kind: array}`, rows running north.

    Raises:
        RecipeError, DataError: before any work starts, if the recipe cannot be built.
    """
    recipe = recipe_from_json(recipe_json(recipe))  # whoever made it, it is checked here
    body, rover = BODIES[recipe.body], find_rover(recipe.rover)
    area = recipe.dtm.size_m[0] * recipe.dtm.size_m[1]
    require_paths(recipe)
    require_centre(recipe)
    require_lattice(recipe)
    check_rocks(recipe.rocks, area)
    require_fits(recipe)
    driven = driven_path(recipe)
    routes = tuple(
        plan_route(path, rover=rover, driven=path.name == driven) for path in recipe.paths
    )
    for route in routes:
        require_inside(route, size=recipe.dtm.size_m, rover=rover)
    ground = survey(recipe.dtm, body=body, folder=Path(folder), heights=heights)
    return Site(
        name=recipe.name,
        seed=recipe.seed,
        body=body,
        size=recipe.dtm.size_m,
        spacing=recipe.terrain.spacing_m,
        crs=ground.crs,
        lonlat=ground.lonlat,
        datum_height=ground.datum_height,
        slope=ground.slope,
        dtm=ground.dtm,
        roughness=ground.roughness,
        largest_rock=largest_rock(recipe.rocks, area),
        images=read_images(recipe, Path(folder)),
        inputs=hash_inputs(recipe, Path(folder)),
        routes=routes,
        recipe_json=portable_json(recipe),
    )


def realise(site: Site, window: Window | None = None, *, progress: Progress = silent) -> World:
    """Make the world of a window of a site; without a window, of the whole site.

    A window's ground, rocks and rasters equal the same cut of any larger window, bit for bit.
    Paths are laid where they lie wholly within the window.
    """
    recipe, window = site.recipe, window or site.window
    populations = recipe.rocks.populations
    reach = max(2.0 * site.largest_rock + 2.0 * site.spacing, stencil_reach(site))
    margin = site.padded(window, reach)

    progress("ground", 0.0)
    land = shape_ground(site=site, window=margin, layers=recipe.terrain.layers)
    colours = colour_ground(site=site, window=window, ground=land, spec=recipe.terrain.appearance)
    progress("rock library", 0.0)
    library = make_library(recipe.rocks.library)
    progress("rocks", 0.0)
    scattered = scatter(site=site, populations=populations, library=library, window=window)
    density = np.array([p.density_kg_m3 or site.body.rock_density for p in populations])
    everyone = rest(scattered=scattered, library=library, ground=land, density=density)
    progress("paths", 0.0)
    column, row = window.column - margin.column, window.row - margin.row
    ground = land.cut(column=column, row=row, columns=window.columns, rows=window.rows)
    rover = find_rover(recipe.rover)
    inside = [r for r in site.routes if ground.holds(r.position, margin=rover.length)]
    specs = {path.name: path for path in recipe.paths}
    own = owned(everyone, ground, site.bounds)
    near = touches(everyone, ground, library) & ~own
    return World(
        site=site,
        window=window,
        ground=ground,
        appearance=Appearance(
            ground_rgb=colours,
            rock_rgb=_rock_colours(site, populations),
        ),
        library=library,
        field=everyone.select(own),
        neighbours=everyone.select(near),
        trajectories=tuple(
            lay_trajectory(r, spec=specs[r.name], ground=ground, rover=rover, seed=site.seed)
            for r in inside
        ),
        rover=rover,
        lighting=Lighting(
            sun_azimuth=float(np.radians(recipe.sun.azimuth_deg)),
            sun_elevation=float(np.radians(recipe.sun.elevation_deg)),
            irradiance=site.body.solar_irradiance,
            sky_rgb=site.body.sky_rgb,
        ),
        unplaced=scattered.unplaced,
    )


def _rock_colours(site: Site, populations: tuple[PopulationSpec, ...]) -> NDArray[np.uint8]:
    colours = [population.rgb or site.body.rock_rgb for population in populations]
    return np.round(255.0 * np.reshape(colours, (-1, 3))).astype(np.uint8)
