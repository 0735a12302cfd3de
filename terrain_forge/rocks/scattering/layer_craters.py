"""Rocks around the craters of a layer: the craters are found and written into the recipe."""

from __future__ import annotations

from dataclasses import replace

from terrain_forge.base import Key, RecipeError
from terrain_forge.model import Site
from terrain_forge.rocks.around_craters import LIFETIME
from terrain_forge.rocks.arrangement import AroundCraters, Crater
from terrain_forge.rocks.populations import PopulationSpec
from terrain_forge.terrain import CraterLayer, make_craters, population_of

MAX_CRATERS = 100_000
"""Craters that one population may lie around."""


def with_layer_craters(site: Site) -> tuple[PopulationSpec, ...]:
    """The site's populations with the craters of the layers that they name.

    Raises:
        RecipeError: for an unknown layer, one without craters of the size, or too many of them.
    """
    populations = list(site.recipe.rocks.populations)
    for number, population in enumerate(populations):
        arrangement = population.arrangement
        if isinstance(arrangement, AroundCraters) and arrangement.layer is not None:
            key = ("rocks", "populations", number, "arrangement")
            around = AroundCraters(craters=_craters_of(arrangement, site, key))
            populations[number] = replace(population, arrangement=around)
    return tuple(populations)


def _craters_of(arrangement: AroundCraters, site: Site, key: Key) -> tuple[Crater, ...]:
    """The craters of a layer that have rocks, the youngest first."""
    layers = {
        layer.name: layer for layer in site.recipe.terrain.layers if isinstance(layer, CraterLayer)
    }
    if arrangement.layer not in layers:
        known = ", ".join(layers) or "none"
        raise RecipeError(
            f"no layer of craters is called {arrangement.layer!r}, there are: {known}",
            key=(*key, "layer"),
        )
    layer, least = layers[arrangement.layer], arrangement.smallest_crater_m
    drawn = population_of(layer, site=site)
    if drawn is not None and drawn.diameters[0] < least < drawn.diameters[1]:
        layer = replace(layer, diameter_m=(least, drawn.diameters[1]))  # smaller ones are many
    found = make_craters(layer, site=site, area=site.bounds)
    large = found.diameter >= least
    found = found.select(large & (found.wear < 1.0) & (found.age < LIFETIME))
    if not 0 < len(found) <= MAX_CRATERS:
        raise RecipeError(
            f"{len(found)} craters of {least:g} m and more have rocks that "
            f"reach the site, allowed: 1 to {MAX_CRATERS}",
            key=(*key, "smallest_crater_m"),
        )
    rows = zip(found.xy.tolist(), found.diameter.tolist(), found.age.tolist(), strict=True)
    return tuple(
        Crater(centre_m=(east, north), diameter_m=diameter, age_ga=age)
        for (east, north), diameter, age in rows
    )
