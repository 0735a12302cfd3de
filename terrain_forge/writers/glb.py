"""glTF 2.0 as one binary file (GLB), streamed: neither arrays nor nodes are gathered in memory.

Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022). Its header holds all lengths in 32 bits,
so no GLB is larger than 4 GiB.
"""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import ExportError

from .mesh import Floats, vertex_tangents

if TYPE_CHECKING:
    from terrain_forge.model import TexturedMesh

LARGEST_FILE = 2**32 - 1
"""Bytes that a GLB can hold."""

_VERTICES, _INDICES = 34962, 34963
_COMPONENT = {"float32": 5126, "uint32": 5125, "uint16": 5123, "uint8": 5121}
_RESTART = 2**16 - 1  # no index: it ends a strip
_SHAPE = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_ASSET = {"version": "2.0", "generator": "terrain-forge"}
_CHUNK_HEADER = 8
_FILE_HEADER = 12


class Gltf:
    """A glTF asset while it grows: its description in memory, its binary part in a file.

    Args:
        binary: Where the arrays and images go, an empty file open for reading and writing.
    """

    def __init__(self, binary: BinaryIO) -> None:
        self._binary = binary
        self._length = 0
        self._parts: dict[str, list[dict[str, Any]]] = {}

    def add(self, kind: str, part: dict[str, Any]) -> int:
        """Add to the list `kind` (meshes, materials, …) of the asset; returns the part's index."""
        parts = self._parts.setdefault(kind, [])
        parts.append(part)
        return len(parts) - 1

    def add_vertices(self, values: NDArray[np.float32], *, bounded: bool = False) -> int:
        """Add an accessor of vertex attributes, shape [vertices, n]; positions are `bounded`."""
        return self._add_array(values, {"target": _VERTICES}, bounded=bounded)

    def add_colours(self, values: NDArray[np.uint8]) -> int:
        """Add an accessor of linear vertex colours, 0 to 255 for 0 to 1, shape [vertices, 4]."""
        accessor = self._add_array(values, {"target": _VERTICES}, bounded=False)
        self._parts["accessors"][accessor]["normalized"] = True
        return accessor

    def add_indices(self, faces: NDArray[np.integer[Any]]) -> int:
        """Add an accessor of corner indices, shape [faces, 3], in 16 bits where they fit."""
        kind = np.uint16 if faces.max(initial=0) < _RESTART else np.uint32
        flat = faces.astype(kind).reshape(-1, 1)
        return self._add_array(flat, {"target": _INDICES}, bounded=False)

    def add_samples(self, values: NDArray[np.float32], *, bounded: bool = False) -> int:
        """Add an accessor of an animation's times (`bounded`) or values, shape [samples, n]."""
        return self._add_array(values, {}, bounded=bounded)

    def add_surface(
        self, surface: TexturedMesh, *, bumpy: bool = False, bumps: Floats | None = None
    ) -> dict[str, Any]:
        """Add a textured surface; returns what is the same in all primitives of it.

        One that is `bumpy`, for a map of normals, tells where that map's right is. The map lies as
        the texture does, or by texture coordinates of its own, `bumps`, which are TEXCOORD_1.
        """
        faces = self.add_indices(surface.faces)
        primitive = self.add_primitive(
            surface.vertices, surface.normals, faces, surface.texture_coordinates
        )
        if bumps is not None:
            primitive["attributes"]["TEXCOORD_1"] = self._add_coordinates(bumps)
            surface = surface._replace(texture_coordinates=np.asarray(bumps, np.float64))
        if bumpy or bumps is not None:
            tangents = vertex_tangents(*surface).astype(np.float32)
            primitive["attributes"]["TANGENT"] = self.add_vertices(tangents)
        return primitive

    def add_primitive(
        self,
        vertices: Floats,
        normals: Floats,
        faces: int,
        texture_coordinates: Floats | None = None,
    ) -> dict[str, Any]:
        """Add a piece of a mesh, whose corner indices are added; returns it.

        Texture coordinates are u to the right and v upwards, as in OBJ; glTF's v runs down.
        """
        attributes = {
            "POSITION": self.add_vertices(vertices.astype(np.float32), bounded=True),
            "NORMAL": self.add_vertices(normals.astype(np.float32)),
        }
        if texture_coordinates is not None:
            attributes["TEXCOORD_0"] = self._add_coordinates(texture_coordinates)
        return {"attributes": attributes, "indices": faces}

    def _add_coordinates(self, upwards: Floats) -> int:
        return self.add_vertices((upwards * (1, -1) + (0, 1)).astype(np.float32))

    def add_texture(self, content: bytes, *, tiles: bool, media_type: str = "image/png") -> int:
        """Add an image, PNG or JPEG, as a texture that repeats itself or ends at its edges."""
        view = self._add_view(content, {})
        image = self.add("images", {"bufferView": view, "mimeType": media_type})
        wrap = 10497 if tiles else 33071
        linear, trilinear = 9729, 9987
        filters = {"magFilter": linear, "minFilter": trilinear, "wrapS": wrap, "wrapT": wrap}
        known = self._parts.get("samplers", [])
        sampler = known.index(filters) if filters in known else self.add("samplers", filters)
        return self.add("textures", {"source": image, "sampler": sampler})

    def write(
        self, path: Path, *, nodes: Iterable[str], in_nodes: Iterable[str] = (), **entries: Any
    ) -> None:
        """Write the file, which names the extensions that it uses.

        Args:
            path: The file.
            nodes: The nodes as JSON objects in their order; a text may hold several with commas
                between them.
            in_nodes: Names of their extensions, but for those that `entries` describe.
            entries: What else the asset says, as JSON values.

        Raises:
            ExportError: if the file would be larger than 4 GiB.
        """
        buffers = [{"byteLength": self._length}] if self._length else []
        lists = {"buffers": buffers, **self._parts}
        looks = sorted(_extensions(self._parts.get("materials", [])))
        if used := [*dict.fromkeys([*entries.get("extensions", {}), *looks, *in_nodes])]:
            entries = {"extensionsUsed": used, **entries}
        parts = {kind: parts for kind, parts in lists.items() if parts}
        described = {"asset": _ASSET, **entries, **parts}
        head = json.dumps(described, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        with path.open("wb") as file:
            file.write(bytes(_FILE_HEADER + _CHUNK_HEADER))
            file.write(f'{head[:-1]},"nodes":['.encode())
            for number, text in enumerate(nodes):
                file.write(f"{',' if number else ''}{text}".encode())
            file.write(b"]}")
            file.write(b" " * (-file.tell() % 4))
            text_end = file.tell()
            _check_capacity(text_end + _CHUNK_HEADER + self._length)
            file.write(struct.pack("<I4s", self._length, b"BIN\0"))
            self._binary.seek(0)
            shutil.copyfileobj(self._binary, file, 1 << 20)
            total = file.tell()
            file.seek(0)
            described_in = text_end - _FILE_HEADER - _CHUNK_HEADER
            file.write(struct.pack("<4sIII4s", b"glTF", 2, total, described_in, b"JSON"))

    def write_mesh(self, path: Path, primitives: Iterable[dict[str, Any]]) -> None:
        """Write a file of nothing but one mesh of these pieces, its axes as they are."""
        self.add("meshes", {"name": path.stem, "primitives": list(primitives)})
        node = json.dumps({"name": path.stem, "mesh": 0})
        self.write(path, nodes=[node], scene=0, scenes=[{"nodes": [0]}])

    def _add_array(self, values: NDArray[Any], view: dict[str, int], *, bounded: bool) -> int:
        values = np.ascontiguousarray(values)
        accessor: dict[str, Any] = {
            "bufferView": self._add_view(values.data, view),
            "componentType": _COMPONENT[values.dtype.name],
            "count": len(values),
            "type": _SHAPE[values.shape[1]],
        }
        if bounded:
            # Column by column: NumPy is slow along the long axis of a narrow array.
            accessor["min"] = [float(column.min()) for column in values.T]
            accessor["max"] = [float(column.max()) for column in values.T]
        return self.add("accessors", accessor)

    def _add_view(self, content: bytes | memoryview, view: dict[str, int]) -> int:
        length = memoryview(content).nbytes
        _check_capacity(self._length + length)
        place = {"buffer": 0, "byteOffset": self._length, "byteLength": length}
        self._binary.write(content)
        self._binary.write(bytes(-length % 4))
        self._length += length + -length % 4
        return self.add("bufferViews", {**place, **view})


def _extensions(part: Any) -> set[str]:
    """Names of the extensions in a part of a description, however deep."""
    if isinstance(part, list):
        return {name for one in part for name in _extensions(one)}
    if not isinstance(part, dict):
        return set()
    return {*part.get("extensions", {}), *_extensions([*part.values()])}


def _check_capacity(length: int) -> None:
    if length > LARGEST_FILE:
        raise ExportError(
            f"a GLB holds 4 GiB at most, this world has more than {length / 2**30:.1f} GiB: choose "
            "a smaller area, a coarser spacing_m, or the format usd"
        )
