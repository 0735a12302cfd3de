"""Readers of mesh files with NumPy alone, which share nothing with our writers or our read-back."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np

_KINDS = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5121: "u1"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def glb_chunks(data: bytes) -> tuple[dict, bytes]:
    """The JSON and the binary chunk of a GLB."""
    magic, version, total, length, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, total, kind) == (b"glTF", 2, len(data), b"JSON")
    rest, kind = struct.unpack_from("<I4s", data, 20 + length)
    assert (rest, kind) == (total - 28 - length, b"BIN\0")
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def glb_parts(path: Path) -> tuple[dict, list]:
    """The JSON of a GLB and the values of its accessors, shape [count, numbers]."""
    return glb_arrays(path.read_bytes())


def glb_arrays(data: bytes) -> tuple[dict, list]:
    """`glb_parts` of a file's bytes."""
    text, binary = glb_chunks(data)
    arrays = []
    for accessor in text["accessors"]:
        width, start = (
            _WIDTHS[accessor["type"]],
            text["bufferViews"][accessor["bufferView"]]["byteOffset"],
        )
        kind = _KINDS[accessor["componentType"]]
        values = np.frombuffer(binary, kind, accessor["count"] * width, start)
        arrays.append(values.reshape(-1, width))
    return text, arrays


def glb_corners(path: Path) -> np.ndarray:
    """Position, normal and texture coordinates (v down) of the corners of a GLB's only mesh."""
    text, arrays = glb_parts(path)
    assert len(text["meshes"]) == len(text["nodes"]) == 1
    assert not text["nodes"][0].keys() & {"matrix", "rotation", "scale", "translation"}
    corners = []
    for primitive in text["meshes"][0]["primitives"]:
        names, index = primitive["attributes"], arrays[primitive["indices"]][:, 0]
        parts = [arrays[names[name]][index] for name in ("POSITION", "NORMAL")]
        blank = np.zeros((len(index), 2))
        parts.append(arrays[names["TEXCOORD_0"]][index] if "TEXCOORD_0" in names else blank)
        corners.append(np.hstack(parts))
    return np.concatenate(corners)


def obj_corners(path: Path) -> np.ndarray:
    """The same of an OBJ with normals: its texture coordinates are turned to v down."""
    rows = {b"v": [], b"vn": [], b"vt": [], b"f": []}
    for line in path.read_bytes().splitlines():
        tag, *words = line.split()
        if tag in rows:
            if tag == b"f":
                words = [[int(index or 1) for index in word.split(b"/")] for word in words]
            rows[tag].append(words)
    vertices, normals, uv = (np.array(rows[tag], float) for tag in (b"v", b"vn", b"vt"))
    uv = uv * (1, -1) + (0, 1) if len(uv) else np.zeros((1, 2))
    corners = np.array(rows[b"f"]).reshape(-1, 3) - 1
    return np.hstack([vertices[corners[:, 0]], normals[corners[:, 2]], uv[corners[:, 1]]])


def stl_corners(path: Path) -> np.ndarray:
    """The corners of the triangles of a binary STL, with their faces' normals and no texture."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    faces = np.frombuffer(path.read_bytes(), record, offset=84)
    normals = np.repeat(faces["normal"], 3, axis=0)
    return np.hstack([faces["corners"].reshape(-1, 3), normals, np.zeros_like(normals[:, :2])])


CORNERS = {".glb": glb_corners, ".obj": obj_corners, ".stl": stl_corners}
"""Readers of the triangles' corners, shape [3 · faces, 8], by the ending of the file."""
