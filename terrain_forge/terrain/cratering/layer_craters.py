"""From a layer's spec to its craters: drawn by chance, taken from the user's list, or both."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terrain_forge.base import Array, mix, rectangle_distance, stage_key
from terrain_forge.dtm import geographic_crs, transform
from terrain_forge.model import Site, Table
from terrain_forge.terrain.cratering.craters import Craters
from terrain_forge.terrain.cratering.degradation import fresh_shapes
from terrain_forge.terrain.cratering.placement import Drawn, Rectangle, draw_craters
from terrain_forge.terrain.cratering.population import Population, Wear

if TYPE_CHECKING:
    from terrain_forge.terrain.layers.craters import CraterLayer


FEWEST_NODES = 4.0
"""Spacings that the smallest crater must be wide."""
UNRESOLVED = 5.0
"""Postings of a DTM up to which it does not show craters itself."""
_ALL = (0.01, 1e5)
"""Diameters [m] among which the largest is looked for."""
NOT_GIVEN = -1.0
"""What a list holds for a crater whose depth it does not give."""


def make_craters(spec: CraterLayer, *, site: Site, area: Rectangle) -> Craters:
    """All craters of a layer that reach into an area of the site, the youngest first.

    Those that are worn away are among them, where their rim was in the area.
    """
    key = stage_key(site.seed, f"terrain/{spec.name}")
    parts = []
    population = population_of(spec, site=site)
    if population is not None:
        drawn = draw_craters(population, key=np.uint64(mix(key, 0)), area=area)
        ratio = np.full(len(drawn.id), NOT_GIVEN)
        parts.append(_shaped(drawn, spec, site=site, ratio=ratio, listed=False))
    if spec.file is not None:
        table = site.table(spec.file)
        parts.append(_listed(table, spec, site=site, key=np.uint64(mix(key, 1))))
    craters = parts[0].joined(*parts[1:])
    # Of one age the smaller first, since a large one would have erased it; addresses settle ties.
    craters = craters.select(np.lexsort((craters.id, craters.diameter, craters.age)))
    reach = np.maximum(craters.reach, 0.5 * craters.diameter)
    return craters.select(rectangle_distance(craters.xy, area) < reach)


def population_of(spec: CraterLayer, *, site: Site) -> Population | None:
    """What chance draws for a layer on a site; None where its craters are listed only."""
    if spec.production is None:
        return None
    of_body = site.body.craters.equilibrium
    smallest, largest = spec.diameter_m
    if smallest is None:
        smallest = FEWEST_NODES * site.spacing
    if largest is None and site.dtm is not None:
        largest = UNRESOLVED * site.dtm.posting
    drawn = Population(
        body=site.body,
        production=spec.production,
        wear=wear_of(spec, site=site),
        equilibrium=spec.equilibrium or ("none" if spec.production.complete else of_body),
        diameters=(smallest, largest or _ALL[1]),
    )
    if largest is not None:
        return drawn
    # What one crater of the area is expected to reach.
    table, area = replace(drawn, diameters=_ALL).table, site.size[0] * site.size[1]
    expected = float(table.diameter[np.argmax(table.number * area < 1.0)])
    return replace(drawn, diameters=(smallest, min(expected, site.body.craters.largest_simple)))


def wear_of(spec: CraterLayer, *, site: Site) -> Wear:
    """How fast a layer's craters wear: by its own production and equilibrium where it has them."""
    return Wear(
        body=site.body,
        kind=None if spec.production is None else spec.production.kind,
        equilibrium=spec.equilibrium or "none",
        constant=spec.diffusivity_m2_per_myr,
    )


def listed_places(table: Table, *, site: Site) -> Array:
    """East and north [m] of listed craters, by x_m and y_m or lon_deg and lat_deg, [rows, 2]."""
    if "x_m" in table.columns:
        return np.column_stack([table.column("x_m"), table.column("y_m")])
    degrees = table.column("lon_deg"), table.column("lat_deg")
    return np.column_stack(transform(geographic_crs(site.crs), site.crs, *degrees))


def _listed(table: Table, spec: CraterLayer, *, site: Site, key: np.uint64) -> Craters:
    """The user's craters; what the table does not give is that of fresh ones."""
    rows = len(table.values)

    def column(name: str, otherwise: float) -> Array:
        return table.column(name) if name in table.columns else np.full(rows, otherwise)

    given = Drawn(
        id=np.array([mix(key, n) for n in range(rows)], np.uint64),
        xy=listed_places(table, site=site),
        diameter=table.column("diameter_m"),
        age=column("age_ga", 0.0),
    )
    ratio = column("depth_to_diameter", NOT_GIVEN)
    return _shaped(given, spec, site=site, ratio=ratio, listed=True)


def _shaped(drawn: Drawn, spec: CraterLayer, *, site: Site, ratio: Array, listed: bool) -> Craters:
    """Craters with their fresh measures and their wear."""
    usual = np.nan if spec.depth_to_diameter is None else spec.depth_to_diameter
    fresh = fresh_shapes(
        drawn.diameter,
        body=site.body,
        depth_to_diameter=np.where(ratio == NOT_GIVEN, usual, ratio),
        ejecta=spec.ejecta,
    )
    return Craters(
        **drawn._asdict(),
        listed=np.full(len(drawn.id), listed),
        fresh_depth=fresh.depth,
        fresh_rim=fresh.rim,
        fresh_ejecta=fresh.ejecta,
        wear=wear_of(spec, site=site).of(drawn.diameter, drawn.age),
    )
