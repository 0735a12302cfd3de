"""Reading back the meshes that were exported, and the height of their surface under points."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inlined, kernel
from terrain_forge.model import Mesh

_LINE_FEED = 10
BYTES, TRIANGLES = 2**24, 2**18
"""How much of a file is looked at at a time."""
_PLY = b"ply\nformat binary_little_endian 1.0\n"
_PLY_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4", "uint": "<u4"}
_STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attributes", "<u2")])


def read_mesh(path: Path) -> Mesh:
    """The triangles of an OBJ, a binary STL, or a GLB of one mesh whose node moves nothing.

    Raises:
        ValueError: for any other file.
    """
    content = np.fromfile(path, dtype=np.uint8)
    if path.suffix.lower() == ".obj":
        vertices, faces = _read_obj(content, np.count_nonzero(content == _LINE_FEED) + 1)
        return Mesh(vertices=vertices, faces=faces)
    if path.suffix.lower() == ".stl":
        corners = content[84:].view(_STL_RECORD)["corners"].reshape(-1, 3)
        return Mesh(vertices=corners, faces=np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
    if path.suffix.lower() == ".glb":
        return _read_glb(content)
    raise ValueError(f"{path}: neither OBJ nor STL nor GLB")


def read_objects(path: Path) -> Iterator[tuple[str, Mesh]]:
    """Name and triangles of each object of an OBJ, which may be larger than the memory.

    Raises:
        ValueError: if an object names vertices of another.
    """
    name, parts, first = "", list[tuple[Array, NDArray[np.int32]]](), 0
    with path.open("rb") as file:
        while block := file.read(BYTES):
            objects = (b"\n" + block + file.readline()).split(b"\no ")
            for number, text in enumerate(objects):
                if number:
                    stood = first + sum(len(vertices) for vertices, _ in parts)
                    yield from _object(path, name, parts, first)
                    first = stood
                    title, _, text = text.partition(b"\n")
                    name, parts = title.decode(), []
                content = np.frombuffer(bytearray(text + b"\n"), np.uint8)
                found = _read_obj(content, np.count_nonzero(content == _LINE_FEED) + 1)
                parts.append((found[0].copy(), found[1].copy()))  # or all room would stay taken
    yield from _object(path, name, parts, first)


def _object(
    path: Path, name: str, parts: list[tuple[Array, NDArray[np.int32]]], first: int
) -> Iterator[tuple[str, Mesh]]:
    """An object of an OBJ, unless it is empty; `first` vertices stand before its own."""
    if not any(len(faces) for _, faces in parts):
        return
    vertices, faces = (np.concatenate(column) for column in zip(*parts, strict=True))
    parts.clear()
    if faces.min() < first or faces.max() >= first + len(vertices):
        raise ValueError(f"{path}: object {name} names vertices of others")
    yield name, Mesh(vertices=vertices, faces=faces - np.int32(first))


def read_triangles(path: Path) -> Iterator[Mesh]:
    """The triangles of a binary STL or PLY, some at a time: it may be larger than the memory.

    Raises:
        ValueError: if it ends before the triangles that it announces, or is another kind of PLY.
    """
    for corners in _ply_corners(path) if path.suffix == ".ply" else _stl_corners(path):
        places = corners.reshape(-1, 3)
        yield Mesh(vertices=places, faces=np.arange(len(places), dtype=np.int32).reshape(-1, 3))


def _stl_corners(path: Path) -> Iterator[Array]:
    with path.open("rb") as file:
        left = int(np.fromfile(file, "<u4", 1, offset=80)[0])
        while left:
            found = np.fromfile(file, _STL_RECORD, min(left, TRIANGLES))
            if not len(found):
                raise ValueError(f"{path} ends {left} triangles too early")
            left -= len(found)
            yield found["corners"]


def _ply_corners(path: Path) -> Iterator[Array]:
    with path.open("rb") as file:
        if (begin := file.readline() + file.readline()) != _PLY:
            raise ValueError(f"{path} begins with {begin!r}, not {_PLY!r}")
        properties, counts, element = dict[str, list[tuple[str, str]]](), dict[str, int](), ""
        while (words := file.readline().decode().split()) not in ([], ["end_header"]):
            if words[0] == "element":
                element, counts[words[1]] = words[1], int(words[2])
                properties[element] = []
            elif words[0] == "property" and words[1] != "list":
                properties[element].append((words[2], _PLY_TYPES[words[1]]))
            elif words[0] == "property":
                properties[element] += [("count", _PLY_TYPES[words[2]]), ("corners", "3<i4")]
        if list(counts) != ["vertex", "face"]:
            raise ValueError(f"{path} holds {', '.join(counts)}, not vertex, face")
        vertices = np.fromfile(file, properties["vertex"], counts["vertex"])
        places = np.stack([vertices[axis] for axis in "xyz"], axis=-1)
        del vertices
        left = counts["face"]
        while left:
            found = np.fromfile(file, properties["face"], min(left, TRIANGLES))
            if not len(found) or (found["count"] != 3).any():
                raise ValueError(f"{path} lacks {left} triangles, or has other faces")
            left -= len(found)
            yield places[found["corners"]]


def _read_glb(content: NDArray[np.uint8]) -> Mesh:
    (length,) = content[12:16].view("<u4").tolist()
    asset, binary = json.loads(content[20 : 20 + length].tobytes()), content[28 + length :]

    def values(number: int) -> NDArray[Any]:
        accessor = asset["accessors"][number]
        view = asset["bufferViews"][accessor["bufferView"]]
        kind = np.dtype({5126: "<f4", 5125: "<u4", 5123: "<u2"}[accessor["componentType"]])
        count = accessor["count"] * {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        start = view["byteOffset"]
        return binary[start : start + count * kind.itemsize].view(kind).reshape(-1, 3)

    vertices, faces, first = [], [], 0
    for primitive in asset["meshes"][0]["primitives"]:
        vertices.append(values(primitive["attributes"]["POSITION"]))
        faces.append(values(primitive["indices"]).astype(np.int32) + np.int32(first))
        first += len(vertices[-1])
    return Mesh(vertices=np.concatenate(vertices), faces=np.concatenate(faces))


def heights_on(mesh: Mesh, points: Array) -> Array:
    """Height [m] of the highest face at each point, shape [n, 2]; NaN beside the mesh."""
    order = np.argsort(points[:, 0], kind="stable")
    heights = np.full(len(points), -np.inf)
    _raise_to_faces(mesh.vertices, mesh.faces, points[order], order, heights)
    return np.where(np.isfinite(heights), heights, np.nan)


def highest_on(meshes: Iterable[Mesh], points: Array) -> Array:
    """Height [m] of the highest face of several meshes at each point; NaN beside all of them."""
    heights = np.full(len(points), np.nan)
    for mesh in meshes:
        heights = np.fmax(heights, heights_on(mesh, points))
    return heights


@kernel
def _raise_to_faces(vertices, faces, points, order, heights):  # type: ignore[no-untyped-def]
    """Raise each height to that of the faces there; points ascend in x, `order` is their place."""
    x = points[:, 0].copy()
    for face in range(len(faces)):
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        ax, ay = vertices[a, 0], vertices[a, 1]
        bx, by = vertices[b, 0] - ax, vertices[b, 1] - ay
        cx, cy = vertices[c, 0] - ax, vertices[c, 1] - ay
        area = bx * cy - by * cx
        if area == 0.0:
            continue
        slack = 1e-9
        n = np.searchsorted(x, ax + min(0.0, bx, cx))
        while n < len(points) and x[n] <= ax + max(0.0, bx, cx):
            px, py = x[n] - ax, points[n, 1] - ay
            u, v = (px * cy - py * cx) / area, (bx * py - by * px) / area
            if u >= -slack and v >= -slack and u + v <= 1.0 + slack:
                base = vertices[a, 2]
                z = base + u * (vertices[b, 2] - base) + v * (vertices[c, 2] - base)
                heights[order[n]] = max(heights[order[n]], z)
            n += 1


@kernel
def _read_obj(text, room):  # type: ignore[no-untyped-def]
    """Vertices and triangles of an OBJ's `v` and `f` lines, of which there is room for some."""
    vertices, faces = np.empty((room, 3)), np.empty((room, 3), dtype=np.int32)
    vertex_count, face_count, at = 0, 0, 0
    while at < len(text) - 1:
        is_vertex = text[at] == 118 and text[at + 1] == 32
        is_face = text[at] == 102 and text[at + 1] == 32
        if is_vertex or is_face:
            at += 1
            for corner in range(3):
                number, at = _read_number(text, at)
                if is_vertex:
                    vertices[vertex_count, corner] = number
                else:
                    faces[face_count, corner] = int(number) - 1
            vertex_count += is_vertex
            face_count += is_face
        while at < len(text) and text[at] != 10:
            at += 1
        at += 1
    return vertices[:vertex_count], faces[:face_count]


@inlined
def _read_number(text, at):  # type: ignore[no-untyped-def]
    """The decimal number after blanks, and where the next word begins."""
    while text[at] == 32:
        at += 1
    negative = text[at] == 45
    if negative:
        at += 1
    digits, decimals, after_point = 0.0, 0, False
    while at < len(text) and (48 <= text[at] <= 57 or text[at] == 46):
        if text[at] == 46:
            after_point = True
        else:
            digits = 10.0 * digits + (text[at] - 48)
            decimals += after_point
        at += 1
    while at < len(text) and text[at] != 32 and text[at] != 10:
        at += 1
    number = digits / 10.0**decimals
    return (-number if negative else number), at
