"""Checks of a whole recipe that no single key can make, before any data is read."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import dist

from terrain_forge.base import ExportError, RecipeError
from terrain_forge.model import BODIES, USUAL_CELLS, Site, Window, check_capacity
from terrain_forge.paths import PathSpec, Planned
from terrain_forge.recipe.exports import ExportOrder
from terrain_forge.recipe.schema import Recipe, TilesSpec
from terrain_forge.rocks import expected_count

BYTES = 0.6e9
"""Peak memory of a build without ground and rocks: the libraries (measured, as the next two)."""
BYTES_PER_NODE = 100
"""Peak memory of a build for each node of the ground."""
BYTES_PER_ROCK = 4500
"""Peak memory of a build for each rock."""
NEAREST_STOPS = 0.1
"""Distance of neighbouring places of a planned path [m]."""


def require_paths(recipe: Recipe) -> None:
    """Refuse names of paths that occur twice, and a drive along a path that does not exist."""
    paths = [path.name for path in recipe.paths]
    for number, path in enumerate(recipe.paths):
        key = ("paths", number)
        earlier = [name.lower() for name in paths[:number]]
        if path.name.lower() in earlier:
            raise RecipeError(
                f"a path before is called {path.name!r} too, case aside", key=(*key, "name")
            )
        if path.shake.rms_deg and path.shake.cutoff_hz > 0.5 * path.rate_hz:
            raise RecipeError(
                f"{path.shake.cutoff_hz:g} Hz, at most half the rate, {0.5 * path.rate_hz:g} Hz",
                key=(*key, "shake", "cutoff_hz"),
            )
        if isinstance(path.route, Planned):
            _require_plannable(recipe, path, path.route, key)
    recorded = recipe.dataset and recipe.dataset.path
    for named, part in (
        (recipe.driven_path, ("validate", "drive")),
        (recorded, ("dataset", "path")),
    ):
        if named is not None and named not in paths:
            known = ", ".join(paths) or "none"
            raise RecipeError(f"no path is called {named!r}, there are: {known}", key=part)


def _require_plannable(
    recipe: Recipe, path: PathSpec, route: Planned, key: tuple[str | int, ...]
) -> None:
    """Refuse a planned path that would shape the world, or whose places lie outside or coincide."""
    if path.corridor is not None and path.corridor.width_m != 0.0:
        raise RecipeError(
            f"path {path.name!r} is planned around the rocks, so it cannot keep a corridor free of "
            "them; leave it out",
            key=(*key, "corridor"),
        )
    for number, layer in enumerate(recipe.terrain.layers):
        band = layer.mask.route if layer.mask is not None else None
        if band is not None and band.path == path.name:
            raise RecipeError(
                f"path {path.name!r} is planned on the finished ground and cannot shape it",
                key=("terrain", "layers", number, "mask", "route", "path"),
            )
    east, north = 0.5 * recipe.dtm.size_m[0], 0.5 * recipe.dtm.size_m[1]
    for name, (x, y) in route.stops:
        if abs(x) > east or abs(y) > north:
            raise RecipeError(
                f"({x:g}, {y:g}) m lies outside the site, which reaches {east:g} m east and "
                f"{north:g} m north",
                key=(*key, "route", name),
            )
    for (_, begin), (name, end) in pairwise(route.stops):
        if dist(begin, end) < NEAREST_STOPS:
            raise RecipeError(
                f"({end[0]:g}, {end[1]:g}) m is {dist(begin, end):.3g} m from the place before it, "
                f"at least {NEAREST_STOPS:g} m is needed",
                key=(*key, "route", name),
            )


def require_centre(recipe: Recipe) -> None:
    """Refuse a centre that is given in two ways, or in none."""
    centre = getattr(recipe.dtm, "centre", None)
    given = [name for name, value in vars(centre).items() if value is not None] if centre else []
    if centre and len(given) != 1:
        found = " and ".join(given) or "none"
        raise RecipeError(
            f"one of offset_m, crs and lonlat_deg, found {found}", key=("dtm", "centre")
        )


def require_on_body(recipe: Recipe) -> None:
    """Refuse an area that is longer than its body's radius: no plane stands for that ground."""
    radius = BODIES[recipe.body].mean_radius
    longest = max(recipe.dtm.size_m)
    if longest > radius:
        raise RecipeError(
            f"{longest:g} m: a site is at most as long as the radius of {recipe.body}, "
            f"{radius:.4g} m",
            key=("dtm", "size_m"),
        )


def require_lattice(recipe: Recipe) -> None:
    """Refuse an area that is not a whole number of cells each way."""
    spacing = recipe.terrain.spacing_m
    for size in recipe.dtm.size_m:
        cells = size / spacing
        if round(cells) < 2 or abs(cells - round(cells)) > 1e-6 * max(cells, 1.0):
            nearest = max(round(cells), 2) * spacing
            raise RecipeError(
                f"{size:g} m is not a whole number (2 or more) of cells of {spacing:g} m; "
                f"{nearest:g} m would be",
                key=("dtm", "size_m"),
            )


def in_tiles(recipe: Recipe, *, listed: int = 0) -> Recipe:
    """The recipe, with `tiles` where the world would not fit into this machine's memory.

    Args:
        recipe: what to make.
        listed: rocks of the user's own lists.

    Raises:
        RecipeError: if not even a tile fits.
    """
    rocks = expected_rocks(recipe) + listed
    if recipe.tiles is None and _missing(recipe, rocks) is None:
        return recipe
    recipe = replace(recipe, tiles=recipe.tiles or TilesSpec())
    nodes = expected_nodes(recipe)
    most = min(float((tile_cells(recipe) + 1) ** 2), nodes)
    if (missing := _missing(recipe, rocks * most / nodes, most)) is not None:
        raise missing
    return recipe


def require_fits(site: Site) -> None:
    """Refuse the world of a whole site that would not fit into this machine's memory."""
    if (missing := _missing(site.recipe, rocks_of(site))) is not None:
        raise missing


def require_window_fits(site: Site, window: Window) -> None:
    """Refuse the world of a window of a site that would not fit into this machine's memory."""
    nodes = (window.columns + 1) * (window.rows + 1)
    rocks = rocks_of(site) * min(nodes / expected_nodes(site.recipe), 1.0)
    if (missing := _missing(site.recipe, rocks, nodes)) is not None:
        raise missing


def _missing(recipe: Recipe, rocks: float, nodes: float | None = None) -> RecipeError | None:
    """What is said of a world that does not fit into memory; None for one that does."""
    nodes = nodes or expected_nodes(recipe)
    needed = memory_needed(nodes, rocks)
    there = machine_memory()
    if needed <= there:
        return None
    key = ("terrain", "spacing_m") if nodes * BYTES_PER_NODE > needed / 2 else ("rocks",)
    return RecipeError(
        f"{nodes:.3g} nodes and {rocks:.3g} rocks need about {needed / 1e9:.3g} GB of memory, "
        f"this machine has {there / 1e9:.3g} GB; build it in smaller `tiles`, or choose a larger "
        "spacing, a smaller area or larger rocks",
        key=key,
    )


def require_exports(orders: Sequence[ExportOrder], site: Site) -> None:
    """Refuse a world that would be too large for one of its formats, before it is made.

    Raises:
        ExportError: for the first format that cannot hold it.
    """
    nodes, rocks = expected_nodes(site.recipe), rocks_of(site)
    for order in orders:
        try:
            check_capacity(order.exporter, order.options, nodes=nodes, rocks=rocks)
        except ExportError as error:
            raise ExportError(str(error), key=("exports", order.folder, *error.key)) from None


def rocks_of(site: Site) -> float:
    """About how many rocks a site will have, with those of the user's own lists.

    Density images count by their mean; slope limits, corridors and exclusion zones do not.
    """
    recipe = site.recipe
    count = sum(len(site.table(table.file).values) for table in recipe.rocks.lists) + 0.0
    for population in recipe.rocks.populations:
        image = population.density_image
        share = 1.0 if image is None else float(site.image(image).mean())
        count += share * expected_count(population, recipe.dtm.size_m)
    return count


def machine_memory() -> int:
    """Memory of this machine [bytes]."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def memory_needed(nodes: float, rocks: float) -> float:
    """Estimated peak memory of a build with so many nodes and rocks [bytes]."""
    return BYTES + nodes * BYTES_PER_NODE + rocks * BYTES_PER_ROCK


def tile_cells(recipe: Recipe) -> int:
    """Cells of a tile each way, to the nearest."""
    size = recipe.tiles.size_m if recipe.tiles else None
    return USUAL_CELLS if size is None else max(round(size / recipe.terrain.spacing_m), 1)


def expected_nodes(recipe: Recipe) -> float:
    """Nodes of the ground."""
    east, north = recipe.dtm.size_m
    spacing = recipe.terrain.spacing_m
    return (east / spacing + 1) * (north / spacing + 1)


def expected_rocks(recipe: Recipe) -> float:
    """Expected number of rocks of all populations of a recipe whose laws are resolved."""
    return sum(expected_count(p, recipe.dtm.size_m) for p in recipe.rocks.populations)
