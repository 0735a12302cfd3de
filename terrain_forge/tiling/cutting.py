"""A part of a built site as a world of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from terrain_forge.base import OutputError, Stopwatch
from terrain_forge.making import make_world
from terrain_forge.model import Site, Window, World
from terrain_forge.recipe import away_from_paths, recipe_json, require_window_fits
from terrain_forge.tiling.order import load_order
from terrain_forge.tiling.routing import load_routes


def cut_world(
    out: Path, *, centre: tuple[float, float], size: tuple[float, float], watch: Stopwatch
) -> World:
    """The world of a rectangle [m] of a site in tiles, to whole cells; the same bits as its tiles.

    Planned paths that lie wholly in it are those of the site, once it is built. A drive that the
    recipe asks for is not asked of a part that does not hold its path, nor what exports have near
    paths of one that holds none.

    Raises:
        OutputError: if the folder holds no site in tiles, or the rectangle is not in it.
        RecipeError: if it does not fit into memory.
    """
    site = load_order(out).site
    window = window_of(site, centre, size)
    require_window_fits(site, window)
    world = make_world(site, window, settled=True, progress=watch, planned=load_routes(out) or ())
    whole = recipe = site.recipe
    if recipe.validate and recipe.driven_path not in {
        None, *(path.name for path in world.trajectories)
    }:  # fmt: skip
        recipe = replace(recipe, validate=replace(recipe.validate, drive=None))
    if not world.trajectories:
        recipe = away_from_paths(recipe)
    if recipe == whole:
        return world
    return world.replace(site=site.replace(recipe_json=recipe_json(recipe)))


def window_of(site: Site, centre: tuple[float, float], size: tuple[float, float]) -> Window:
    """The cells of a rectangle [m].

    Raises:
        OutputError: if it does not lie in the site, or has less than two cells a side.
    """
    cells = tuple(round(length / site.spacing) for length in size)
    first = tuple(
        round((middle - 0.5 * length - edge) / site.spacing)
        for middle, length, edge in zip(centre, size, (site.west, site.south), strict=True)
    )
    whole = site.window.columns, site.window.rows
    if min(cells) < 2:
        raise OutputError(
            f"--size {size[0]:g},{size[1]:g}: at least two cells of {site.spacing:g} m each way"
        )
    if any(f < 0 or f + c > n for f, c, n in zip(first, cells, whole, strict=True)):
        east, north = (0.5 * length for length in site.size)
        raise OutputError(
            f"{size[0]:g} × {size[1]:g} m around ({centre[0]:g}, {centre[1]:g}) m is not within "
            f"the site, which reaches {east:g} m east and {north:g} m north of its middle"
        )
    return Window(column=first[0], row=first[1], columns=cells[0], rows=cells[1])
