"""Laying scattered rocks on the ground: static ones are embedded, dynamic ones settle on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from terrain_forge.model import Heightfield, RockField, RockLibrary, Site
from terrain_forge.rocks.embedding.embed import embed
from terrain_forge.rocks.scattering.scatter import Scattered
from terrain_forge.rocks.settling import settle


def lay_rocks(
    scattered: Scattered,
    *,
    site: Site,
    library: RockLibrary,
    ground: Heightfield,
    progress: Callable[[float], None] | None = None,
) -> RockField:
    """The scattered rocks where they come to lie.

    Args:
        scattered: rocks with their places on the plane.
        site: the place.
        library: their shapes.
        ground: the bare ground under all of them.
        progress: called with the share of the dynamic ones that are settled, 0 to 1.
    """
    groups = site.recipe.rocks.groups
    density = np.array([group.density_kg_m3 or site.body.rock_density for group in groups])
    laid = embed(scattered=scattered, library=library, ground=ground, density=density)
    return settle(
        rocks=laid,
        library=library,
        ground=ground,
        gravity=site.body.gravity,
        progress=progress,
    )
