"""Whether a site can have the craters that a layer asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from terrain_forge.base import DataError, Key, RecipeError, rectangle_distance
from terrain_forge.model import Site, Table
from terrain_forge.terrain.cratering.degradation import REACH
from terrain_forge.terrain.cratering.layer_craters import (
    FEWEST_NODES,
    NOT_GIVEN,
    UNRESOLVED,
    listed_places,
    population_of,
)
from terrain_forge.terrain.cratering.placement import expected_craters
from terrain_forge.terrain.cratering.production import OLDEST

if TYPE_CHECKING:
    from terrain_forge.terrain.layers.craters import CraterLayer

MAX_CRATERS = 2_000_000
"""Craters of a layer that may reach a site."""

_PLACES = ("x_m", "y_m", "lon_deg", "lat_deg")


def check_craters(spec: CraterLayer, *, site: Site, key: Key) -> None:
    """Refuse what a site cannot have.

    Args:
        spec: the layer.
        site: the site.
        key: where the layer stands in the recipe.

    Raises:
        RecipeError: for a law of another body, a range of diameters that is upside down, too fine
            for the grid or goes on to complex craters, or too many craters.
        DataError: for a listed crater that cannot be.
    """
    if spec.production is not None:
        body = site.body
        if not spec.production.holds_on(body):
            own = ", ".join(one.kind for one in body.craters.productions) or "none"
            raise RecipeError(
                f"{spec.production.kind} is no production function of {body.name.capitalize()}, "
                f"which has {own}",
                key=(*key, "production", "kind"),
            )
        _check_range(spec, site, (*key, "diameter_m"))
    if spec.file is not None:
        _check_list(site.table(spec.file), site, (*key, "file"))


def _check_range(spec: CraterLayer, site: Site, key: Key) -> None:
    """Refuse diameters that the grid or the body do not have, or too many craters of them."""
    given = spec.diameter_m
    finest, complex_from = FEWEST_NODES * site.spacing, site.body.craters.largest_simple
    if given[0] is not None and given[0] < finest:
        raise RecipeError(
            f"craters of {given[0]:g} m need a spacing of {given[0] / FEWEST_NODES:g} m or less, "
            f"found {site.spacing:g} m; at this spacing the smallest is {finest:g} m",
            key=key,
        )
    if given[1] is not None and given[1] > complex_from:
        raise RecipeError(
            f"craters of {given[1]:g} m are complex, with central peaks and terraces, which are "
            f"not made; simple ones go up to {complex_from:g} m on {site.body.name.capitalize()}",
            key=key,
        )
    population = population_of(spec, site=site)
    assert population is not None
    smallest, largest = population.diameters
    if smallest < largest:
        number = expected_craters(population, site.bounds)
        if number > MAX_CRATERS:
            raise RecipeError(
                f"{number:.3g} craters of {smallest:g} m and more would reach the site, at most "
                f"{MAX_CRATERS:.3g}; choose a larger smallest diameter",
                key=key,
            )
        return
    if None not in given:
        raise RecipeError(
            f"from {smallest:g} to {largest:g} m: the first must be the smaller", key=key
        )
    why = "that is expected once on this area"
    if site.dtm is not None:
        why = f"that is {UNRESOLVED:g} postings of the DTM, which shows larger ones itself"
    ends = f"smallest {smallest:g} m", f"largest {largest:g} m"
    found = ", ".join(
        f"{end}{'' if value is not None else ' (by default)'}"
        for end, value in zip(ends, given, strict=True)
    )
    raise RecipeError(f"no craters between: {found}; by default the largest is {why}", key=key)


def _check_list(table: Table, site: Site, key: Key) -> None:
    _check_places(table, site, key)
    complex_from = site.body.craters.largest_simple
    limits = {
        "lon_deg": (-180.0, 360.0),
        "lat_deg": (-90.0, 90.0),
        "diameter_m": (FEWEST_NODES * site.spacing, complex_from),
        "age_ga": (0.0, OLDEST),
        "depth_to_diameter": (0.02, 0.3),
    }
    for name in table.columns:
        low, high = limits.get(name, (-np.inf, np.inf))
        values = table.column(name)
        allowed = f"{low:g} to {high:g}"
        if name == "diameter_m":
            allowed += (
                f": at least {FEWEST_NODES:g} spacings, and no complex craters, which begin at "
                f"{complex_from:g} m on {site.body.name.capitalize()}"
            )
        blank = (name == "depth_to_diameter") & (values == NOT_GIVEN)
        good = (values >= low) & (values <= high) | blank
        if not good.all():
            row = int(np.argmin(good))
            raise DataError(
                f"{table.path}: {name} of crater {row + 1} is {values[row]:g}, allowed: {allowed}",
                key=key,
            )
    away = rectangle_distance(listed_places(table, site=site), site.bounds)
    if not np.any(away < 0.5 * REACH * table.column("diameter_m")):
        raise DataError(
            f"{table.path}: no crater reaches the site, which ends at ±{0.5 * site.size[0]:g}, "
            f"±{0.5 * site.size[1]:g} m",
            key=key,
        )


def _check_places(table: Table, site: Site, key: Key) -> None:
    places = tuple(name for name in _PLACES if name in table.columns)
    if places not in (_PLACES[:2], _PLACES[2:]):
        raise DataError(
            f"{table.path} needs the columns x_m and y_m, or lon_deg and lat_deg; found "
            f"{', '.join(places) or 'neither'}",
            key=key,
        )
    if places == _PLACES[2:] and not site.georeferenced:
        raise DataError(
            f"{table.path} gives longitudes and latitudes, but the site has none: give x_m and y_m",
            key=key,
        )
