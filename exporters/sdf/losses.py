"""What SDF, or this export of it, does not say of a world."""

from __future__ import annotations

from terrain_forge.exporters.sdf import rocks

from terrain_forge.geometry import (
    collision_losses,
    largest_outline_error,
    static_losses,
    texture_loss,
)
from terrain_forge.model import Mesh, World

from .heightmap import Heightmap, heightmap_losses
from .load import loading_losses, stepping_losses
from .options import Options
from .scenery import knows_surface
from .sensors import rig_losses


def list_losses(
    world: World, *, coarse: list[Mesh], heightmap: Heightmap | None, version: str, options: Options
) -> tuple[str, ...]:
    """A sentence for each loss, with its size where there is one.

    The heightmap is the ground's collision, unless that is a mesh; among the merged rocks a mesh of
    `coarse` stands for each prototype.
    """
    normals = options.flavour == "gz" and options.normal_maps
    losses = [
        *static_losses(world.field),
        "SDF lights have no radiometric unit: the Sun shines with 1, its "
        f"{world.lighting.irradiance:.0f} W/m² and its angular size are lost.",
        "Gazebo takes the smaller friction of two things that touch: a wheel keeps its own where "
        "the surface grips better.",
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
    if world.site.georeferenced and not knows_surface(world.site, version):
        losses.append(
            f"SDF {version} knows no surface but the Earth's: longitude and latitude are left out."
        )
    losses += _actor_losses(world, options)
    losses += _merged_losses(world, coarse, options)
    losses += loading_losses(world, options)
    losses += stepping_losses(world)
    return (*losses, *collision_losses(world.library.prototypes))


def _actor_losses(world: World, options: Options) -> list[str]:
    if not world.trajectories:
        return []
    losses = ["Actors replay the path without colliding."]
    if options.version == "1.9":
        losses.append(
            "Early Gazebo Fortress leaves out the links of actors, so that neither the rover nor "
            "its sensors are there; gz-sim has them since its pull request 1947."
        )
    if not options.sensors:
        return [*losses, "Actors carry no sensors."]
    unmeasured = dict.fromkeys(s.actor_loss for s in world.rover.sensors if s.actor_loss)
    return [*losses, *unmeasured, *rig_losses(world.rover)]


def _merged_losses(world: World, coarse: list[Mesh], options: Options) -> list[str]:
    small = int((~rocks.is_single(world.field, options)).sum())
    if not small:
        return []
    error = largest_outline_error(coarse, world.library.prototypes)
    return [
        f"{small} rocks below {options.individual_min_m:g} m are merged per tile: no longer "
        f"separate, without texture, their outline off by up to {100 * error:.1f} % of their size."
    ]
