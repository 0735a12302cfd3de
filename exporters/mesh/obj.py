"""OBJ: named objects with normals, the ground with its texture; materials beside it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import BinaryIO

import numpy as np

from terrain_forge.base import image_rows, srgb_from_linear
from terrain_forge.geometry import (
    bake_ground,
    finest_texture,
    grid_normals,
    grid_texture_coordinates,
    grid_vertices,
    mean_rock_colour,
    rock_texture,
)
from terrain_forge.model import World, rotations
from terrain_forge.writers import (
    Floats,
    Indices,
    MattMaterial,
    index_corners,
    vertex_normals,
    write_mtl,
    write_obj_faces,
    write_obj_grid_faces,
    write_obj_rows,
    write_png,
)

from .options import Options
from .part import Part, node_bands

MATERIALS = "world.mtl"


def write_obj_part(part: Part, directory: Path, *, options: Options) -> MattMaterial:
    """Write a part as OBJ, with the ground's texture.

    Args:
        part: What to write.
        directory: The folder.
        options: The export's options.

    Returns:
        The material of the part's ground, for `write_materials`.
    """
    ground = f"ground{part.name.removeprefix('world').removeprefix('tile')}"
    # Beside each other: kernels, compression and files leave Python's lock to the other thread.
    with ThreadPoolExecutor(1) as pool:
        texture = pool.submit(_write_texture, part, directory / f"{ground}.png", options)
        with (directory / f"{part.name}.obj").open("wb") as file:
            file.write(f"# terrain-forge: metres, z up\nmtllib {MATERIALS}\n".encode())
            body = _Body(file)
            _write_ground(body, part, ground)
            if options.rocks == "objects":
                _write_single_rocks(body, part.world)
            elif options.rocks == "merged":
                _write_merged_rocks(body, part)
        texture.result()
    return MattMaterial(name=ground, texture=f"{ground}.png")


def _write_texture(part: Part, path: Path, options: Options) -> None:
    finer = finest_texture(part.whole.ground, options.texture_pixels)
    write_png(path, image_rows(bake_ground(part.world, finer=finer).rgb))


def write_materials(
    world: World, directory: Path, *, grounds: list[MattMaterial], textured: bool
) -> None:
    """Write world.mtl: the grounds' materials, and those of the rocks with their textures."""
    materials = list(grounds)
    for number in range(len(world.field.populations)):
        if textured:
            image = f"rock_{number}.png"
            write_png(directory / image, rock_texture(world, number))
            materials.append(MattMaterial(name=f"rock_{number}", texture=image))
        else:
            rgb = srgb_from_linear(mean_rock_colour(world, number))
            materials.append(MattMaterial(name=f"rock_{number}", rgb=rgb.tolist()))
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

    def add_grid_faces(self, rows: int, columns: int) -> None:
        """Add the faces of the ground, which is the first object of the file."""
        write_obj_grid_faces(self._file, rows, columns)

    def end(self, vertices: int, coordinates: int = 0) -> None:
        """From here on indices count beyond so many vertices and texture coordinates more."""
        self._vertices += vertices
        self._coordinates += coordinates


def _write_ground(body: _Body, part: Part, name: str) -> None:
    ground, (rows, columns) = part.ground, part.ground.shape
    body.begin(name)
    for _, band in node_bands(ground):
        body.add(b"v", grid_vertices(band))
    for _, band in node_bands(ground):
        body.add(b"vn", grid_normals(band, part.whole.ground))
    for span, band in node_bands(ground):
        coordinates = grid_texture_coordinates(*band.shape)
        coordinates[:, 1] = (span.start + coordinates[:, 1] * band.shape[0]) / rows
        body.add(b"vt", coordinates)
    body.use(name)
    body.add_grid_faces(rows, columns)
    body.end(rows * columns, rows * columns)


def _write_merged_rocks(body: _Body, part: Part) -> None:
    if len(part.world.field):
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
        body.begin(f"rock_{field.id[row]}")
        body.add(b"v", field.scale[row] * mesh.vertices @ turns[row].T + field.position[row])
        body.add(b"vn", normals(prototype) @ turns[row].T)
        body.add(b"vt", rows)
        body.use(f"rock_{field.population[row]}")
        body.add_faces(mesh.faces, corners)
        body.end(len(mesh.vertices), len(rows))
