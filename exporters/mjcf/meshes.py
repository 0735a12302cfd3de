"""The mesh files that rocks share: convex parts to touch, textured shapes to look at."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from terrain_forge.model import RockLibrary, RockPrototype
from terrain_forge.writers import index_corners, vertex_normals, write_obj, write_stl

from .rocks import hull_file, shape_file

_LEVEL = 1
"""Level of detail that is drawn; MuJoCo holds a copy for each size."""


def drawn_level(shape: RockPrototype) -> int:
    """The level of detail by which a shape is drawn."""
    return min(_LEVEL, len(shape.meshes) - 1)


def write_hulls(library: RockLibrary, directory: Path) -> list[str]:
    """Write the convex parts of all prototypes; returns the files."""
    files = []
    for prototype, shape in enumerate(library.prototypes):
        for part, hull in enumerate(shape.hulls):
            files.append(hull_file(prototype, part))
            write_stl(directory / files[-1], vertices=hull.vertices, faces=hull.faces)
    return files


def write_shapes(library: RockLibrary, prototypes: Iterable[int], directory: Path) -> list[str]:
    """Write the textured shapes of some prototypes; returns the files."""
    files = []
    for prototype in prototypes:
        shape = library.prototypes[prototype]
        level = drawn_level(shape)
        mesh = shape.meshes[level]
        coordinates, texture_faces = index_corners(shape.uvs[level])
        files.append(shape_file(prototype))
        write_obj(
            directory / files[-1],
            vertices=mesh.vertices,
            faces=mesh.faces,
            normals=vertex_normals(mesh.vertices, mesh.faces),
            texture_coordinates=coordinates,
            texture_faces=texture_faces,
        )
    return files
