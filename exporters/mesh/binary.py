"""Binary STL, the triangles alone, and binary PLY: vertices with a colour each, and triangles."""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.geometry import cell_bands, grid_faces, grid_vertices, mean_rock_srgb, node_bands
from terrain_forge.writers import Floats, Indices, write_stl_faces, write_stl_header

from .part import Part

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


def write_stl_part(part: Part, path: Path, *, rocks: bool) -> None:
    """Write a part, with its rocks or without."""
    count = 0
    with path.open("wb") as file:
        write_stl_header(file, 0)
        for _, band in cell_bands(part.tile.ground):
            faces = grid_faces(*band.shape)
            write_stl_faces(file, grid_vertices(band), faces)
            count += len(faces)
        for _, vertices, faces in part.merged_rocks() if rocks else ():
            write_stl_faces(file, vertices, faces)
            count += len(faces)
        file.seek(0)
        write_stl_header(file, count)


def write_ply_part(part: Part, path: Path, *, rocks: bool) -> None:
    """Write a part, with its rocks or without.

    The format wants all vertices before the first face, so the faces wait in a file of their own.
    """
    with path.open("wb") as file, TemporaryFile(dir=path.parent) as faces:
        file.write(_header(0, 0))
        vertex_count, face_count = _write_ground(part, file, faces)
        for population, vertices, corners in part.merged_rocks() if rocks else ():
            rgb = np.rint(255 * np.array(mean_rock_srgb(part.tile.whole, population)))
            _write_vertices(file, vertices, rgb)
            _write_faces(faces, corners + np.int32(vertex_count))
            vertex_count += len(vertices)
            face_count += len(corners)
        faces.seek(0)
        shutil.copyfileobj(faces, file, 1 << 20)
        file.seek(0)
        file.write(_header(vertex_count, face_count))


def _write_ground(part: Part, file: BinaryIO, faces: BinaryIO) -> tuple[int, int]:
    """Write the ground; returns how many vertices and faces it has."""
    ground, (rows, columns) = part.tile.ground, part.tile.ground.shape
    for span, band in node_bands(ground):
        rgb = part.tile.world.appearance.ground_rgb[span].reshape(-1, 3)
        _write_vertices(file, grid_vertices(band), rgb)
    for span, band in cell_bands(ground):
        _write_faces(faces, grid_faces(*band.shape) + np.int32(span.start * columns))
    return rows * columns, 2 * (rows - 1) * (columns - 1)


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
