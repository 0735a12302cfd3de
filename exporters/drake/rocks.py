"""The rocks: static ones in a static model per tile, dynamic ones as bodies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import rpy_from_quaternion
from terrain_forge.geometry import inertias, merge_rocks
from terrain_forge.model import Mesh, RockField, World, world_friction
from terrain_forge.rocks import dynamic_contact
from terrain_forge.writers import vertex_normals, write_obj

from ..sdf.markup import Lines, element, numbers
from ..sdf.solids import inertial
from .geometry import MATERIALS, compliant, rigid, visual
from .options import Options
from .shapes import hull_file, plain_material, shape_file


def is_single(field: RockField, options: Options) -> NDArray[np.bool_]:
    """Which rocks are geometries of their own: the large and the dynamic ones."""
    large: NDArray[np.bool_] = field.diameter >= options.individual_min_m
    return large | field.dynamic


def fixed_rocks(
    tile: World, whole: World, folder: Path, *, number: int, coarse: list[Mesh], options: Options
) -> list[Lines]:
    """Write the merged meshes of one tile; returns a static model of its static rocks, if any.

    Args:
        tile: The tile.
        whole: The world that it is part of.
        folder: Where the meshes go.
        number: The tile's number.
        coarse: The mesh that stands for each prototype among the merged rocks.
        options: The export's options.
    """
    fixed = tile.field.select(~tile.field.dynamic)
    single = is_single(fixed, options)
    friction = world_friction(whole.site.body.name, options).rock
    parts = [*_single_rocks(fixed.select(single), folder, friction)]
    small = fixed.select(~single)
    groups = np.unique(np.stack([small.population, small.collides], axis=-1), axis=0)
    for population, solid in groups.tolist():
        rocks = small.select((small.population == population) & (small.collides == solid))
        path = folder / f"rocks_{number:03}_{population}{'' if solid else '_seen'}.obj"
        parts += _merged_rocks(rocks, coarse, whole, path, friction)
    if not parts:
        return []
    link = element("link", *parts, name="rocks")
    return [element("model", element("static", "true"), link, name=f"rocks_{number:03}")]


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
        yield element("model", pose, link, name=f"rock_{field.id[row]}")


def _hulls(
    world: World, field: RockField, row: int, folder: Path, options: Options
) -> Iterator[Lines]:
    prototype = int(field.prototype[row])
    for part in range(len(world.library.prototypes[prototype].hulls)):
        yield compliant(
            f"collision_{part}",
            f"{folder.name}/{hull_file(prototype, part)}",
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
        yield visual(f"rock_{identity}_visual", uri, pose=pose, scale=scale)
        if rocks.collides[row]:
            name = f"rock_{identity}_collision"
            yield rigid(name, uri, friction, pose=pose, scale=scale)


def _merged_rocks(
    rocks: RockField, coarse: list[Mesh], whole: World, path: Path, friction: float
) -> Iterator[Lines]:
    """Write rocks of one population, all to be touched or none; yields what shows and stops."""
    vertices, faces = merge_rocks(rocks, coarse, whole.ground)
    if not len(faces):
        return
    normals = vertex_normals(vertices, faces)
    material = MATERIALS, plain_material(int(rocks.population[0]))
    write_obj(path, vertices=vertices, faces=faces, normals=normals, material=material)
    uri = f"{path.parent.name}/{path.name}"
    yield visual(f"{path.stem}_visual", uri)
    if rocks.collides[0]:
        yield rigid(f"{path.stem}_collision", uri, friction)


def _shape_uri(field: RockField, row: int, folder: Path) -> str:
    return f"{folder.name}/{shape_file(int(field.prototype[row]), int(field.population[row]))}"
