"""Site to World: library, ground, rocks, paths of a window, and what lies beyond its edge."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from terrain_forge.base import Stopwatch, linear_from_srgb, silent, srgb_from_linear
from terrain_forge.making.lighting import light_of
from terrain_forge.model import (
    Appearance,
    Heightfield,
    Horizon,
    Mesh,
    RockLibrary,
    Route,
    Site,
    Window,
    World,
    owned,
    touches,
)
from terrain_forge.paths import make_trajectories
from terrain_forge.rocks import (
    FILLED,
    Banked,
    Scattered,
    bank_reach,
    bank_soil,
    drifted_soil,
    find_library,
    place_rocks,
    reaching,
    rock_margin,
    rocks_beyond,
    scatter,
    unsupported,
)
from terrain_forge.rovers import rover_of
from terrain_forge.scene import dust_on, soil_of, tints_of
from terrain_forge.terrain import (
    Border,
    heights_beyond,
    paint,
    shape_ground,
    shape_horizon,
    stencil_reach,
)
from terrain_forge.writers import vertex_normals


def make_world(
    site: Site,
    window: Window,
    *,
    settled: bool,
    progress: Stopwatch,
    horizon: bool = True,
    planned: tuple[Route, ...] = (),
) -> World:
    """The world of a window of a site, as `realise` says; on demand without what lies beyond.

    Routes of planned paths are given where they were found on all of the site.
    """
    land = _lay_land(site, window, progress)
    library, scattered = land.library, land.scattered
    ground = land.part(window)
    placed = place_rocks(
        scattered.select(reaching(scattered, site=site, library=library, window=window)),
        site=site,
        library=library,
        ground=land.ground,
        bare=land.bare,
        settled=settled,
        progress=partial(progress, "rocks: settling the dynamic ones"),
    )
    fallen = unsupported(placed, library, land.ground)
    fallen &= placed.population < len(site.recipe.rocks.populations)  # listed ones stay
    missed = placed.select(fallen & owned(placed, ground, site.bounds))
    rocks = placed.select(~fallen)
    own = owned(rocks, ground, site.bounds)
    laid = None
    if land.banked:
        laid = land.banked.raised[window.nodes_in(land.around)], drifted_soil(site)
    appearance = paint(site, window, land.bare, laid=laid)
    progress("paths", 0.0)
    rover = rover_of(site)
    return World(
        site=site,
        window=window,
        ground=ground,
        appearance=appearance,
        library=library,
        field=rocks.select(own),
        neighbours=rocks.select(touches(rocks, ground, library) & ~own),
        trajectories=make_trajectories(site, window, ground, rocks, library, rover, planned),
        rover=rover,
        lighting=light_of(site),
        unplaced=scattered.unplaced,
        unsupported=missed if len(missed) else None,
        horizon=make_horizon(site, ground, appearance, library) if horizon else None,
    )


def make_ground(site: Site, window: Window) -> Heightfield:
    """The ground of a window of a site, with the soil at its rocks."""
    return _lay_land(site, window, Stopwatch(silent)).part(window)


class _Land(NamedTuple):
    """Ground, and rocks in plan, of a window and what lies around it."""

    around: Window
    library: RockLibrary
    bare: Heightfield
    scattered: Scattered
    banked: Banked | None
    """The ground with the soil at the rocks, where there is any."""

    @property
    def ground(self) -> Heightfield:
        return self.banked.ground if self.banked else self.bare

    def part(self, window: Window) -> Heightfield:
        """The ground of the window alone."""
        rows, columns = window.nodes_in(self.around)
        return self.ground.cut(
            column=columns.start, row=rows.start, columns=window.columns, rows=window.rows
        )


def _lay_land(site: Site, window: Window, progress: Stopwatch) -> _Land:
    site.require_window(window)
    recipe, rocks = site.recipe, site.recipe.rocks
    progress("rock library", 0.0)
    library = find_library(rocks.library, custom=site.meshes)
    progress("ground", 0.0)
    reach, margin = (
        bank_reach(site, library),
        rock_margin(site=site, populations=rocks.populations, lists=rocks.lists, library=library),
    )
    known = margin + (FILLED * site.spacing if reach else 0.0)
    stencil = stencil_reach(site, recipe.terrain.layers, recipe.terrain.materials)
    around = site.padded(window, max(known, stencil))
    bare = shape_ground(site=site, window=around, layers=recipe.terrain.layers)
    progress("rocks", 0.0)
    scattered = scatter(
        site=site,
        populations=rocks.populations,
        lists=rocks.lists,
        library=library,
        window=window,
        ground=bare,
        margin=margin + reach if reach else 0.0,
    )
    banked = bank_soil(site=site, scattered=scattered, library=library, ground=bare)
    return _Land(around, library, bare, scattered, banked)


def make_horizon(
    site: Site, ground: Heightfield, appearance: Appearance, library: RockLibrary
) -> Horizon | None:
    """What lies beyond the edge of a world; None where the recipe wants nothing.

    Args:
        site: The world's site.
        ground: The world's ground.
        appearance: The world's colours.
        library: The world's rock shapes.
    """
    return horizon_around(site, Border.of(ground, appearance), library)


def horizon_around(site: Site, border: Border, library: RockLibrary) -> Horizon | None:
    """As `make_horizon`, of a world whose ground along its border is known."""
    recipe, appearance = site.recipe, border.looks[0]
    spec, populations = recipe.horizon, recipe.rocks.populations
    if spec.reach_m == 0.0:
        return None
    land = shape_horizon(
        site=site,
        border=border,
        layers=recipe.terrain.layers,
        reach=spec.reach_m,
    )
    width = min(spec.rocks_m, 0.9 * land.reach)
    if not populations or not library.prototypes or not width:
        return land
    rocks = rocks_beyond(
        site=site,
        populations=populations,
        library=library,
        bounds=border.bounds,
        width=width,
        reach=land.reach,
        height_at=partial(heights_beyond, border, land),
    )
    normals = vertex_normals(rocks.mesh.vertices, rocks.mesh.faces)
    bare = linear_from_srgb(appearance.rock_rgb / 255.0)[:, None, :]
    soil = soil_of(site, appearance)
    colours = tints_of(bare, soil)
    albedo = colours[rocks.population, (rocks.draw * colours.shape[1]).astype(np.int64)]
    dust = dust_on(normals[:, 2:], airless=site.body.airless)
    mixed = albedo + dust * (soil - albedo)
    rgb = np.round(255.0 * np.clip(srgb_from_linear(mixed), 0.0, 1.0))
    first = np.int32(len(land.mesh.vertices))
    mesh = Mesh(
        vertices=np.concatenate([land.mesh.vertices, rocks.mesh.vertices]),
        faces=np.concatenate([land.mesh.faces, rocks.mesh.faces + first]),
    )
    return land.replace(
        mesh=mesh,
        normals=np.concatenate([land.normals, normals]),
        rgb=np.concatenate([land.rgb, rgb]),
        rocks=rocks.number,
        told=f"{land.told}; {rocks.number} rocks within {width:g} m",
    )
