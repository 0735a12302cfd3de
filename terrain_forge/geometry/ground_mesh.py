"""The ground's surface as a triangle mesh: the one triangulation that every format shares.

Vertices are the nodes, row by row from the south-west; a cell is cut from there to the north-east.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import kernel
from terrain_forge.model import Heightfield, Tile
from terrain_forge.writers import Gltf, write_obj_faces, write_obj_rows

BAND_NODES = 1 << 15
"""Nodes that are turned into vertices at once: they then stay in the processor's cache, and 16 bits
hold their indices."""


def grid_vertices(ground: Heightfield) -> NDArray[np.float64]:
    """The nodes of a grid as points [m], shape [rows * columns, 3]."""
    vertices = np.empty((*ground.shape, 3))
    vertices[..., 0] = ground.east
    vertices[..., 1] = ground.north[:, None]
    vertices[..., 2] = ground.elevation
    return vertices.reshape(-1, 3)


def grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """Two triangles per cell, counter-clockwise from above, shape [2 * cells, 3]."""
    southwest = np.arange((rows - 1) * columns, dtype=np.int32).reshape(rows - 1, columns)[:, :-1]
    southeast, northwest = southwest + 1, southwest + columns
    northeast = northwest + 1
    corners = (southwest, southeast, northeast, southwest, northeast, northwest)
    return np.stack(corners, axis=-1).reshape(-1, 3)


def grid_texture_coordinates(
    rows: int, columns: int, band: slice = slice(None)
) -> NDArray[np.float64]:
    """Where each node, or those of a band of rows, lies in an image with one pixel per node.

    u runs east, v north, 0 to 1 over the image; a node sits in the middle of its pixel. Shape
    [nodes, 2].
    """
    north = ((np.arange(rows) + 0.5) / rows)[band]
    coordinates = np.empty((len(north), columns, 2))
    coordinates[..., 0] = (np.arange(columns) + 0.5) / columns
    coordinates[..., 1] = north[:, None]
    return coordinates.reshape(-1, 2)


def node_bands(ground: Heightfield) -> Iterator[tuple[slice, Heightfield]]:
    """The rows of nodes in bands that share none of them, from the south."""
    rows, columns = ground.shape
    step = max(1, BAND_NODES // columns)
    for first in range(0, rows, step):
        band = slice(first, min(first + step, rows))
        origin = (ground.origin[0], ground.origin[1] + first * ground.spacing)
        yield band, ground.replace(elevation=ground.elevation[band], origin=origin)


def cell_bands(ground: Heightfield) -> Iterator[tuple[slice, Heightfield]]:
    """The rows of cells in bands that share their border nodes, from the south."""
    rows, columns = ground.shape
    step = max(1, BAND_NODES // columns)
    for first in range(0, rows - 1, step):
        last = min(first + step, rows - 1)
        cut = ground.cut(column=0, row=first, columns=columns - 1, rows=last - first)
        yield slice(first, last), cut


def write_ground_obj(
    file: BinaryIO, tile: Tile, *, material: str = "", cells: NDArray[np.bool_] | None = None
) -> None:
    """Write a tile's ground, or some of its cells, into an OBJ, as the first that has vertices."""
    ground, (rows, columns) = tile.ground, tile.ground.shape
    kept = np.ones(ground.shape, np.bool_) if cells is None else _corners(cells)
    for span, band in node_bands(ground):
        write_obj_rows(file, b"v", grid_vertices(band)[kept[span].ravel()])
    for span, band in node_bands(ground):
        write_obj_rows(file, b"vn", grid_normals(band, tile.whole.ground)[kept[span].ravel()])
    for span, _ in node_bands(ground):
        places = grid_texture_coordinates(rows, columns, span)
        write_obj_rows(file, b"vt", places[kept[span].ravel()])
    if material:
        file.write(f"usemtl {material}\n".encode())
    number = np.cumsum(kept, dtype=np.int32) - np.int32(1)
    for span, band in cell_bands(ground):
        faces = grid_faces(*band.shape) + np.int32(span.start * columns)
        if cells is not None:
            faces = number[faces[np.repeat(cells[span].ravel(), 2)]]
        write_obj_faces(file, faces, texture_faces=faces)


def write_ground_glb(path: Path, tile: Tile, *, cells: NDArray[np.bool_] | None = None) -> None:
    """Write a tile's ground, or some of its cells, as GLB.

    It is the mesh alone, z up as no glTF of its own would be.
    """
    (rows, columns) = tile.ground.shape
    with TemporaryFile(dir=path.parent) as binary:
        gltf = Gltf(binary)
        shared = cache(lambda shape: gltf.add_indices(grid_faces(*shape)))
        parts = []
        for span, band in cell_bands(tile.ground):
            points, normals = grid_vertices(band), grid_normals(band, tile.whole.ground)
            places = grid_texture_coordinates(rows, columns, slice(span.start, span.stop + 1))
            if cells is None:
                parts.append(gltf.add_primitive(points, normals, shared(band.shape), places))
                continue
            faces = grid_faces(*band.shape)[np.repeat(cells[span].ravel(), 2)]
            if len(faces):
                used, corners = np.unique(faces, return_inverse=True)
                indices = gltf.add_indices(corners.reshape(-1, 3).astype(np.int32))
                parts.append(gltf.add_primitive(points[used], normals[used], indices, places[used]))
        gltf.write_mesh(path, parts)


def _corners(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The nodes at the corners of some cells."""
    wide = np.pad(cells, 1)
    return np.asarray(wide[:-1, :-1] | wide[:-1, 1:] | wide[1:, :-1] | wide[1:, 1:])


def grid_normals(part: Heightfield, whole: Heightfield) -> NDArray[np.float32]:
    """Unit normals at the nodes of a part of a grid, from central differences of the whole grid.

    Taken from the whole, so that neighbouring parts shade alike along their common border.

    Returns:
        Normals, float32, shape [rows * columns, 3].
    """
    column = round((part.origin[0] - whole.origin[0]) / whole.spacing)
    row = round((part.origin[1] - whole.origin[1]) / whole.spacing)
    normals = np.empty((*part.shape, 3), dtype=np.float32)
    _fill_normals(normals, whole.elevation, column, row, whole.spacing)
    return normals.reshape(-1, 3)


@kernel
def _fill_normals(normals, elevation, column, row, spacing):  # type: ignore[no-untyped-def]
    last_row, last_column = elevation.shape[0] - 1, elevation.shape[1] - 1
    for j in range(normals.shape[0]):
        south, north = max(row + j - 1, 0), min(row + j + 1, last_row)
        for i in range(normals.shape[1]):
            west, east = max(column + i - 1, 0), min(column + i + 1, last_column)
            rise_east = np.float64(elevation[row + j, east]) - elevation[row + j, west]
            rise_north = np.float64(elevation[north, column + i]) - elevation[south, column + i]
            x = -rise_east / ((east - west) * spacing)
            y = -rise_north / ((north - south) * spacing)
            scale = 1.0 / np.sqrt(x * x + y * y + 1.0)
            normals[j, i, 0] = x * scale
            normals[j, i, 1] = y * scale
            normals[j, i, 2] = scale
