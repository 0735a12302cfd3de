"""The rocks: static ones in a static model per tile, dynamic ones as bodies; what they share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, rpy_from_quaternion
from terrain_forge.geometry import (
    grouped,
    inertias,
    lie_upright,
    mean_rock_srgb,
    merge_rocks,
    rock_texture,
    write_rock_shape,
)
from terrain_forge.model import Mesh, RockField, Tile, World, world_friction
from terrain_forge.rocks import dynamic_contact
from terrain_forge.writers import (
    Lines,
    MattMaterial,
    element,
    leaves,
    rock_name,
    write_obj,
    write_png,
)

from ..sdf.model import inertial
from ..sdf.rocks import is_single
from .options import Options

MATERIALS = "world.mtl"
"""The material file beside the meshes."""
DISSIPATION = 500.0
"""Hunt and Crossley's dissipation of dynamic rocks [s/m]: Drake knows no rolling friction, and with
its own 50 they rock from face to face for seconds."""


def visual(name: str, uri: str, *, pose: Array | None = None, scale: float = 1.0) -> Lines:
    """A visual of an OBJ with its own material, which Drake takes for pictures and for Meshcat."""
    return element("visual", *_solid(pose, uri, scale), name=name)


def collision(
    name: str,
    uri: str,
    friction: float,
    *,
    pose: Array | None = None,
    scale: float = 1.0,
    modulus: float | None = None,
) -> Lines:
    """A collision that is the mesh itself, dents and all, for bodies with hydroelastic contact.

    In point contact Drake takes any mesh for its convex hull. With a hydroelastic `modulus` [Pa] it
    is a convex mesh that gives way.
    """
    hints, contact = [], [element("drake:rigid_hydroelastic")]
    if modulus is not None:
        hints = [element("drake:declare_convex")]
        soft = element("drake:compliant_hydroelastic")
        damping = element("drake:hunt_crossley_dissipation", DISSIPATION)
        contact = [soft, element("drake:hydroelastic_modulus", modulus), damping]
    surface = leaves(**{"drake:mu_dynamic": friction, "drake:mu_static": friction})
    properties = element("drake:proximity_properties", *contact, *surface)
    return element("collision", *_solid(pose, uri, scale, *hints), properties, name=name)


def _solid(pose: Array | None, uri: str, scale: float, *hints: Lines) -> list[Lines]:
    """The pose, if there is one, and the geometry of a mesh file."""
    place = [] if pose is None else [element("pose", pose)]
    size = [element("scale", (scale,) * 3)] if scale != 1.0 else []
    return [*place, element("geometry", element("mesh", *leaves(uri=uri), *size, *hints))]


def fixed_rocks(tile: Tile, folder: Path, *, coarse: list[Mesh], options: Options) -> list[Lines]:
    """Write the merged meshes of one tile; returns a static model of its static rocks, if any.

    Among the merged rocks a mesh of `coarse` stands for each prototype.
    """
    fixed = tile.field.select(~tile.field.dynamic)
    single = is_single(fixed, options.individual_min_m)
    friction = world_friction(tile.whole.site.body, options).rock
    large, small, name = fixed.select(single), fixed.select(~single), tile.name("rocks")
    parts = []
    poses = np.hstack([large.position, rpy_from_quaternion(large.quaternion)])
    uris = _shape_uris(large, folder)
    for row, rock in enumerate(map(rock_name, large.id.tolist())):
        uri, scale = uris[row], float(large.scale[row])
        # The finest mesh, and a collision of it for what can be touched.
        parts.append(visual(f"{rock}_visual", uri, pose=poses[row], scale=scale))
        if large.collides[row]:
            touch = collision(f"{rock}_collision", uri, friction, pose=poses[row], scale=scale)
            parts.append(touch)
    for population, solid, rocks in grouped(small, small.collides):
        vertices, faces = merge_rocks(rocks, coarse, tile.whole.ground)
        if not len(faces):
            continue
        part = f"{name}_{population}{'' if solid else '_seen'}"
        uri, material = f"{folder.name}/{part}.obj", (MATERIALS, f"rock_{population}_plain")
        write_obj(folder / f"{part}.obj", vertices=vertices, faces=faces, material=material)
        parts.append(visual(f"{part}_visual", uri))
        if solid:
            parts.append(collision(f"{part}_collision", uri, friction))
    if not parts:
        return []
    link = element("link", *parts, name="rocks")
    return [element("model", element("static", "true"), link, name=name)]


def dynamic_rocks(world: World, folder: Path, options: Options) -> Iterator[Lines]:
    """A free model `rock_<id>` for each dynamic rock, whose link's origin is its centre of mass."""
    field = world.field.select(world.field.dynamic)
    poses = np.hstack([field.position, rpy_from_quaternion(field.quaternion)])
    uris = _shape_uris(field, folder)
    for row, tensor in enumerate(inertias(field, world.library)):
        scale, prototype = float(field.scale[row]), int(field.prototype[row])
        sliding = dynamic_contact(float(field.diameter[row])).sliding
        hulls = world.library.prototypes[prototype].hulls if field.collides[row] else ()
        collisions = [
            collision(
                f"collision_{part}",
                f"{folder.name}/{_hull_file(prototype, part)}",
                sliding,
                scale=scale,
                modulus=options.dynamic_modulus_pa,
            )
            for part in range(len(hulls))
        ]
        look = visual("visual", uris[row], scale=scale)
        mass = inertial(float(field.mass[row]), tensor)
        link = element("link", mass, look, *collisions, name="rock")
        yield element("model", element("pose", poses[row]), link, name=rock_name(field.id[row]))


def _shape_uris(field: RockField, folder: Path) -> list[str]:
    kinds = np.stack([field.prototype, field.population, lie_upright(field)], axis=-1)
    return [f"{folder.name}/{_shape_file(*kind)}" for kind in kinds.tolist()]


def write_shapes(world: World, rocks: RockField, folder: Path) -> None:
    """Write the meshes that these rocks share, and the hulls of the dynamic ones among them."""
    kinds = np.stack([rocks.prototype, rocks.population, lie_upright(rocks)], axis=-1)
    for prototype, population, upright in np.unique(kinds, axis=0).tolist():
        path = folder / _shape_file(prototype, population, upright)
        material = MATERIALS, f"rock_{population}"
        shape = world.library.prototypes[prototype]
        write_rock_shape(path, shape, upright=bool(upright), material=material)
    for prototype in np.unique(rocks.prototype[rocks.dynamic]).tolist():
        for part, hull in enumerate(world.library.prototypes[prototype].hulls):
            path = folder / _hull_file(prototype, part)
            write_obj(path, vertices=hull.vertices, faces=hull.faces)


def write_materials(world: World, rocks: RockField, folder: Path) -> Iterator[MattMaterial]:
    """Write the textures of these rocks' populations; yields the materials of all populations."""
    for population in range(len(world.field.populations)):
        if np.any(rocks.population == population):
            image = f"rock_{population}.png"
            write_png(folder / image, rock_texture(world, population))
            yield MattMaterial(name=f"rock_{population}", texture=image)
        rgb = mean_rock_srgb(world, population)
        yield MattMaterial(name=f"rock_{population}_plain", rgb=rgb)


def _shape_file(prototype: int, population: int, upright: int) -> str:
    """File of a shape in the look of a population, with dust on its top or bare."""
    return f"shape_{prototype:03}_{population}{'' if upright else '_turned'}.obj"


def _hull_file(prototype: int, part: int) -> str:
    return f"shape_{prototype:03}_hull_{part}.obj"
