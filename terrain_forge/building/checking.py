"""What `terrain-forge check` says: of the DTM, the recipe, what it costs, the rover."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import degrees
from pathlib import Path
from typing import Any

from terrain_forge.base import DataError, ExportError, length_text, reading, returning
from terrain_forge.building.cost import cost_line, stage_line
from terrain_forge.dtm import (
    Description,
    RasterDtm,
    at_hand,
    describe,
    ellipsoid,
    followed_to,
    open_raster,
    site_facts,
    still_to_fetch,
)
from terrain_forge.making import light_of
from terrain_forge.model import BODIES, Lighting, Rover, Site
from terrain_forge.paths import Planned, duration, highest_step
from terrain_forge.recipe import (
    ExportOrder,
    Recipe,
    require_exports,
    rocks_of,
    tile_cells,
)
from terrain_forge.rocks import contact_told, require_pebbles
from terrain_forge.rovers import doubts_of, rover_of, told_radii

_WARNING = f"  {'warning':<12}"


def fetch_lines(recipe: Recipe) -> Iterator[str]:
    """Lines that say what a build would take from the network; none where all is at hand.

    Raises:
        RecipeError: for a product or place that does not exist.
    """
    if isinstance(recipe.dtm, RasterDtm):
        yield from still_to_fetch(recipe.dtm, body=BODIES[recipe.body])


def dtm_lines(recipe: Recipe, folder: Path) -> Iterator[str]:
    """Lines that say what the recipe's DTM is, where it has one.

    Raises:
        DataError: if it cannot be opened.
    """
    if isinstance(recipe.dtm, RasterDtm):
        body = BODIES[recipe.body]
        with reading(recipe.dtm.name, key=("dtm", "source")):
            raster = open_raster(at_hand(recipe.dtm, body=body), body=body, folder=folder)
            with raster.dataset:
                lines = list(_lines(describe(raster, destaired=recipe.dtm.destair)))
        yield f"DTM {recipe.dtm.name}"
        yield from lines


def site_lines(site: Site, orders: Sequence[ExportOrder]) -> Iterator[str]:
    """Lines that say what will be made of a planned site, and what it costs.

    Raises:
        ExportError: if a format cannot hold it.
    """
    recipe, window = site.recipe, site.window
    yield f"site {site.name} on {site.body.name}, {site.size[0]:g} × {site.size[1]:g} m"
    if site.lonlat:
        yield f"  centre       {degrees(site.lonlat[0]):.5f}° E {degrees(site.lonlat[1]):.5f}° N"
    yield f"  grid         {window.columns + 1} × {window.rows + 1} nodes at {site.spacing:g} m"
    if recipe.tiles is not None:
        cells = tile_cells(recipe)
        across, up = -(-window.columns // cells), -(-window.rows // cells)
        yield f"  tiles        {across} × {up} of {cells * site.spacing:g} m, built one by one"
    for layer in recipe.terrain.layers:
        what = f"layer {layer.kind!r}: facts"
        with returning(layer, what, "pairs of texts, a word and what is told"):
            yield from [f"  {word:<12} {told}" for word, told in layer.facts(site)]
    for line in site_facts(site):
        yield f"  {line}"
    yield f"  horizon      {_horizon(site)}"
    yield f"  sun          {_sun(light_of(site))}"
    rocks = rocks_of(site)
    yield f"  rocks        about {rocks:,.0f}, up to {site.largest_rock:.3g} m"
    if recipe.rocks.library.shapes and recipe.rocks.library.is_tight:
        yield (
            f"  {'shapes':<12} {recipe.rocks.library.shapes}, their hulls closer than usual: some "
            "may not be cut up so closely, which a build sees first of all"
        )
    if recipe.rocks.groups:
        yield f"  soil at them {contact_told(site)}"
    for population in recipe.rocks.populations:
        fit = population.size_frequency.fit_to_counts(*population.diameters)
        if fit:
            yield f"  {'counts':<12} {population.name}: {fit['summary']}"
            yield from (f"  {'warning':<12} {population.name}: {text}" for text in fit["warnings"])
    for route in site.routes:
        yield f"  path         {route.name}: {route.length:.1f} m, {duration(route):.0f} s"
    for path in recipe.paths:
        if isinstance(path.route, Planned):
            yield f"  path         {path.name}: planned on the finished ground"
    yield from rover_lines(site, rover_of(site))
    require_formats(orders, site)
    yield f"  exports      {', '.join(order.folder for order in orders) or 'none'}"
    yield f"cost           {cost_line(site, orders)}"
    yield f"  {'time':<12} {stage_line(site, orders)}"


def require_formats(orders: Sequence[ExportOrder], site: Site) -> None:
    """Refuse, before a world is made, what its formats cannot hold and pebbles that it cannot have.

    Raises:
        ExportError: for the first format, or the recording, that asks for such.
    """
    if site.recipe.tiles is None:  # each tile is loaded by itself
        require_exports(orders, site)
    asked: list[tuple[tuple[str, ...], Any]] = [
        (("exports", order.folder), order.options) for order in orders
    ]
    if site.recipe.tiles is None:  # of a site in tiles parts are recorded, which have less of it
        asked.append((("dataset",), site.recipe.dataset))
    for key, options in asked:
        smallest = getattr(options, "pebbles_min_m", 0.0)
        within = getattr(options, "pebbles_within_m", 0.0)
        try:
            require_pebbles(site, smallest=smallest, within=within)
        except ExportError as error:
            raise ExportError(str(error), key=(*key, "pebbles_min_m")) from None


def check_raster(path: Path) -> list[str]:
    """Lines that say what a raster file is.

    Raises:
        DataError: if it is none.
    """
    with reading(str(path)):
        return _described(path)


def _described(path: Path) -> list[str]:
    spec = RasterDtm(source=path.name, size_m=(1.0, 1.0))
    found: list[tuple[float, list[str]]] = []
    for body in BODIES.values():
        try:
            raster = open_raster(spec, body=body, folder=path.parent)
        except DataError as error:
            if error.key != ("body",):
                raise
            continue
        with raster.dataset:
            lines = list(_lines(describe(raster)))
        if not raster.crs:
            return [f"DTM {path}", *lines]
        misfit = abs(ellipsoid(raster.crs)[0] / body.mean_radius - 1.0)
        found.append((misfit, [f"DTM {path}", f"  {'body':<12} {body.name}", *lines]))
    if not found:
        raise DataError(f"{path} lies on none of the bodies {', '.join(BODIES)}")
    return min(found)[1]


def _lines(description: Description) -> Iterator[str]:
    for name, value in description.facts:
        yield f"  {name:<12} {value}"
    for warning in description.warnings:
        yield f"  warning      {warning}"


def _sun(light: Lighting) -> str:
    """Where the Sun stands, and when that is."""
    stands = f"{degrees(light.sun_elevation):.1f}° high, azimuth {degrees(light.sun_azimuth):.1f}°"
    local = f", {light.solar_time} local true solar time" if light.solar_time else ""
    return f"{stands}; {light.time}{local}" if light.time else stands


def _horizon(site: Site) -> str:
    """What lies beyond the site, in words, and what it takes."""
    spec = site.recipe.horizon
    if spec.reach_m == 0.0:
        return "none: the world ends at its border"
    known = followed_to(site)
    if not known:
        told = "no heights were read beyond the site: level ground"
    else:
        sources = ", ".join(dict.fromkeys(level.source for level in site.surroundings))
        told = f"heights read out to {length_text(known)} ({sources})"
    rocks = f"; rocks within {spec.rocks_m:g} m" if spec.rocks_m else ""
    return f"{told}{rocks}; 1 to 6 MB in each format that takes it"


def rover_lines(site: Site, rover: Rover) -> Iterator[str]:
    """What a site's rover is, and warnings of what cannot be right or is too fast for it."""
    if not rover.wheels:
        yield f"  {'rover':<12} {rover.name}: {rover.mass:.3g} kg, no wheels"
        return
    held = f", held: {', '.join(rover.held)}" if rover.held else ""
    yield (
        f"  {'rover':<12} {rover.name}: {rover.mass:.3g} kg, {len(rover.wheels)} wheels of "
        f"{told_radii(rover)} m driven{held}, step limit {highest_step(rover):.2g} m"
    )
    for note in rover.notes[bool(rover.held) :]:  # the first names those that are held
        yield f"  {'note':<12} {note}"
    yield from (f"{_WARNING} {text}" for text in rover.unread)
    yield from (f"{_WARNING} {text}" for text in doubts_of(rover))
    if rover.length > min(site.size) or rover.width > min(site.size):
        yield (
            f"{_WARNING} the rover is {rover.length:.3g} m long and {rover.width:.3g} m wide, the "
            f"site {site.size[0]:g} × {site.size[1]:g} m"
        )
    validate = site.recipe.validate
    if rover.steering and validate and (validate.drive or validate.drives):
        yield (
            f"{_WARNING} joints that steer are held at rest ({', '.join(rover.steering)}): the "
            "rover turns by skidding, or not at all"
        )
    for path in site.recipe.paths:
        if path.speed_m_s > rover.speed_limit:
            yield (
                f"{_WARNING} {path.name}: {path.speed_m_s:g} m/s, the rover {rover.name} drives "
                f"at {rover.speed_limit:g} m/s at most"
            )
