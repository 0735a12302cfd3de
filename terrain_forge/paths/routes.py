"""The recipe's paths: routes before there is ground, planned ones after, then trajectories."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from terrain_forge.base import Key, RecipeError
from terrain_forge.model import (
    Heightfield,
    RockField,
    RockLibrary,
    Route,
    Rover,
    Site,
    Trajectory,
    Window,
)
from terrain_forge.paths.plan import overhang, plan_route, require_inside
from terrain_forge.paths.planner import plan_path, require_off_border
from terrain_forge.paths.recorded import read_recorded
from terrain_forge.paths.spec import PathSpec, Planned, Recorded
from terrain_forge.paths.surroundings import require_free_start
from terrain_forge.paths.trajectory import duration, make_trajectory
from terrain_forge.paths.traversability_field import traversability
from terrain_forge.rovers import doubt_unit, require_ground

if TYPE_CHECKING:
    from terrain_forge.recipe import Recipe

MOST_SAMPLES = 2_000_000
"""Samples of one path."""


def plan_routes(recipe: Recipe, rover: Rover, folder: Path) -> tuple[Route, ...]:
    """The routes that are known before the ground; the recipe names files relative to `folder`.

    Raises:
        RecipeError, DataError: for a route that cannot be driven or leaves the site.
    """
    driven, routes, size = recipe.driven_path, [], recipe.dtm.size_m
    spacing = recipe.terrain.spacing_m
    if driven is not None or not isinstance(recipe.rover, str):
        require_ground(rover, spacing=spacing)
    for number, path in enumerate(recipe.paths):
        key, recorded = ("paths", number), None
        if isinstance(path.route, Recorded):
            recorded = read_recorded(path.route, folder, key=(*key, "route", "file"))
        with _doubting_unit(rover):
            if isinstance(path.route, Planned):
                require_off_border(path.route, size=size, spacing=spacing, rover=rover, key=key)
                continue
            here = path.name == driven
            route = plan_route(path, rover=rover, driven=here, recorded=recorded, key=key)
            require_inside(route, size=size, rover=rover, key=key)
        require_samples(route, rate=path.rate_hz, key=key)
        routes.append(route)
    return tuple(routes)


@contextmanager
def _doubting_unit(rover: Rover) -> Iterator[None]:
    """Where the rover's lengths can hardly be metres, that is why a route is refused."""
    try:
        yield
    except RecipeError as error:
        if not (doubt := doubt_unit(rover)):
            raise
        raise RecipeError(f"{doubt} As metres, {error}", key=("rover",)) from None


def make_trajectories(
    site: Site,
    window: Window,
    ground: Heightfield,
    rocks: RockField,
    library: RockLibrary,
    rover: Rover,
    planned: Iterable[Route] = (),
) -> tuple[Trajectory, ...]:
    """The paths that lie wholly within a window, on its bare ground.

    Planned ones depend on all of the ground and its rocks: only the whole site has them, unless
    their routes are given. The rocks are those of the window, and those that reach into it.

    Raises:
        RecipeError: if a planned path cannot be found, or the driven one starts within a rock.
    """
    routes = {route.name: route for route in (*site.routes, *planned)}
    if window == site.window and not planned:
        routes |= _plan_on_ground(site, ground, rocks, library, rover)
    driven, made = site.recipe.driven_path, []
    for number, spec in enumerate(site.recipe.paths):
        route = routes.get(spec.name)
        if route is None or overhang(route, bounds=ground.bounds, rover=rover)[0] > 0.0:
            continue
        path = make_trajectory(route, spec=spec, ground=ground, rover=rover, seed=site.seed)
        if spec.name == driven:
            key = ("paths", number)
            require_free_start(path, rocks=rocks, library=library, rover=rover, key=key)
        made.append(path)
    return tuple(made)


def _plan_on_ground(
    site: Site, ground: Heightfield, rocks: RockField, library: RockLibrary, rover: Rover
) -> dict[str, Route]:
    """The planned routes, by name, over the whole site."""
    rated = lru_cache(
        partial(traversability, ground=ground, rocks=rocks, library=library, rover=rover)
    )

    def found(spec: PathSpec, route: Planned, key: Key) -> Route:
        return plan_path(spec, route, field=rated(), rover=rover, key=key)

    return planned_routes(site, rover, found)


def planned_routes(
    site: Site, rover: Rover, found: Callable[[PathSpec, Planned, Key], Route]
) -> dict[str, Route]:
    """The planned routes of a site, by name, as a function finds them.

    Raises:
        RecipeError: if one cannot be found, or leaves the site.
    """
    routes = dict[str, Route]()
    for number, spec in enumerate(site.recipe.paths):
        if isinstance(spec.route, Planned):
            key = ("paths", number)
            route = found(spec, spec.route, key)
            require_inside(route, size=site.size, rover=rover, key=key)
            require_samples(route, rate=spec.rate_hz, key=key)
            routes[route.name] = route
    return routes


def require_samples(route: Route, *, rate: float, key: Key) -> None:
    """Refuse a path of more samples than anybody could use."""
    takes = duration(route)
    if takes * rate > MOST_SAMPLES:
        raise RecipeError(
            f"{takes:.3g} s at {rate:g} Hz are {takes * rate:.3g} samples, at most "
            f"{MOST_SAMPLES:,}",
            key=(*key, "rate_hz"),
        )
