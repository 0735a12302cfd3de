"""The rocks: static ones in a static model per tile, dynamic ones as bodies; what they share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import rpy_from_quaternion
from terrain_forge.geometry import (
    grouped,
    inertias,
    mean_rock_srgb,
    merge_rocks,
    rock_texture,
    write_rock_shape,
)
from terrain_forge.model import Mesh, RockField, Tile, World, world_friction
from terrain_forge.rocks import dynamic_contact
from terrain_forge.writers import MattMaterial, rock_name, write_obj, write_png

from ..sdf.markup import Lines, element, numbers
from ..sdf.solids import inertial
from .geometry import MATERIALS, compliant, rigid, visual
from .options import Options


def is_single(field: RockField, options: Options) -> NDArray[np.bool_]:
    """Which rocks are geometries of their own: the large and the dynamic ones."""
    large: NDArray[np.bool_] = field.diameter >= options.individual_min_m
    return large | field.dynamic


def fixed_rocks(tile: Tile, folder: Path, *, coarse: list[Mesh], options: Options) -> list[Lines]:
    """Write the merged meshes of one tile; returns a static model of its static rocks, if any.

    Among the merged rocks a mesh of `coarse` stands for each prototype.
    """
    fixed = tile.field.select(~tile.field.dynamic)
    single = is_single(fixed, options)
    friction = world_friction(tile.whole.site.body, options).rock
    parts = [*_single_rocks(fixed.select(single), folder, friction)]
    small, name = fixed.select(~single), tile.name("rocks")
    for population, solid, rocks in grouped(small, small.collides):
        path = folder / f"{name}_{population}{'' if solid else '_seen'}.obj"
        parts += _merged_rocks(rocks, coarse, tile.whole, path, friction)
    if not parts:
        return []
    link = element("link", *parts, name="rocks")
    return [element("model", element("static", "true"), link, name=name)]


def dynamic_rocks(world: World, folder: Path, options: Options) -> Iterator[Lines]:
    """A free model `rock_<id>` for each dynamic rock, whose link's origin is its centre of mass."""
    field = world.field.select(world.field.dynamic)
    poses = np.hstack([field.position, rpy_from_quaternion(field.quaternion)])
    for row, tensor in enumerate(inertias(field, world.library)):
        link = element(
            "link",
            inertial(float(field.mass[row]), tensor),
            visual("visual", _shape_uri(field, row, folder), scale=float(field.scale[row])),
            *(_hulls(world, field, row, folder, options) if field.collides[row] else ()),
            name="rock",
        )
        pose = element("pose", numbers(poses[row]))
        yield element("model", pose, link, name=rock_name(field.id[row]))


def _hulls(
    world: World, field: RockField, row: int, folder: Path, options: Options
) -> Iterator[Lines]:
    prototype = int(field.prototype[row])
    for part in range(len(world.library.prototypes[prototype].hulls)):
        yield compliant(
            f"collision_{part}",
            f"{folder.name}/{_hull_file(prototype, part)}",
            dynamic_contact(float(field.diameter[row])).sliding,
            scale=float(field.scale[row]),
            modulus=options.dynamic_modulus_pa,
        )


def _single_rocks(rocks: RockField, folder: Path, friction: float) -> Iterator[Lines]:
    """A visual, and for what can be touched a collision, of each rock's finest mesh."""
    poses = np.hstack([rocks.position, rpy_from_quaternion(rocks.quaternion)])
    for row, identity in enumerate(rocks.id.tolist()):
        uri, scale = _shape_uri(rocks, row, folder), float(rocks.scale[row])
        pose = element("pose", numbers(poses[row]))
        name = rock_name(identity)
        yield visual(f"{name}_visual", uri, pose=pose, scale=scale)
        if rocks.collides[row]:
            yield rigid(f"{name}_collision", uri, friction, pose=pose, scale=scale)


def _merged_rocks(
    rocks: RockField, coarse: list[Mesh], whole: World, path: Path, friction: float
) -> Iterator[Lines]:
    """Write rocks of one population, all to be touched or none; yields what shows and stops."""
    vertices, faces = merge_rocks(rocks, coarse, whole.ground)
    if not len(faces):
        return
    material = MATERIALS, _plain_material(int(rocks.population[0]))
    write_obj(path, vertices=vertices, faces=faces, material=material)
    uri = f"{path.parent.name}/{path.name}"
    yield visual(f"{path.stem}_visual", uri)
    if rocks.collides[0]:
        yield rigid(f"{path.stem}_collision", uri, friction)


def _shape_uri(field: RockField, row: int, folder: Path) -> str:
    return f"{folder.name}/{_shape_file(int(field.prototype[row]), int(field.population[row]))}"


def write_shapes(world: World, rocks: RockField, folder: Path) -> None:
    """Write the meshes that these rocks share, and the hulls of the dynamic ones among them."""
    kinds = np.unique(np.stack([rocks.prototype, rocks.population], axis=-1), axis=0)
    for prototype, population in kinds.tolist():
        path = folder / _shape_file(prototype, population)
        material = MATERIALS, _textured_material(population)
        write_rock_shape(path, world.library.prototypes[prototype], material=material)
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
            yield MattMaterial(name=_textured_material(population), texture=image)
        rgb = mean_rock_srgb(world, population)
        yield MattMaterial(name=_plain_material(population), rgb=rgb)


def _shape_file(prototype: int, population: int) -> str:
    """File of a shape in the look of a population."""
    return f"shape_{prototype:03}_{population}.obj"


def _hull_file(prototype: int, part: int) -> str:
    return f"shape_{prototype:03}_hull_{part}.obj"


def _textured_material(population: int) -> str:
    """Material of a population's single rocks."""
    return f"rock_{population}"


def _plain_material(population: int) -> str:
    """Material of a population's merged rocks."""
    return f"rock_{population}_plain"
