"""Recipe to Site: inputs are read, and what no window may change is fixed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Progress, checked, reading, silent, warn_user
from terrain_forge.dtm import RasterDtm, at_hand, expanded, require_straight, survey
from terrain_forge.making.lighting import light_of
from terrain_forge.model import BODIES, Body, Route, Rover, Site, Table
from terrain_forge.paths import plan_routes
from terrain_forge.recipe import (
    InputFiles,
    Recipe,
    RecipeFile,
    given_recipe,
    in_tiles,
    recipe_json,
    require_centre,
    require_lattice,
    require_on_body,
    require_paths,
    resolve,
)
from terrain_forge.rocks import (
    check_contact,
    check_lists,
    check_packing,
    check_rocks,
    exclusion_zones,
    find_library,
    largest_rock,
    require_dynamic,
    require_place,
    with_layer_craters,
)
from terrain_forge.rovers import resolve_rover, with_sensors
from terrain_forge.terrain import (
    check_appearance,
    check_layers,
    check_materials,
    read_orthoimage,
)


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A recipe that was checked as far as it goes without heights."""

    recipe: Recipe
    """It, with laws and diameters written out; files by their paths."""
    named: Recipe
    """The same as the world keeps it, files by names without a place; in `tiles` where it must."""
    folder: Path
    """What its paths are relative to."""
    body: Body
    """Its body."""
    rover: Rover
    """Its rover with its sensors."""
    rover_files: tuple[Path, ...]
    """The rover's own files; none of a built-in one."""
    inputs: InputFiles
    """The files that it names."""
    tables: dict[str, Table]
    """The tables among them, by name."""
    lists: tuple[Table, ...]
    """Those that list rocks."""
    routes: tuple[Route, ...]
    """The routes that are known before the ground."""
    fetched: RasterDtm | None = None
    """The terrain model that it names by product, place or address, as a file."""

    @property
    def is_whole(self) -> bool:
        """Whether it surely is built as one: rocks at craters of a layer count when those lie."""
        found = any(
            getattr(population.arrangement, "layer", None) is not None
            for population in self.recipe.rocks.populations
        )
        return self.named.tiles is None and not found


def draft(recipe: Recipe | RecipeFile | Path | str, *, folder: Path | str = ".") -> Draft:
    """Check a recipe as far as it goes without its heights: a moment, and no kernel is needed.

    Args:
        recipe: what to make, or its file.
        folder: what the recipe's paths are relative to; of a file, its own folder.

    Raises:
        RecipeError, DataError: if it cannot be built.
    """
    recipe, folder = given_recipe(recipe, folder)
    if isinstance(recipe.dtm, RasterDtm):
        recipe = replace(recipe, dtm=expanded(recipe.dtm))
    inputs = InputFiles(recipe, folder)
    found = resolve_rover(recipe.rover, folder)
    rover = with_sensors(found.rover, recipe.sensors, frames=found.frames)
    size = recipe.dtm.size_m
    require_paths(recipe)
    require_centre(recipe)
    require_on_body(recipe)
    require_lattice(recipe)
    recipe.sun.require_sound()
    recipe = resolve(recipe, inputs)
    named = inputs.portable(recipe)
    check_rocks(recipe.rocks, size)
    require_dynamic(recipe.rocks.populations, size=size, spacing=recipe.terrain.spacing_m)
    inputs.require()
    tables = {table.path: table for table in inputs.tables()}
    lists = tuple(tables[spec.file] for spec in named.rocks.lists)
    check_lists(recipe.rocks, lists, size=size)
    return Draft(
        recipe=recipe,
        named=in_tiles(named, listed=sum(len(table.values) for table in lists)),
        folder=folder,
        body=BODIES[recipe.body],
        rover=rover,
        rover_files=found.files,
        inputs=inputs,
        tables=tables,
        lists=lists,
        routes=plan_routes(recipe, rover, folder),
    )


def with_fetched(draft: Draft, *, progress: Progress = silent) -> Draft:
    """The draft with its terrain model at hand: fetched where it is not in the cache.

    Raises:
        DataError: if it cannot be.
    """
    dtm = draft.recipe.dtm
    if draft.fetched or not isinstance(dtm, RasterDtm) or dtm.source is not None:
        return draft
    with reading(dtm.name, key=("dtm",)):
        return replace(draft, fetched=at_hand(dtm, body=draft.body, progress=progress))


@checked
def plan(
    recipe: Recipe | RecipeFile | Path | str,
    *,
    folder: Path | str = ".",
    heights: NDArray[np.float64] | None = None,
    by_night: bool = False,
    progress: Progress = silent,
) -> Site:
    """Resolve a recipe once: read its inputs and fix everything that no window may change.

    A terrain model that the recipe names by product, place or address is fetched where it is not in
    the cache.

    Args:
        recipe: what to make, or its file.
        folder: what the recipe's paths are relative to; of a file, its own folder.
        heights: the heights [m] of a recipe with `dtm: {kind: array}`, rows running north.
        by_night: whether the Sun may be below the horizon; no world can be made of such a site.
        progress: called with the share of a terrain model that is fetched.

    Raises:
        RecipeError, DataError: before any work starts, if the recipe cannot be built. Only that a
            shape cannot be cut up as closely as its library wants, closer than usual, is not known
            before the library is made, which is the first work.
    """
    drafted = draft(recipe, folder=folder)
    return plan_draft(drafted, heights=heights, by_night=by_night, progress=progress)


def plan_draft(
    draft: Draft,
    *,
    heights: NDArray[np.float64] | None = None,
    by_night: bool = False,
    progress: Progress = silent,
) -> Site:
    """The rest of `plan`, whose arguments these are: read the heights and fix the site.

    Raises:
        RecipeError, DataError: as `plan`.
    """
    draft = with_fetched(draft, progress=progress)
    recipe, folder, body, inputs = draft.recipe, draft.folder, draft.body, draft.inputs
    name = getattr(recipe.dtm, "name", recipe.dtm.kind)
    fetched = {name: Path(draft.fetched.name)} if draft.fetched else {}
    with reading(name, key=("dtm",)):
        ground = survey(
            draft.fetched or recipe.dtm,
            body=body,
            folder=folder,
            heights=heights,
            seed=recipe.seed,
            horizon=recipe.horizon,
        )
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
        surroundings=ground.surroundings,
        largest_rock=largest_rock(recipe.rocks, draft.lists),
        images=inputs.images(),
        tables=tuple(draft.tables.values()),
        meshes=inputs.meshes(),
        inputs=inputs.hashes(patch=ground.dtm, rover_files=draft.rover_files, fetched=fetched),
        custom_rover=draft.rover if draft.rover_files else None,
        routes=draft.routes,
        exclusion_zones=exclusion_zones(
            recipe.rocks.exclusion_zones, routes=draft.routes, rover=draft.rover
        ),
        recipe_json=recipe_json(draft.named),
    )
    require_straight(site)
    _tell_idle_extent(site)
    if not by_night:
        light_of(site)
    terrain = site.recipe.terrain
    check_layers(terrain.layers, site)
    check_materials(terrain.materials, site)
    check_appearance(terrain.appearance, site)
    check_contact(site)
    if (picture := recipe.terrain.appearance.orthoimage) is not None:
        name = inputs.names[picture.image]
        picture_of_site = read_orthoimage(picture, name=name, site=site, folder=folder)
        site = site.replace(orthoimage=picture_of_site)
    site = _with_found_craters(site)
    populations = site.recipe.rocks.populations
    require_place(populations, site)
    wanted, meshes = site.recipe.rocks.library, site.meshes
    check_packing(populations, site.size, partial(find_library, wanted.sample(), custom=meshes))
    if (doubtful := wanted.doubtful()) is not None:
        find_library(doubtful, custom=meshes)
    return site


def _tell_idle_extent(site: Site) -> None:
    """Warn of an extent that a DTM's georeference leaves without effect, which its file tells."""
    dtm = site.recipe.dtm
    if isinstance(dtm, RasterDtm) and dtm.extent_m is not None and site.georeferenced:
        warn_user(f"dtm.extent_m: has no effect: {dtm.name} is georeferenced")


def _with_found_craters(site: Site) -> Site:
    """The site whose recipe names the craters of a layer that rocks lie around."""
    recipe, populations = site.recipe, with_layer_craters(site)
    if populations == recipe.rocks.populations:
        return site
    recipe = replace(recipe, rocks=replace(recipe.rocks, populations=populations))
    check_rocks(recipe.rocks, site.size)
    recipe = in_tiles(recipe)
    return site.replace(recipe_json=recipe_json(recipe))
