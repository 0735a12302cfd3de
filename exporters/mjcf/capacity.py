"""How many rocks MuJoCo can hold: what is refused, and what to choose in its place."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from terrain_forge.base import ExportError
from terrain_forge.model import World

from .options import Options
from .rocks import has_own_shape

MOST_GEOMS = 250_000
"""Geoms that an export may have: MuJoCo steps 100,000 some 300 times a second."""
MOST_MESHES = 50_000
"""Meshes that an export may have."""
SECONDS_PER_MESH, BYTES_PER_MESH = 0.6e-3, 0.17e6
"""What MuJoCo takes to load a mesh of its own (measured with 5000 and 15000 of them, one core)."""

_FEWER = (
    "choose a smaller size_m, a larger smallest diameter_m, or the format usd, which merges small "
    "rocks"
)


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse, before the world is made, more rocks than MuJoCo steps at any useful rate.

    Raises:
        ExportError: if there are.
    """
    del nodes  # a ground of any size becomes several height fields
    if rocks > MOST_GEOMS:
        raise ExportError(
            f"some {rocks:,.0f} rocks make at least as many geoms, MuJoCo steps {MOST_GEOMS:,} at "
            f"most: {_FEWER}"
        )
    if options.exact_scale and rocks > MOST_MESHES:
        raise _too_many_meshes(rocks)


def require_counts(world: World, options: Options) -> None:
    """Refuse a world of more geoms or meshes than MuJoCo holds.

    Raises:
        ExportError: if it has more.
    """
    hulls, drawn = count_geoms(world, options)
    if hulls + drawn > MOST_GEOMS:
        advice = _FEWER
        if sum(count_geoms(world, replace(options, visual_min_m=sys.float_info.max))) <= MOST_GEOMS:
            advice = f"choose a larger visual_min_m, here {options.visual_min_m:g}"
        raise ExportError(
            f"{len(world.field):,} rocks make {hulls:,} geoms to touch and {drawn:,} to look at, "
            f"MuJoCo steps {MOST_GEOMS:,} at most: {advice}"
        )
    if options.exact_scale and hulls + drawn > MOST_MESHES:
        raise _too_many_meshes(hulls + drawn)


def count_geoms(world: World, options: Options) -> tuple[int, int]:
    """Geoms of the rocks' convex parts, and those of their shapes."""
    field = world.field
    parts = np.array([len(shape.hulls) for shape in world.library.prototypes], np.int64)
    own_shape = has_own_shape(field, options)
    by_hulls = field.collides | ~own_shape
    return int(parts[field.prototype[by_hulls]].sum()), int(own_shape.sum())


def _too_many_meshes(count: float) -> ExportError:
    seconds, size = count * SECONDS_PER_MESH, count * BYTES_PER_MESH / 1e9
    return ExportError(
        f"exact_scale: true makes some {count:,.0f} meshes, which MuJoCo would load in about "
        f"{seconds:.0f} s and {size:.0f} GB, at most {MOST_MESHES:,}: leave it out, which rounds "
        "sizes by 1 % at most"
    )
