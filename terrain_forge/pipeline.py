"""The pipeline: plan a Site from a recipe, realise a World of a window of it.

    recipe ─plan─► Site (+ Routes) ─realise(window)─► World: library ► ground ► rocks ► paths

Writing the World is `build`'s task (terrain_forge/building.py).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.bodies import BODIES
from terrain_forge.dtm.lattice import require_straight
from terrain_forge.dtm.survey import survey
from terrain_forge.inputs import (
    hash_inputs,
    hash_rover,
    portable_json,
    portable_names,
    read_images,
    read_layer_tables,
    read_meshes,
    read_tables,
    resolve_laws,
)
from terrain_forge.limits import (
    driven_path,
    require_centre,
    require_fits,
    require_lattice,
    require_paths,
    require_samples,
)
from terrain_forge.motion import Trajectory
from terrain_forge.paths.plan import overhang, plan_route, require_inside
from terrain_forge.paths.planner import plan_path
from terrain_forge.paths.recorded import read_recorded
from terrain_forge.paths.route import Route
from terrain_forge.paths.spec import Planned, Recorded
from terrain_forge.paths.surroundings import require_free_start
from terrain_forge.paths.trajectory import lay_trajectory
from terrain_forge.paths.traversability import traversability
from terrain_forge.recipe import Recipe, recipe_from_json, recipe_json
from terrain_forge.rocks.feasibility import check_rocks, largest_rock
from terrain_forge.rocks.rest import rest
from terrain_forge.rocks.resting.loose_limits import require_loose
from terrain_forge.rocks.scatter import Scattered, scatter
from terrain_forge.rocks.scatter import margin as rock_margin
from terrain_forge.rocks.scattering.clearings import clearings
from terrain_forge.rocks.scattering.intensity import require_place
from terrain_forge.rocks.scattering.layer_craters import with_layer_craters
from terrain_forge.rocks.settle import settle
from terrain_forge.rocks.shapes.cache import find_library
from terrain_forge.rovers.catalogue import require_ground, resolve_rover, rover_of
from terrain_forge.rovers.description import Rover
from terrain_forge.site import Site, Window
from terrain_forge.terrain.appearance import check_appearance, colour_ground, stencil_reach
from terrain_forge.terrain.detail import ground_detail
from terrain_forge.terrain.ground import shape_ground
from terrain_forge.terrain.layer import check_layers
from terrain_forge.terrain.orthoimage import read_orthoimage
from terrain_forge.world import (
    Appearance,
    Heightfield,
    Lighting,
    RockField,
    RockLibrary,
    World,
    owned,
    touches,
)

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
    folder = Path(folder)
    recipe = recipe_from_json(recipe_json(recipe))  # whoever made it, it is checked here
    body, found = BODIES[recipe.body], resolve_rover(recipe.rover, folder)
    rover = found.rover
    area = recipe.dtm.size_m[0] * recipe.dtm.size_m[1]
    require_paths(recipe)
    require_centre(recipe)
    require_lattice(recipe)
    given, recipe = recipe, resolve_laws(recipe, folder)
    check_rocks(recipe.rocks, recipe.dtm.size_m)
    require_loose(recipe)
    tables = read_tables(recipe, folder)
    require_fits(recipe, listed=sum(len(table.values) for table in tables))
    routes = _plan_routes(recipe, rover, folder)
    ground = survey(recipe.dtm, body=body, folder=folder, heights=heights)
    site = Site(
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
        largest_rock=largest_rock(recipe.rocks, area, tables),
        images=read_images(recipe, folder),
        tables=(*tables, *read_layer_tables(recipe, folder)),
        meshes=read_meshes(recipe, folder),
        inputs=(*hash_inputs(given, folder, patch=ground.dtm), *hash_rover(found.files, recipe)),
        brought_rover=rover if found.files else None,
        routes=routes,
        clearings=clearings(recipe.rocks.keep_out, routes=routes, rover=rover),
        recipe_json=portable_json(recipe),
    )
    require_straight(site)
    check_layers(site.recipe.terrain.layers, site)
    check_appearance(recipe.terrain.appearance, site)
    site = with_layer_craters(_with_orthoimage(site, recipe, folder))
    require_place(site.recipe.rocks.populations, site)
    return site


def _with_orthoimage(site: Site, recipe: Recipe, folder: Path) -> Site:
    spec = recipe.terrain.appearance.orthoimage
    if spec is None:
        return site
    name = portable_names(recipe)[spec.image]
    return site.replace(orthoimage=read_orthoimage(spec, name=name, site=site, folder=folder))


def _plan_routes(recipe: Recipe, rover: Rover, folder: Path) -> tuple[Route, ...]:
    """The routes that are known before the ground."""
    driven = driven_path(recipe)
    if driven is not None or not isinstance(recipe.rover, str):
        require_ground(rover, spacing=recipe.terrain.spacing_m)
    return tuple(
        _plan_path(recipe, number, rover, folder, driven=path.name == driven)
        for number, path in enumerate(recipe.paths)
        if not isinstance(path.route, Planned)
    )


def _plan_path(recipe: Recipe, number: int, rover: Rover, folder: Path, *, driven: bool) -> Route:
    path, key = recipe.paths[number], ("paths", number)
    recorded = None
    if isinstance(path.route, Recorded):
        recorded = read_recorded(path.route, folder, key=(*key, "route", "file"))
    route = plan_route(path, rover=rover, driven=driven, recorded=recorded, key=key)
    require_inside(route, size=recipe.dtm.size_m, rover=rover, key=key)
    require_samples(route, rate=path.rate_hz, key=key)
    return route


def realise(site: Site, window: Window | None = None, *, progress: Progress = silent) -> World:
    """Make the world of a window of a site; without a window, of the whole site.

    A window's ground, rocks and rasters equal the same cut of any larger window, bit for bit.
    Paths are laid where they lie wholly within the window; planned ones, which depend on all of the
    ground and its rocks, only in the world of the whole site.

    Raises:
        RecipeError: if a planned path cannot be found, or the driven one starts within a rock.
    """
    recipe, window = site.recipe, window or site.window
    populations, lists = recipe.rocks.populations, recipe.rocks.lists

    progress("rock library", 0.0)
    library = find_library(recipe.rocks.library, brought=site.meshes)
    progress("ground", 0.0)
    margin = rock_margin(site=site, populations=populations, lists=lists, library=library)
    around = site.padded(window, max(margin, stencil_reach(site, recipe.terrain.layers)))
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
    rocks = _lay_rocks(site, scattered, library, land, progress)
    own = owned(rocks, ground, site.bounds)
    progress("paths", 0.0)
    rover = rover_of(site)
    return World(
        site=site,
        window=window,
        ground=ground,
        appearance=_paint(site, window, land),
        library=library,
        field=rocks.select(own),
        neighbours=rocks.select(touches(rocks, ground, library) & ~own),
        trajectories=_lay_trajectories(site, window, ground, rocks, library, rover),
        rover=rover,
        lighting=_light(site),
        unplaced=scattered.unplaced,
    )


def _lay_rocks(
    site: Site,
    scattered: Scattered,
    library: RockLibrary,
    land: Heightfield,
    progress: Progress,
) -> RockField:
    groups = site.recipe.rocks.groups
    density = np.array([group.density_kg_m3 or site.body.rock_density for group in groups])
    laid = rest(scattered=scattered, library=library, ground=land, density=density)
    return settle(
        rocks=laid,
        library=library,
        ground=land,
        gravity=site.body.gravity,
        progress=lambda share: progress("loose rocks", share),
    )


def _paint(site: Site, window: Window, land: Heightfield) -> Appearance:
    terrain, rocks = site.recipe.terrain, site.recipe.rocks
    spec = terrain.appearance
    colours = [group.rgb or site.body.rock_rgb for group in rocks.groups]
    return Appearance(
        ground_rgb=colour_ground(
            site=site, window=window, ground=land, spec=spec, layers=terrain.layers
        ),
        rock_rgb=np.round(255.0 * np.reshape(colours, (-1, 3))).astype(np.uint8),
        detail=ground_detail(spec.detail, site),
    )


def _lay_trajectories(
    site: Site,
    window: Window,
    ground: Heightfield,
    rocks: RockField,
    library: RockLibrary,
    rover: Rover,
) -> tuple[Trajectory, ...]:
    routes = {route.name: route for route in site.routes}
    if window == site.window:
        routes |= _plan_on_ground(site, ground, rocks, library, rover)
    driven, laid = driven_path(site.recipe), []
    for number, spec in enumerate(site.recipe.paths):
        route = routes.get(spec.name)
        if route is None or overhang(route, bounds=ground.bounds, rover=rover)[0] > 0.0:
            continue
        path = lay_trajectory(route, spec=spec, ground=ground, rover=rover, seed=site.seed)
        if spec.name == driven:
            key = ("paths", number)
            require_free_start(path, rocks=rocks, library=library, rover=rover, key=key)
        laid.append(path)
    return tuple(laid)


def _plan_on_ground(
    site: Site, ground: Heightfield, rocks: RockField, library: RockLibrary, rover: Rover
) -> dict[str, Route]:
    """The planned routes, by name, over the whole site."""
    wanted = [
        (("paths", number), spec, spec.route)
        for number, spec in enumerate(site.recipe.paths)
        if isinstance(spec.route, Planned)
    ]
    if not wanted:
        return {}
    field = traversability(ground=ground, rocks=rocks, library=library, rover=rover)
    routes = {}
    for key, spec, planned in wanted:
        route = plan_path(spec, planned, field=field, rover=rover, key=key)
        require_inside(route, size=site.size, rover=rover, key=key)
        require_samples(route, rate=spec.rate_hz, key=key)
        routes[route.name] = route
    return routes


def _light(site: Site) -> Lighting:
    sun = site.recipe.sun
    return Lighting(
        sun_azimuth=float(np.radians(sun.azimuth_deg)),
        sun_elevation=float(np.radians(sun.elevation_deg)),
        irradiance=site.body.solar_irradiance,
        sky_rgb=site.body.sky_rgb,
    )
