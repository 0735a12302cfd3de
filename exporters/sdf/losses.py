"""What SDF, or this export of it, does not say of a world."""

from __future__ import annotations

import numpy as np
from terrain_forge.exporters.sdf import rocks

from terrain_forge.geometry import (
    collision_losses,
    friction_losses,
    largest_outline_error,
    static_losses,
    texture_loss,
    touched_shapes,
)
from terrain_forge.model import Mesh, World, simple_sensors

from .capacity import ADVICE, BODY_MB, BODY_MS, PART_MB, PART_MS, require_bearable
from .heightmap import Heightmap, heightmap_losses
from .options import Options
from .scenery import STEP, knows_surface
from .sensors import rig_losses

WORTH_SAYING_MB = 1024.0
"""From what on loading is a loss to be told [MB]."""
SECONDS_PER_DYNAMIC = 1e-4
"""What a dynamic rock that lies on the ground takes of each step [s]: 21 ms for 221 of them, in
Fortress' physics with DART on one core."""


def require_loadable(world: World, options: Options) -> None:
    """Refuse a world that libsdformat would fill the memory with.

    Raises:
        ExportError: if its rocks are too many elements; says what to choose instead.
    """
    require_bearable(_found(world, options), loading(world, options)[0])


def loading(world: World, options: Options) -> tuple[float, float]:
    """Memory [MB] and time [s] that libsdformat takes for the rocks that are not merged."""
    field, shapes = world.field, world.library.prototypes
    hulls = np.array([len(shape.hulls) for shape in shapes], np.int64)
    own = 1 + np.where(field.collides, hulls[field.prototype], 0)  # a visual, and collisions
    parts = int(own[rocks.is_single(field, options.individual_min_m)].sum())
    bodies = int(field.dynamic.sum())
    return PART_MB * parts + BODY_MB * bodies, (PART_MS * parts + BODY_MS * bodies) / 1000.0


def _found(world: World, options: Options) -> str:
    single, dynamic = (
        rocks.is_single(world.field, options.individual_min_m).sum(),
        world.field.dynamic.sum(),
    )
    return f"{single} rocks are elements of their own, {dynamic} of them dynamic"


def list_losses(
    world: World, *, coarse: list[Mesh], heightmap: Heightmap | None, options: Options
) -> tuple[str, ...]:
    """A sentence for each loss, with its size where there is one.

    The heightmap is the ground's collision, unless that is a mesh; among the merged rocks a mesh of
    `coarse` stands for each prototype.
    """
    normals = options.flavour == "gz" and options.normal_maps
    losses = [
        *static_losses(world.field),
        *(friction_losses(world, options) if heightmap else ()),
        "SDF lights have no radiometric unit: the Sun shines with 1, its "
        f"{world.lighting.irradiance:.0f} W/m² and its angular size are lost.",
        "Gazebo takes the smaller friction of two things that touch: a wheel keeps its own where "
        "the surface has more friction.",
        *(heightmap_losses(heightmap, world.ground) if heightmap else ()),
        texture_loss(world.ground, options.texture_pixels, normals=normals),
    ]
    if options.flavour == "classic":
        losses.append(
            "Gazebo Classic shows no normal maps: its shader for them asks for tangents, which its "
            "mesh loader does not make."
        )
    if world.field.dynamic.any():
        losses.append("Dynamic rocks have no rolling friction, which SDF does not know.")
    if world.site.georeferenced and not knows_surface(world.site, options.version):
        losses.append(
            f"SDF {options.version} knows no surface but the Earth's: longitude and latitude are "
            "left out."
        )
    if world.trajectories:
        losses += _actor_losses(world, options)
    losses += _rock_losses(world, coarse, options)
    return (*losses, *collision_losses(touched_shapes(world)))


def _actor_losses(world: World, options: Options) -> list[str]:
    losses = ["Actors replay the path without colliding."]
    if options.version == "1.9":
        losses.append(
            "Early Gazebo Fortress leaves out the links of actors, so that neither the rover nor "
            "its sensors are there; gz-sim has them since its pull request 1947."
        )
    if not options.sensors:
        return [*losses, "Actors carry no sensors."]
    unmeasured = dict.fromkeys(
        s.actor_loss for s in simple_sensors(world.rover.sensors) if s.actor_loss
    )
    return [*losses, *unmeasured, *rig_losses(world.rover)]


def _rock_losses(world: World, coarse: list[Mesh], options: Options) -> list[str]:
    losses = []
    small = int((~rocks.is_single(world.field, options.individual_min_m)).sum())
    if small:
        error = largest_outline_error(coarse, world.library.prototypes)
        losses.append(
            f"{small} rocks below {options.individual_min_m:g} m are merged per tile: no longer "
            "separate, without texture, their outline off by up to "
            f"{100 * error:.1f} % of their size."
        )
    megabytes, seconds = loading(world, options)
    if megabytes > WORTH_SAYING_MB:
        losses.append(
            f"{_found(world, options)}: Gazebo's parser takes some {megabytes / 1024:.1f} GB and "
            f"{seconds:.0f} s to load them; {ADVICE}"
        )
    dynamic = int(world.field.dynamic.sum())
    busy = SECONDS_PER_DYNAMIC * dynamic
    if busy > STEP:
        losses.append(
            f"{dynamic} dynamic rocks take DART about {1000 * busy:.0f} ms for each step of "
            f"{1000 * STEP:g} ms: slower than real time; make fewer rocks dynamic."
        )
    return losses
