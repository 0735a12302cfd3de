"""Rocks as triangles: levels of detail, textured shapes, and many rocks merged into one mesh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, fibonacci_sphere, inner, kernel, portable
from terrain_forge.geometry.rock_materials import skin, vertex_colours
from terrain_forge.model import (
    Heightfield,
    Mesh,
    RockField,
    RockLibrary,
    RockPrototype,
    TexturedMesh,
    World,
    rotations,
)
from terrain_forge.scene import rock_tints
from terrain_forge.writers import Gltf, index_corners, vertex_normals, write_obj

# A face goes only where it is this fraction of the rock's diameter under the ground.
_BURIED_MARGIN = 0.05
# Rocks that become one mesh; a renderer culls such meshes, an engine finds its way in each.
PART = 8192


def outline_error(mesh: Mesh, reference: Mesh) -> float:
    """How far the outline of a mesh, seen from any side, is off the reference's [m].

    The largest difference of the two support functions over directions spread evenly on the sphere;
    so it covers the top and every silhouette, and says nothing of dents.
    """
    directions = fibonacci_sphere(256)
    support = (portable.product(mesh.vertices, directions.T)).max(axis=0)
    wanted = (portable.product(reference.vertices, directions.T)).max(axis=0)
    return float(np.abs(support - wanted).max())


def largest_outline_error(coarse: Sequence[Mesh], shapes: Sequence[RockPrototype]) -> float:
    """The largest `outline_error` of meshes that stand for rock shapes [mean axes]."""
    return max(outline_error(c, s.meshes[0]) for c, s in zip(coarse, shapes, strict=True))


def coarse_shape(prototype: RockPrototype, tolerance: float) -> Mesh:
    """The shape of fewest faces whose outline is the finest mesh's within `tolerance` [mean axes].

    Chosen from the levels of detail and, where one hull stands for the whole rock, that hull; the
    finest mesh itself where nothing else is so close.
    """
    finest, coarser = prototype.meshes[0], prototype.meshes[1:]
    hull = prototype.hulls if len(prototype.hulls) == 1 else ()
    candidates: list[Mesh] = sorted([*coarser, *hull], key=lambda mesh: len(mesh.faces))
    fitting = (mesh for mesh in candidates if outline_error(mesh, finest) <= tolerance)
    return next(fitting, finest)


def merge_rocks(
    field: RockField, shapes: Sequence[Mesh], ground: Heightfield
) -> tuple[Array, NDArray[np.int32]]:
    """The rocks' surfaces as one mesh, without the faces that lie wholly under the ground.

    Args:
        field: The rocks.
        shapes: The mesh that stands for each prototype, in the prototype's frame.
        ground: The ground; what lies beside it counts as bare.

    Returns:
        Vertices in the world frame [m], shape [vertices, 3], and corner indices, shape [faces, 3].
    """
    vertices, faces, _ = _merged(field, shapes, ground)
    return vertices, faces


def _merged(
    field: RockField, shapes: Sequence[Mesh], ground: Heightfield
) -> tuple[Array, NDArray[np.int32], NDArray[np.int64]]:
    """As `merge_rocks`, and how many vertices each rock has, shape [rocks]."""
    points, first_point = _joined([shape.vertices for shape in shapes])
    corners, first_face = _joined([shape.faces for shape in shapes])
    turn_and_scale = rotations(field) * field.scale[:, None, None]
    vertices = np.empty((np.diff(first_point)[field.prototype].sum(), 3))
    faces = np.empty((np.diff(first_face)[field.prototype].sum(), 3), dtype=np.int32)
    ends = np.empty(len(field), np.int64)
    used_vertices, used_faces = _merge(
        vertices,
        faces,
        ends,
        (points, first_point, corners, first_face),
        (field.prototype, field.position, turn_and_scale, _BURIED_MARGIN * field.diameter),
        (ground.elevation, ground.origin[0], ground.origin[1], ground.spacing),
    )
    return vertices[:used_vertices], faces[:used_faces], np.diff(ends, prepend=0)


def merge_in_parts(
    field: RockField, shapes: Sequence[Mesh], ground: Heightfield
) -> Iterator[tuple[Array, NDArray[np.int32]]]:
    """`merge_rocks` of so many rocks at a time that memory does not grow with their number.

    Parts without a face above the ground are left out.
    """
    for rows in _parts(field):
        vertices, faces = merge_rocks(field.select(rows), shapes, ground)
        if len(faces):
            yield vertices, faces


def coloured_parts(
    rocks: RockField, shapes: Sequence[Mesh], world: World
) -> Iterator[tuple[Array, Array, NDArray[np.int32], NDArray[np.uint8]]]:
    """`merge_in_parts` of rocks of one population, with normals and each rock's own colour.

    Returns:
        Vertices [m], normals, faces, and what of `lightest_rock_colour` each vertex has, as
        `vertex_colours`.
    """
    for rows in _parts(rocks):
        some = rocks.select(rows)
        vertices, faces, counts = _merged(some, shapes, world.ground)
        if len(faces):
            normals = vertex_normals(vertices, faces)
            tints = np.repeat(rock_tints(some.id, world.site.seed), counts)
            colours = vertex_colours(world, int(some.population[0]), tints, normals[:, 2])
            yield vertices, normals, faces, colours


def write_rocks_glb(
    path: Path, field: RockField, shapes: Sequence[Mesh], ground: Heightfield
) -> None:
    """Write `merge_rocks` as GLB: the mesh alone, z up, in pieces of indices of 16 bits."""
    counts = np.array([len(shape.vertices) for shape in shapes])[field.prototype]
    piece = np.cumsum(counts) // (2**16 - 1 - counts.max(initial=0))
    with TemporaryFile(dir=path.parent) as binary:
        gltf, primitives = Gltf(binary), []
        for number in np.unique(piece):
            vertices, faces = merge_rocks(field.select(piece == number), shapes, ground)
            if len(faces):
                normals = vertex_normals(vertices, faces)
                indices = gltf.add_indices(faces)
                primitives.append(gltf.add_primitive(vertices, normals, indices))
        gltf.write_mesh(path, primitives)


def level_of_detail(prototype: RockPrototype, tolerance: float) -> int:
    """The coarsest level whose outline is off by no more than `tolerance` [mean axes].

    The finest level is the shape itself, so there always is one.
    """
    errors = prototype.outline_errors
    return max(level for level, error in enumerate(errors) if level == 0 or error <= tolerance)


def rocks_box(rocks: RockField, library: RockLibrary) -> tuple[Array, Array]:
    """Lowest and highest corner of a box that holds rocks, however they are turned [m]."""
    shapes = library.prototypes
    meshes = [(one.meshes[0], one.close) if one.close else one.meshes[:1] for one in shapes]
    radii = np.array([max(portable.norm(mesh.vertices).max() for mesh in some) for some in meshes])
    reach = (radii[rocks.prototype] * rocks.scale)[:, None]
    return (rocks.position - reach).min(axis=0), (rocks.position + reach).max(axis=0)


def surface(prototype: RockPrototype, level: int = 0, *, upright: bool = True) -> TexturedMesh:
    """`skin` for formats that know one index per corner: cut open along seams.

    Normals are those of the closed mesh, so that no seam shows in the shading.
    """
    mesh, uvs = skin(prototype, level, upright=upright)
    corners = mesh.faces.reshape(-1, 1).astype(np.float64)
    rows = np.hstack([corners, uvs.reshape(-1, 2)])
    distinct, index = np.unique(rows, axis=0, return_inverse=True)
    vertex = distinct[:, 0].astype(np.int64)
    return TexturedMesh(
        vertices=mesh.vertices[vertex],
        normals=vertex_normals(mesh.vertices, mesh.faces)[vertex],
        texture_coordinates=distinct[:, 1:],
        faces=index.reshape(-1, 3).astype(np.int32),
    )


def write_rock_shape(
    path: Path,
    shape: RockPrototype,
    level: int = 0,
    *,
    upright: bool = True,
    material: tuple[str, str] | None = None,
) -> None:
    """Write `skin` as OBJ."""
    mesh, uvs = skin(shape, level, upright=upright)
    coordinates, corners = index_corners(uvs)
    write_obj(
        path,
        vertices=mesh.vertices,
        faces=mesh.faces,
        texture_coordinates=coordinates,
        texture_faces=corners,
        material=material,
    )


def grouped(field: RockField, *keys: NDArray[Any]) -> Iterator[tuple[Any, ...]]:
    """The rocks by population and further keys, a value per rock: `(population, *keys, rocks)`."""
    table = np.stack([field.population, *keys], axis=-1)
    for group in np.unique(table, axis=0).tolist():
        yield *group, field.select((table == group).all(axis=1))


def _parts(field: RockField) -> Iterator[NDArray[np.int64]]:
    """Rows of the rocks of each part."""
    for first in range(0, len(field), PART):
        yield np.arange(first, min(first + PART, len(field)))


def _joined(arrays: Sequence[NDArray[np.generic]]) -> tuple[NDArray[np.generic], NDArray[np.int64]]:
    """Arrays one after the other, and where each begins (one more entry: the end)."""
    return np.concatenate(arrays), np.cumsum([0, *map(len, arrays)])


@inner
def _depth(ground, x, y, z):  # type: ignore[no-untyped-def]
    """Depth [m] of a point under the triangulated ground; negative above it or beside the grid."""
    elevation, west, south, spacing = ground
    column, row = (x - west) / spacing, (y - south) / spacing
    rows, columns = elevation.shape
    if column < 0 or row < 0 or column > columns - 1 or row > rows - 1:
        return -1e30
    i, j = min(int(column), columns - 2), min(int(row), rows - 2)
    u, v = column - i, row - j
    southwest, northeast = elevation[j, i], elevation[j + 1, i + 1]
    if u >= v:
        southeast = elevation[j, i + 1]
        height = southwest + u * (southeast - southwest) + v * (northeast - southeast)
    else:
        northwest = elevation[j + 1, i]
        height = southwest + v * (northwest - southwest) + u * (northeast - northwest)
    return height - z


@kernel
def _merge(vertices, faces, ends, shapes, rocks, ground):  # type: ignore[no-untyped-def]
    points, first_point, corners, first_face = shapes
    prototypes, positions, matrices, margins = rocks
    largest = 0
    for shape in range(len(first_point) - 1):
        largest = max(largest, first_point[shape + 1] - first_point[shape])
    placed = np.empty((largest, 3))
    deep = np.empty(largest, dtype=np.bool_)
    index = np.empty(largest, dtype=np.int32)
    vertex_count, face_count = 0, 0
    for rock in range(len(prototypes)):
        shape = prototypes[rock]
        start, matrix = first_point[shape], matrices[rock]
        for n in range(first_point[shape + 1] - start):
            x, y, z = points[start + n, 0], points[start + n, 1], points[start + n, 2]
            for axis in range(3):
                turned = matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z
                placed[n, axis] = positions[rock, axis] + turned
            deep[n] = _depth(ground, placed[n, 0], placed[n, 1], placed[n, 2]) > margins[rock]
            index[n] = -1
        for face in range(first_face[shape], first_face[shape + 1]):
            if deep[corners[face, 0]] and deep[corners[face, 1]] and deep[corners[face, 2]]:
                continue
            for place in range(3):
                n = corners[face, place]
                if index[n] < 0:
                    index[n] = vertex_count
                    for axis in range(3):
                        vertices[vertex_count, axis] = placed[n, axis]
                    vertex_count += 1
                faces[face_count, place] = index[n]
            face_count += 1
        ends[rock] = vertex_count
    return vertex_count, face_count
