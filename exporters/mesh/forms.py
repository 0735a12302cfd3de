"""The files of a part of the world: OBJ with materials, binary STL, binary PLY.

An OBJ has named objects with normals, and the ground's texture; an STL the triangles alone; a PLY
vertices with a colour each, and triangles.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import image_rows, portable, srgb_from_linear, worker_threads
from terrain_forge.geometry import (
    bake_tile,
    cell_bands,
    coloured_parts,
    grid_faces,
    grid_vertices,
    grouped,
    lie_upright,
    lightest_rock_colour,
    mean_rock_srgb,
    merge_in_parts,
    node_bands,
    rock_factors,
    rock_maps,
    rock_texture,
    skin,
    write_ground_obj,
)
from terrain_forge.model import Mesh, RockField, Tile, World, rotations
from terrain_forge.scene import rock_tints
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
    write_stl_faces,
    write_stl_header,
    write_texture,
)

from .options import Options

MATERIALS = "world.mtl"
_VERTEX = np.dtype([("position", "<f4", 3), ("rgb", "u1", 3)])
_FACE = np.dtype([("corners", "u1"), ("index", "<i4", 3)])
_HEADER = """ply
format binary_little_endian 1.0
comment terrain-forge: metres, z up{padding}
element vertex {vertices}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face {faces}
property list uchar int vertex_indices
end_header
"""


@dataclass(frozen=True, kw_only=True)
class Part:
    """The part of a world that one file holds."""

    name: str
    """Name of the file, without its ending."""
    tile: Tile
    """That part."""
    options: Options
    """The export's."""
    detail: list[int]
    """Level of detail of each prototype where merged rocks are smaller than `finest_min_m`."""

    def merged_rocks(self) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.int32]]]:
        """The rocks' meshes, tile by tile: population, vertices [m] and faces."""
        for population, rocks, shapes in self.rocks():
            for vertices, faces in merge_in_parts(rocks, shapes, self.tile.whole.ground):
                yield population, vertices, faces

    def rocks(self) -> Iterator[tuple[int, RockField, list[Mesh]]]:
        """The rocks, tile by tile: population, rocks, and the mesh that stands for each shape."""
        if self.options.rocks == "none":
            return
        prototypes = self.tile.whole.library.prototypes
        finest = [shape.meshes[0] for shape in prototypes]
        coarse = [shape.meshes[n] for shape, n in zip(prototypes, self.detail, strict=True)]
        for tile in self.tile.world.tiles(cells=self.options.tile_cells):
            large = tile.field.diameter >= self.options.finest_min_m
            for population, fine, rocks in grouped(tile.field, large):
                yield population, rocks, finest if fine else coarse


def write_obj_part(part: Part, path: Path) -> MattMaterial:
    """Write a part as OBJ, with the ground's texture; returns the ground's material."""
    name = f"ground{part.name.removeprefix('world').removeprefix('tile')}"
    image, nodes = f"{name}.png", part.tile.ground.elevation.size

    def write_texture() -> None:
        picture = bake_tile(part.tile, part.options.texture_pixels).rgb
        write_png(path.with_name(image), image_rows(picture))

    # Beside each other: kernels, compression and files leave Python's lock to the other thread.
    with worker_threads(1) as pool:
        texture = pool.submit(write_texture)
        with path.open("wb") as file:
            head = f"# terrain-forge: metres, z up\nmtllib {MATERIALS}\no {name}\n"
            file.write(head.encode())
            write_ground_obj(file, part.tile, material=name)
            body = _Body(file, nodes)
            if part.options.rocks == "objects":
                _write_single_rocks(body, part.tile.world)
            elif part.options.rocks == "merged" and len(part.tile.field):
                body.begin("rocks")
                for population, vertices, faces in part.merged_rocks():
                    normals = vertex_normals(vertices, faces)
                    body.add(vertices, normals, faces, f"rock_{population}")
        texture.result()
    return MattMaterial(name=name, texture=image)


def write_materials(
    world: World, directory: Path, *, grounds: list[MattMaterial], textured: bool
) -> None:
    """Write world.mtl: the grounds' materials, and those of the rocks with their textures."""
    materials = list(grounds)
    for number in range(len(world.field.populations)):
        name, image = f"rock_{number}", f"rock_{number}.png"
        if textured:
            write_texture(directory / image, rock_texture(world, number, tinted=True))
            materials += [
                MattMaterial(
                    name=f"{name}_{tint}",
                    rgb=srgb_from_linear(factor).tolist(),
                    texture=image,
                    **_maps(world),
                )
                for tint, factor in enumerate(rock_factors(world, number))
            ]
        else:
            materials.append(MattMaterial(name=name, rgb=mean_rock_srgb(world, number)))
    if textured and (maps := rock_maps(world)):
        for file, image in zip(_maps(world).values(), maps, strict=True):
            write_texture(directory / file, image)
    write_mtl(directory / MATERIALS, materials)


def _maps(world: World) -> dict[str, str]:
    """Files of the maps that all rocks share, by the fields of their materials."""
    if rock_maps(world) is None:
        return {}
    return {"normals": "rock_normals.png", "roughness": "rock_roughness.png"}


class _Body:
    """The lines of an OBJ after those of the ground's nodes, and how many vertices stand there."""

    def __init__(self, file: BinaryIO, nodes: int) -> None:
        self._file = file
        self._vertices = self._coordinates = nodes

    def begin(self, name: str) -> None:
        """Begin an object."""
        self._file.write(f"o {name}\n".encode())

    def add(
        self,
        vertices: Floats,
        normals: Floats,
        faces: Indices,
        material: str,
        textured: tuple[Floats, Indices] | None = None,
    ) -> None:
        """Add a mesh, textured by coordinates and its corners' indices into them."""
        write_obj_rows(self._file, b"v", vertices)
        write_obj_rows(self._file, b"vn", normals)
        corners = None
        if textured:
            write_obj_rows(self._file, b"vt", textured[0])
            corners = textured[1] + np.int32(self._coordinates)
            self._coordinates += len(textured[0])
        self._file.write(f"usemtl {material}\n".encode())
        write_obj_faces(self._file, faces + np.int32(self._vertices), texture_faces=corners)
        self._vertices += len(vertices)


def _write_single_rocks(body: _Body, world: World) -> None:
    """Each rock as an object; rocks of a shape share its texture coordinates."""
    field, shapes = world.field, world.library.prototypes
    meshes = [shape.meshes[0] for shape in shapes]
    normals = cache(lambda shape: vertex_normals(meshes[shape].vertices, meshes[shape].faces))
    coordinates = cache(
        lambda shape, upright: index_corners(skin(shapes[shape], upright=upright)[1])
    )
    turns, tints = rotations(field), rock_tints(field.id, world.site.seed)
    upright = lie_upright(field).tolist()
    for row, prototype in enumerate(field.prototype.tolist()):
        mesh, turn = meshes[prototype], turns[row].T
        body.begin(rock_name(field.id[row]))
        body.add(
            portable.product(field.scale[row] * mesh.vertices, turn) + field.position[row],
            portable.product(normals(prototype), turn),
            mesh.faces,
            f"rock_{field.population[row]}_{tints[row]}",
            coordinates(prototype, upright[row]),
        )


def write_stl_part(part: Part, path: Path) -> None:
    """Write a part as STL."""
    count = 0
    with path.open("wb") as file:
        write_stl_header(file, 0)
        for _, band in cell_bands(part.tile.ground):
            faces = grid_faces(*band.shape)
            write_stl_faces(file, grid_vertices(band), faces)
            count += len(faces)
        for _, vertices, faces in part.merged_rocks():
            write_stl_faces(file, vertices, faces)
            count += len(faces)
        file.seek(0)
        write_stl_header(file, count)


def write_ply_part(part: Part, path: Path) -> None:
    """Write a part as PLY.

    The format wants all vertices before the first face, so the faces wait in a file of their own.
    """
    ground, (rows, columns) = part.tile.ground, part.tile.ground.shape
    vertex_count, face_count = rows * columns, 2 * (rows - 1) * (columns - 1)
    with path.open("wb") as file, TemporaryFile(dir=path.parent) as faces:
        file.write(_header(0, 0))
        for span, band in node_bands(ground):
            rgb = part.tile.world.appearance.ground_rgb[span].reshape(-1, 3)
            _write_vertices(file, grid_vertices(band), rgb)
        for span, band in cell_bands(ground):
            _write_faces(faces, grid_faces(*band.shape) + np.int32(span.start * columns))
        for population, rocks, shapes in part.rocks():
            lightest = lightest_rock_colour(part.tile.whole, population)
            for vertices, _, corners, colours in coloured_parts(rocks, shapes, part.tile.whole):
                shown = srgb_from_linear(lightest * colours[:, :3] / 255.0)
                _write_vertices(file, vertices, np.rint(255.0 * shown))
                _write_faces(faces, corners + np.int32(vertex_count))
                vertex_count += len(vertices)
                face_count += len(corners)
        faces.seek(0)
        shutil.copyfileobj(faces, file, 1 << 20)
        file.seek(0)
        file.write(_header(vertex_count, face_count))


def _write_vertices(file: BinaryIO, vertices: Floats, rgb: ArrayLike) -> None:
    records: NDArray[np.void] = np.empty(len(vertices), _VERTEX)
    records["position"] = vertices
    records["rgb"] = rgb
    file.write(records.data)


def _write_faces(file: BinaryIO, faces: Indices) -> None:
    records: NDArray[np.void] = np.empty(len(faces), _FACE)
    records["corners"] = 3
    records["index"] = faces
    file.write(records.data)


def _header(vertices: int, faces: int) -> bytes:
    """The header, as long for any counts: it is written before they are known."""
    padding = " " * (20 - len(f"{vertices}{faces}"))
    return _HEADER.format(vertices=vertices, faces=faces, padding=padding).encode()
