"""Triangle meshes as OBJ text with materials and as binary STL, written at the speed of the disk.

OBJ carries normals and texture coordinates and shares vertices; STL is smaller than an OBJ with
normals and is read faster. Both hold plain coordinates: no hidden unit, axis swap or offset.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner, kernel

Floats = NDArray[np.float64] | NDArray[np.float32]
Indices = NDArray[np.int32]

_DECIMALS = {b"v": 6, b"vn": 4, b"vt": 6}
# Sign, up to twelve digits before the point, the point, six after it, and a blank.
_WIDEST_NUMBER = 21
_LARGEST = 1e12
# Lines or faces written at once: the text then stays in the processor's cache.
_CHUNK = 8192
_STL_HEADER = b"binary STL by terrain-forge, metres, z up"
_STL_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


@dataclass(frozen=True, kw_only=True)
class MattMaterial:
    """A matt material."""

    name: str
    """What `usemtl` calls it."""
    rgb: Sequence[float] = (1.0, 1.0, 1.0)
    """Colour as viewers show it (sRGB, 0 to 1), which multiplies the texture."""
    texture: str = ""
    """File of its texture beside the material file; empty for none."""
    normals: str = ""
    """File of its normal map; empty for none."""
    roughness: str = ""
    """File of its map of roughness; empty for none."""


def write_mtl(path: Path, materials: Iterable[MattMaterial]) -> None:
    """Write a material file, which OBJ files name in an `mtllib` line."""
    texts = []
    for material in materials:
        colour = " ".join(f"{channel:.6g}" for channel in material.rgb)
        texture = f"map_Kd {material.texture}\n" if material.texture else ""
        look = f"Ka 0 0 0\nKd {colour}\nKs 0 0 0\nillum 1\n{texture}"
        look += f"norm {material.normals}\n" if material.normals else ""
        look += f"map_Pr {material.roughness}\n" if material.roughness else ""
        texts.append(f"newmtl {material.name}\n{look}")
    path.write_text("\n".join(texts), encoding="utf-8", newline="\n")


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
    points = np.asarray(vertices, np.float32)
    for start in range(0, len(faces), _CHUNK):
        corners = points[faces[start : start + _CHUNK]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        x, y, z = normals.T
        length = np.sqrt(x * x + y * y + z * z).astype(np.float64)
        scale = np.divide(1.0, length, out=np.zeros(len(length)), where=length > 0)
        records: NDArray[np.void] = np.zeros(len(corners), _STL_FACE)
        records["normal"] = normals * scale[:, None]
        records["corners"] = corners
        file.write(records.data)


def vertex_normals(vertices: Floats, faces: Indices) -> NDArray[np.float64]:
    """Unit normals of the vertices of a mesh, the faces weighted by area, shape [vertices, 3]."""
    points, corner = np.asarray(vertices, np.float64), faces.reshape(-1)
    a, b, c = (points[faces[:, n]] for n in range(3))
    areas = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    x, y, z = (np.bincount(corner, axis, minlength=len(points)) for axis in areas.T)
    length = np.sqrt(x * x + y * y + z * z)
    normals = np.stack([x, y, np.where(length > 0, z, 1.0)], axis=-1)
    return normals / np.where(length > 0, length, 1.0)[:, None]


def vertex_tangents(
    vertices: Floats, normals: Floats, texture_coordinates: Floats, faces: Indices
) -> NDArray[np.float64]:
    """Where a picture's right is at the vertices of a mesh, as glTF's TANGENT, shape [vertices, 4].

    The last number is the side on which the picture's top lies: the cross product of normal and
    tangent, times that.

    Args:
        vertices: Places, shape [vertices, 3].
        normals: Unit normals there, shape [vertices, 3].
        texture_coordinates: u to the right, v upwards, shape [vertices, 2].
        faces: Corner indices, shape [faces, 3].
    """
    points: NDArray[np.float64] = np.asarray(vertices, np.float64)
    up: NDArray[np.float64] = np.asarray(normals, np.float64)
    uv: NDArray[np.float64] = np.asarray(texture_coordinates, np.float64)
    corner = faces.reshape(-1)
    a, b, c = (points[faces[:, n]] for n in range(3))
    (u, v), (s, w) = ((uv[faces[:, n]] - uv[faces[:, 0]]).T[:, :, None] for n in (1, 2))
    turn = np.sign(u * w - s * v)
    sums = list[NDArray[np.float64]]()
    for one in (turn * ((b - a) * w - (c - a) * v), turn * ((c - a) * u - (b - a) * s)):
        each = np.repeat(one, 3, axis=0)
        axes = [np.bincount(corner, axis, minlength=len(points)) for axis in each.T]
        sums.append(np.array(axes, np.float64).T)
    right, above = sums
    right = right - up * _dot(up, right)[:, None]
    length = np.sqrt(_dot(right, right))
    # Where a picture is nowhere spread out, any direction on the surface is as good.
    other: NDArray[np.float64] = np.where(np.abs(up[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    other = other - up * _dot(up, other)[:, None]
    some = length > 1e-12
    right = np.where(some[:, None], right, other)
    right /= np.sqrt(_dot(right, right))[:, None]
    side = np.where(_dot(np.cross(up, right), above) < 0.0, -1.0, 1.0)
    return np.column_stack([right, side])


def _dot(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = (one * other).T
    return np.asarray(x + y + z)


@inner
def put_integer(text, at, number):  # type: ignore[no-untyped-def]
    """Write a positive integer in decimal; returns where the text goes on."""
    width = 1
    power = 10
    while number >= power:
        width += 1
        power *= 10
    for place in range(width):
        text[at + width - 1 - place] = 48 + number % 10
        number //= 10
    return at + width


@inner
def put_number(text, at, value, decimals, unit):  # type: ignore[no-untyped-def]
    """Write a number rounded to so many decimals (unit = 10**decimals), without trailing zeros."""
    scaled = np.int64(np.rint(abs(value) * unit))
    if value < 0 and scaled > 0:
        text[at] = 45
        at += 1
    whole = scaled // unit
    fraction = scaled - whole * unit
    at = put_integer(text, at, whole)
    if fraction == 0:
        return at
    while fraction % 10 == 0:
        fraction //= 10
        decimals -= 1
    text[at] = 46
    for place in range(decimals):
        text[at + decimals - place] = 48 + fraction % 10
        fraction //= 10
    return at + decimals + 1


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
            for place in range(width):
                text[at + 1 + place] = text[start + place]
            at += 1 + width
        text[at] = 10
        at += 1
    return at
