"""The files that rocks share: a mesh per shape and population, hulls of dynamic ones, materials."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from terrain_forge.base import srgb_from_linear
from terrain_forge.geometry import mean_rock_colour, rock_texture
from terrain_forge.model import RockField, RockPrototype, World
from terrain_forge.writers import MattMaterial, index_corners, vertex_normals, write_obj, write_png

from .geometry import MATERIALS


def write_shapes(world: World, rocks: RockField, folder: Path) -> None:
    """Write the meshes that these rocks share, and the hulls of the dynamic ones among them."""
    kinds = np.unique(np.stack([rocks.prototype, rocks.population], axis=-1), axis=0)
    for prototype, population in kinds.tolist():
        shape = world.library.prototypes[prototype]
        _write_shape(shape, folder / shape_file(prototype, population), population)
    for prototype in np.unique(rocks.prototype[rocks.dynamic]).tolist():
        for part, hull in enumerate(world.library.prototypes[prototype].hulls):
            normals = vertex_normals(hull.vertices, hull.faces)
            path = folder / hull_file(prototype, part)
            write_obj(path, vertices=hull.vertices, faces=hull.faces, normals=normals)


def write_materials(world: World, rocks: RockField, folder: Path) -> Iterator[MattMaterial]:
    """Write the textures of these rocks' populations; yields the materials of all populations."""
    for population in range(len(world.field.populations)):
        if np.any(rocks.population == population):
            image = f"rock_{population}.png"
            write_png(folder / image, rock_texture(world, population))
            yield MattMaterial(name=textured_material(population), texture=image)
        rgb = srgb_from_linear(mean_rock_colour(world, population))
        yield MattMaterial(name=plain_material(population), rgb=rgb.tolist())


def shape_file(prototype: int, population: int) -> str:
    """File of a shape in the look of a population."""
    return f"shape_{prototype:03}_{population}.obj"


def hull_file(prototype: int, part: int) -> str:
    """File of a convex part of a shape."""
    return f"shape_{prototype:03}_hull_{part}.obj"


def textured_material(population: int) -> str:
    """Material of a population's single rocks."""
    return f"rock_{population}"


def plain_material(population: int) -> str:
    """Material of a population's merged rocks."""
    return f"rock_{population}_plain"


def _write_shape(shape: RockPrototype, path: Path, population: int) -> None:
    mesh = shape.meshes[0]
    coordinates, corners = index_corners(shape.uvs[0])
    write_obj(
        path,
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=vertex_normals(mesh.vertices, mesh.faces),
        texture_coordinates=coordinates,
        texture_faces=corners,
        material=(MATERIALS, textured_material(population)),
    )
