"""What several formats do not say of a world, a sentence each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from terrain_forge.geometry.ground_texture import finest_texture
from terrain_forge.model import (
    FrictionOptions,
    GroundDetail,
    Heightfield,
    RockField,
    RockPrototype,
    World,
    cells_by_friction,
    material_frictions,
)

PLACE_LOSS = "Longitude, latitude and the datum's height are left out."


def pebbles_loss(count: int, within: float) -> str:
    """What pebbles up to a distance [m] from paths are not."""
    if not count:
        return f"No pebble lies within {within:g} m of a path."
    return (
        f"{count} pebbles within {within:g} m of the paths are for pictures alone: nothing "
        "touches them, and truth does not count them."
    )


def detail_loss(detail: GroundDetail) -> str:
    """What a format leaves out of the detail tile that takes its normals alone."""
    return (
        f"The ground's normal map repeats every {detail.size:g} m and does not show the stones "
        "in the colours; the brightness that belongs to it is left out."
    )


def texture_loss(ground: Heightfield, largest: int, *, normals: bool) -> str:
    """What a picture of `largest` pixels a side leaves out of the ground's looks.

    Args:
        ground: The whole ground.
        largest: Pixels of its longer side.
        normals: Whether the format takes a normal map.
    """
    pixel = 1000.0 * ground.spacing / finest_texture(ground, largest)
    bumps = "" if normals else ", without a normal map"
    return (
        f"The ground's texture has pixels of {pixel:.3g} mm{bumps}; nothing touches the soil and "
        "stones in it."
    )


def friction_losses(world: World, options: FrictionOptions) -> tuple[str, ...]:
    """What a format loses that gives all of the ground one friction, as a sentence."""
    frictions = material_frictions(world, options)
    if not cells_by_friction(world, frictions):
        return ()
    told = ", ".join(
        f"{material.name} {friction:g}"
        for material, friction in zip(world.appearance.materials[1:], frictions[1:], strict=True)
    )
    return (
        f"The ground has one friction, {frictions[0]:g}; those of its materials ({told}) are left "
        "out.",
    )


def rock_look_losses(world: World) -> tuple[str, ...]:
    """What a format leaves out of rocks' looks that has neither maps nor tints of them."""
    if world.library.normals is None or not len(world.field):
        return ()
    return (
        "Rocks have no maps of normals and roughness, and those of a population are of one colour.",
    )


def touched_shapes(world: World) -> list[RockPrototype]:
    """The shapes of the rocks that can be touched."""
    used = np.unique(world.field.prototype[world.field.collides])
    return [world.library.prototypes[number] for number in used]


def collision_losses(shapes: Sequence[RockPrototype]) -> tuple[str, ...]:
    """What an export loses by colliding rocks of some shapes as their convex parts, a sentence."""
    excess = max((shape.hull_excess for shape in shapes), default=0.0)
    distance = max((shape.hull_distance for shape in shapes), default=0.0)
    if max(excess, distance) <= 0.0:
        return ()
    return (
        f"Rocks collide as convex parts, up to {100 * max(excess, 0.0):.1f} % larger than the rock "
        f"and off its surface by up to {100 * distance:.1f} % of its size.",
    )


def static_losses(field: RockField) -> tuple[str, ...]:
    """What an export loses by fixing rocks to the ground, as a sentence."""
    fixed = len(field) - int(field.dynamic.sum())
    return (f"{fixed} rocks are fixed: they have no mass.",) if fixed else ()
