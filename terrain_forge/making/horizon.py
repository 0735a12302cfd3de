"""What lies beyond a world's edge: ground out to the horizon, and rocks on its first metres."""

from __future__ import annotations

from functools import partial

import numpy as np

from terrain_forge.base import linear_from_srgb, srgb_from_linear
from terrain_forge.model import Appearance, Heightfield, Horizon, Mesh, RockLibrary, Site
from terrain_forge.rocks import rocks_beyond
from terrain_forge.scene import dust_on, soil_of, tints_of
from terrain_forge.terrain import Border, heights_beyond, shape_horizon
from terrain_forge.writers import vertex_normals


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
