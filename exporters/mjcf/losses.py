"""What MJCF, or this export of it, does not say of a world."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import ExportError
from terrain_forge.geometry import (
    collision_losses,
    static_losses,
    texture_loss,
    touched_shapes,
)
from terrain_forge.model import World

from .blocks import CELLS, wide_rocks
from .capacity import FEWER, MANY_MESHES, MOST_GEOMS, loading_cost, require_meshes
from .options import Options
from .rocks import SCALE_ERROR, drawn_level, has_own_shape
from .rover import rig_losses

_WHEEL_CELLS = 10
"""A wheel so many cells wide makes 43 of the 50 contacts that MuJoCo keeps of it."""
SECONDS_PER_DYNAMIC = 25e-6
"""What a dynamic rock that lies on the ground takes of each step [s], with 5 contacts as they have
on average: 5.5 ms for 221 of them (MuJoCo 3.17, one core)."""


def require_counts(world: World, options: Options) -> None:
    """Refuse a world of more geoms or meshes than MuJoCo holds.

    Raises:
        ExportError: if it has more.
    """
    hulls, drawn = count_geoms(world, options)
    if hulls + drawn > MOST_GEOMS:
        raise ExportError(
            f"{len(world.field):,} rocks make {hulls:,} geoms to touch and {drawn:,} to look at, "
            f"MuJoCo steps {MOST_GEOMS:,} at most: choose a larger visual_min_m, here "
            f"{options.visual_min_m:g}, or {FEWER}"
        )
    require_meshes(options, hulls + drawn)


def count_geoms(world: World, options: Options) -> tuple[int, int]:
    """Geoms of the rocks' convex parts, and those of their shapes."""
    field = world.field
    parts = np.array([len(shape.hulls) for shape in world.library.prototypes], np.int64)
    own_shape = has_own_shape(field, options)
    by_hulls = field.collides | ~own_shape
    return int(parts[field.prototype[by_hulls]].sum()), int(own_shape.sum())


def list_losses(world: World, options: Options) -> tuple[str, ...]:
    """A sentence for each loss, with its size where there is one."""
    return (
        *_rock_losses(world, options),
        *static_losses(world.field),
        *collision_losses(touched_shapes(world)),
        *_map_losses(world, options),
        *_contact_losses(world, options),
        texture_loss(world.ground, options.texture_pixels, normals=False),
        *world.rover.losses,
        "The Sun is a light without size or irradiance in physical units.",
        *rig_losses(world.rover),
    )


def _map_losses(world: World, options: Options) -> list[str]:
    if world.library.normals is None or not has_own_shape(world.field, options).any():
        return []
    return [
        "MuJoCo's own renderer shows the maps of normals and roughness of rocks with shapes of "
        "their own in no picture; others that read the materials' layers do."
    ]


def _rock_losses(world: World, options: Options) -> list[str]:
    field, shapes = world.field, world.library.prototypes
    rounded = int((~field.dynamic).sum()) if not options.exact_scale else 0
    by_hull = int((~has_own_shape(field, options)).sum())
    losses = []
    if rounded:
        losses.append(
            f"The sizes of {rounded} static rocks are rounded by at most {SCALE_ERROR:.0%}; "
            "`exact_scale: true` keeps them."
        )
    meshes = sum(count_geoms(world, options)) if options.exact_scale else 0
    if meshes > MANY_MESHES:
        losses.append(
            f"`exact_scale: true` makes {meshes} meshes: MuJoCo takes about "
            f"{loading_cost(meshes)} to load them."
        )
    if by_hull:
        losses.append(f"{by_hull} rocks are drawn by their convex collision hulls, in one colour.")
    if by_hull < len(field):
        error = max(shape.outline_errors[drawn_level(shape)] for shape in shapes)
        losses.append(
            f"{len(field) - by_hull} rocks are drawn by a coarser mesh, its outline off by up to "
            f"{100 * error:.1f} % of their size."
        )
    return losses


def _contact_losses(world: World, options: Options) -> list[str]:
    """Where MuJoCo drops contacts: it keeps 50 of a pair of geoms."""
    losses = []
    spacing = world.ground.spacing
    wide, dynamic = len(wide_rocks(world.field, spacing)), int(world.field.dynamic.sum())
    if wide and options.split_ground:
        losses.append(
            f"{wide} dynamic rocks are wider than {CELLS} cells; the ground is cut into small "
            "height fields where they lie, not where they may be pushed."
        )
    elif wide:
        losses.append(
            f"{wide} dynamic rocks are wider than {CELLS} cells: MuJoCo may drop contacts of those "
            "that lie flat, which then tip over; `split_ground: true` keeps them."
        )
    busy = SECONDS_PER_DYNAMIC * dynamic
    if busy > options.timestep_s and not options.sleep:
        losses.append(
            f"{dynamic} dynamic rocks take about {1000 * busy:.1f} ms of each step of "
            f"{1000 * options.timestep_s:g} ms, slower than real time; with `sleep: true` those "
            "that lie still cost nothing in versions of MuJoCo that know it."
        )
    if any(wheel.width > _WHEEL_CELLS * spacing for wheel in world.rover.wheels):
        losses.append(
            f"Wheels are wider than {_WHEEL_CELLS} cells of {spacing:g} m: MuJoCo may drop some of "
            "their contacts."
        )
    return losses
