"""Triangle meshes as OBJ text and as binary STL, written at the speed of the disk.

OBJ carries normals and texture coordinates and shares vertices; STL is smaller than an OBJ with
normals and is read faster. Both hold plain coordinates: no hidden unit, axis swap or offset.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner, kernel
from terrain_forge.writers.digits import put_integer, put_number

Floats = NDArray[np.float64] | NDArray[np.float32]
Indices = NDArray[np.int32]

_DECIMALS = {b"v": 6, b"vn": 4, b"vt": 6}
# Sign, up to twelve digits before the point, the point, six after it, and a blank.
_WIDEST_NUMBER = 21
_LARGEST = 1e12
# Lines or faces written at once: the text then stays in the processor's cache.
_CHUNK = 8192
_STL_HEADER = b"binary STL by terrain-forge, metres, z up"


def write_obj(
    path: Path,
    *,
    vertices: Floats,
    faces: Indices,
    normals: Floats | None = None,
    texture_coordinates: Floats | None = None,
    texture_faces: Indices | None = None,
    material: tuple[str, str] | None = None,
) -> None:
    """Write a mesh with one normal per vertex as OBJ.

    Gazebo's physics drops the collision of an OBJ without normals, so there is none without.

    Args:
        path: The file.
        vertices: Positions [m], shape [vertices, 3]; written to a micrometre.
        faces: Corner indices, counter-clockwise from outside, shape [faces, 3].
        normals: Unit normals, shape [vertices, 3]; by default `vertex_normals`.
        texture_coordinates: u to the right, v upwards, an image being 1 wide and high, shape
            [coordinates, 2].
        texture_faces: Indices of the faces' corners into them, shape [faces, 3]; by default they
            are the vertices' own.
        material: Material file beside this one, and the name of the mesh's material in it.
    """
    with Path(path).open("wb") as file:
        if material:
            file.write("mtllib {}\nusemtl {}\n".format(*material).encode())
        write_obj_rows(file, b"v", vertices)
        write_obj_rows(file, b"vn", vertex_normals(vertices, faces) if normals is None else normals)
        if texture_coordinates is not None:
            write_obj_rows(file, b"vt", texture_coordinates)
            texture_faces = faces if texture_faces is None else texture_faces
        write_obj_faces(file, faces, texture_faces=texture_faces)


def write_obj_rows(file: BinaryIO, tag: bytes, values: Floats) -> None:
    """Write OBJ lines `tag x y …` (tag v, vn or vt) of rows of numbers, shape [rows, numbers].

    Raises:
        ValueError: if a number is not below 1e12, which no coordinate in metres is.
    """
    if not np.all(np.abs(values) < _LARGEST):
        raise ValueError(f"OBJ {tag.decode()}: a number is not finite or not below {_LARGEST:g}")
    room = _CHUNK * (len(tag) + 1 + values.shape[1] * _WIDEST_NUMBER)
    text = np.empty(room, dtype=np.uint8)
    sign = np.frombuffer(tag, np.uint8)
    for start in range(0, len(values), _CHUNK):
        some = np.array(values[start : start + _CHUNK], np.float64, order="C")
        used = _put_rows(text, sign, some, _DECIMALS[tag])
        file.write(text[:used].data)


def write_obj_faces(file: BinaryIO, faces: Indices, *, texture_faces: Indices | None) -> None:
    """Write OBJ lines `f a/t/a …`: position and normal share an index, the texture has its own."""
    textures = faces[:0] if texture_faces is None else texture_faces
    digits = len(str(max(int(faces.max(initial=0)), int(textures.max(initial=0))) + 1))
    text = np.empty(_CHUNK * (3 + 3 * (3 * digits + 3)), dtype=np.uint8)
    for start in range(0, len(faces), _CHUNK):
        part = slice(start, start + _CHUNK)
        some = np.array(faces[part], np.int32, order="C")
        texture = np.array(textures[part], np.int32, order="C")
        used = _put_faces(text, some, texture)
        file.write(text[:used].data)


def index_corners(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], Indices]:
    """Values of face corners, shape [faces, 3, n], as distinct rows and indices into them.

    Returns:
        Rows, shape [rows, n], and indices, shape [faces, 3].
    """
    rows, index = np.unique(values.reshape(-1, values.shape[2]), axis=0, return_inverse=True)
    return rows, index.reshape(-1, 3).astype(np.int32)


def write_stl(path: Path, *, vertices: Floats, faces: Indices) -> None:
    """Write a mesh as binary STL with the normals of its faces.

    Args:
        path: The file.
        vertices: Positions [m], shape [vertices, 3]; stored as float32.
        faces: Corner indices, counter-clockwise from outside, shape [faces, 3].
    """
    with Path(path).open("wb") as file:
        write_stl_header(file, len(faces))
        write_stl_faces(file, vertices, faces)


def write_stl_header(file: BinaryIO, count: int) -> None:
    """Write the first 84 bytes of a binary STL of so many faces."""
    file.write(_STL_HEADER.ljust(80))
    file.write(count.to_bytes(4, "little"))


def write_stl_faces(file: BinaryIO, vertices: Floats, faces: Indices) -> None:
    """Write faces of a binary STL; see `write_stl`."""
    # A record is 12 float32 and one uint16: as rows of 25 uint16 it needs no unaligned access.
    records = np.empty((_CHUNK, 25), dtype="<u2")
    points = np.array(vertices, np.float64, order="C")
    for start in range(0, len(faces), _CHUNK):
        some = np.array(faces[start : start + _CHUNK], np.int32, order="C")
        _fill_stl(records, points, some)
        file.write(records[: len(some)].data)


def vertex_normals(vertices: Floats, faces: Indices) -> NDArray[np.float64]:
    """Unit normals of the vertices of a mesh, the faces weighted by area, shape [vertices, 3]."""
    normals = np.zeros((len(vertices), 3))
    points = np.array(vertices, np.float64, order="C")
    _add_normals(normals, points, np.array(faces, np.int32, order="C"))
    return normals


@kernel
def _put_rows(text, tag, values, decimals):  # type: ignore[no-untyped-def]
    unit = 10**decimals
    at = 0
    for row in range(values.shape[0]):
        for place in range(len(tag)):
            text[at] = tag[place]
            at += 1
        for column in range(values.shape[1]):
            text[at] = 32
            at = put_number(text, at + 1, values[row, column], decimals, unit)
        text[at] = 10
        at += 1
    return at


@inner
def _repeat(text, at, start, width):  # type: ignore[no-untyped-def]
    """Write again what stands at `start`; returns where the text goes on."""
    for place in range(width):
        text[at + place] = text[start + place]
    return at + width


@kernel
def _put_faces(text, faces, texture_faces):  # type: ignore[no-untyped-def]
    textured = len(texture_faces) > 0
    at = 0
    for face in range(faces.shape[0]):
        text[at] = 102
        at += 1
        for corner in range(3):
            index = np.int64(faces[face, corner]) + 1
            text[at] = 32
            start = at + 1
            at = put_integer(text, start, index)
            width = at - start
            text[at] = 47
            at += 1
            if textured:
                at = put_integer(text, at, np.int64(texture_faces[face, corner]) + 1)
            text[at] = 47
            at = _repeat(text, at + 1, start, width)
        text[at] = 10
        at += 1
    return at


@kernel
def _fill_stl(records, vertices, faces):  # type: ignore[no-untyped-def]
    number = np.empty(12, dtype=np.float32)
    halves = number.view(np.uint16)
    for face in range(len(faces)):
        for corner in range(3):
            for axis in range(3):
                number[3 + 3 * corner + axis] = vertices[faces[face, corner], axis]
        ax, ay, az = number[6] - number[3], number[7] - number[4], number[8] - number[5]
        bx, by, bz = number[9] - number[3], number[10] - number[4], number[11] - number[5]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        scale = 1.0 / length if length > 0 else 0.0
        number[0], number[1], number[2] = nx * scale, ny * scale, nz * scale
        for half in range(24):
            records[face, half] = halves[half]
        records[face, 24] = 0


@kernel
def _add_normals(normals, vertices, faces):  # type: ignore[no-untyped-def]
    """Sum the faces' normals, of the length of their areas, at their corners; make them units."""
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        ux, uy, uz = (
            vertices[b, 0] - vertices[a, 0],
            vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2],
        )
        vx, vy, vz = (
            vertices[c, 0] - vertices[a, 0],
            vertices[c, 1] - vertices[a, 1],
            vertices[c, 2] - vertices[a, 2],
        )
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for corner in range(3):
            vertex = faces[face, corner]
            normals[vertex, 0] += nx
            normals[vertex, 1] += ny
            normals[vertex, 2] += nz
    for vertex in range(len(normals)):
        x, y, z = normals[vertex, 0], normals[vertex, 1], normals[vertex, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length > 0:
            normals[vertex, 0] = x / length
            normals[vertex, 1] = y / length
            normals[vertex, 2] = z / length
        else:
            normals[vertex, 2] = 1.0
