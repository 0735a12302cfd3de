"""OBJ: named objects with normals, the ground with its texture; materials beside it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import BinaryIO

import numpy as np

from terrain_forge.base import image_rows, portable
from terrain_forge.geometry import bake_tile, mean_rock_srgb, rock_texture, write_ground_obj
from terrain_forge.model import World, rotations
from terrain_forge.writers import (
    Floats,
    Indices,
    MattMaterial,
    index_corners,
    rock_name,
    vertex_normals,
    write_mtl,
    write_obj_faces,
    write_obj_rows,
    write_png,
)

from .options import Options
from .part import Part

MATERIALS = "world.mtl"


def write_obj_part(part: Part, directory: Path, *, options: Options) -> MattMaterial:
    """Write a part as OBJ, with the ground's texture; returns the ground's material."""
    ground = f"ground{part.name.removeprefix('world').removeprefix('tile')}"
    # Beside each other: kernels, compression and files leave Python's lock to the other thread.
    with ThreadPoolExecutor(1) as pool:
        texture = pool.submit(_write_texture, part, directory / f"{ground}.png", options)
        with (directory / f"{part.name}.obj").open("wb") as file:
            file.write(f"# terrain-forge: metres, z up\nmtllib {MATERIALS}\n".encode())
            body = _Body(file)
            body.begin(ground)
            write_ground_obj(file, part.tile, material=ground)
            body.end(part.tile.ground.elevation.size, part.tile.ground.elevation.size)
            if options.rocks == "objects":
                _write_single_rocks(body, part.tile.world)
            elif options.rocks == "merged":
                _write_merged_rocks(body, part)
        texture.result()
    return MattMaterial(name=ground, texture=f"{ground}.png")


def _write_texture(part: Part, path: Path, options: Options) -> None:
    write_png(path, image_rows(bake_tile(part.tile, options.texture_pixels).rgb))


def write_materials(
    world: World, directory: Path, *, grounds: list[MattMaterial], textured: bool
) -> None:
    """Write world.mtl: the grounds' materials, and those of the rocks with their textures."""
    materials = list(grounds)
    for number in range(len(world.field.populations)):
        name, image = f"rock_{number}", f"rock_{number}.png"
        if textured:
            write_png(directory / image, rock_texture(world, number))
            materials.append(MattMaterial(name=name, texture=image))
        else:
            materials.append(MattMaterial(name=name, rgb=mean_rock_srgb(world, number)))
    write_mtl(directory / MATERIALS, materials)


class _Body:
    """The lines of an OBJ and how many vertices and texture coordinates stand there already."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._vertices = 0
        self._coordinates = 0

    def begin(self, name: str) -> None:
        """Begin an object."""
        self._file.write(f"o {name}\n".encode())

    def use(self, material: str) -> None:
        """Give the faces that follow a material."""
        self._file.write(f"usemtl {material}\n".encode())

    def add(self, tag: bytes, rows: Floats) -> None:
        """Add lines of numbers."""
        write_obj_rows(self._file, tag, rows)

    def add_faces(self, faces: Indices, texture_faces: Indices | None = None) -> None:
        """Add faces, whose indices count from the last `end`."""
        textures = None if texture_faces is None else texture_faces + np.int32(self._coordinates)
        write_obj_faces(self._file, faces + np.int32(self._vertices), texture_faces=textures)

    def end(self, vertices: int, coordinates: int = 0) -> None:
        """From here on indices count beyond so many vertices and texture coordinates more."""
        self._vertices += vertices
        self._coordinates += coordinates


def _write_merged_rocks(body: _Body, part: Part) -> None:
    if len(part.tile.field):
        body.begin("rocks")
    for population, vertices, faces in part.merged_rocks():
        body.add(b"v", vertices)
        body.add(b"vn", vertex_normals(vertices, faces))
        body.use(f"rock_{population}")
        body.add_faces(faces)
        body.end(len(vertices))


def _write_single_rocks(body: _Body, world: World) -> None:
    """Each rock as an object; rocks of a shape share its texture coordinates."""
    field, shapes = world.field, world.library.prototypes
    meshes = [shape.meshes[0] for shape in shapes]
    normals = cache(lambda shape: vertex_normals(meshes[shape].vertices, meshes[shape].faces))
    coordinates = cache(lambda shape: index_corners(shapes[shape].uvs[0]))
    turns = rotations(field)
    for row, prototype in enumerate(field.prototype.tolist()):
        mesh = meshes[prototype]
        rows, corners = coordinates(prototype)
        body.begin(rock_name(field.id[row]))
        body.add(
            b"v",
            portable.product(field.scale[row] * mesh.vertices, turns[row].T) + field.position[row],
        )
        body.add(b"vn", portable.product(normals(prototype), turns[row].T))
        body.add(b"vt", rows)
        body.use(f"rock_{field.population[row]}")
        body.add_faces(mesh.faces, corners)
        body.end(len(mesh.vertices), len(rows))
