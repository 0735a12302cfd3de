"""Files that are no larger than they say: text in UTF-8, arrays in an npz."""

from __future__ import annotations

import errno
import json
import math
import stat
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from struct import Struct
from typing import Any
from zipfile import ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.lib.format import (
    read_array_header_1_0,
    read_array_header_2_0,
    read_magic,
    write_array,
)
from numpy.typing import NDArray

from terrain_forge.base.errors import DataError, hint_at, reading

_ABSENT = errno.ENOENT, errno.ENOTDIR, errno.ELOOP
_BESIDE = 10_000
"""Files of a folder among which the one that is meant is looked for."""
_ALIKE = 0.75
"""How like its name must be: names of files often share an ending."""
MAX_STATE = 2**28
"""Bytes of a file in which we keep what was done so far."""
_MOST_TABLE = 2**34
_LONGEST_LINE = 10_000
_LOCAL, _LONG, _FIELD = 30, 20, Struct("<HH")
"""Bytes of a zip's local header without its name, of its field of long sizes, and what two lengths
are packed by."""
_PADDING, _ALIGNED, _PIECE = 0xD935, 64, 2**20
"""Kind of a field that only takes space, what arrays begin at multiples of, and bytes read at once.
"""
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_LINE_ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"


def size_text(size: float) -> str:
    """A number of bytes for people, such as `3.4 MB`."""
    for unit in ("B", "kB", "MB"):
        if size < 999.5:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} GB"


def length_text(metres: float) -> str:
    """A length for people, such as `3.4 km`."""
    if metres < 999.5:
        return f"{metres:.3g} m"
    return f"{metres / 1e3:.3g} km" if metres < 999.5e3 else f"{metres / 1e3:,.0f} km"


def require_file(
    path: Path, name: str, key: tuple[str | int, ...] = (), *, most: float = math.inf
) -> None:
    """Refuse what is no file, such as a pipe or a device, and one of more than `most` bytes.

    Raises:
        DataError: says by `name` what is there instead.
    """
    with reading(name, key=key):
        try:
            found = path.stat()
        except (OSError, ValueError) as error:
            if getattr(error, "errno", errno.ENOENT) not in _ABSENT:
                raise
            raise DataError(f"no such file: {name}{_meant(path)}", key=key) from None
        if stat.S_ISDIR(found.st_mode):
            raise DataError(f"is a folder, not a file: {name}", key=key)
        if not stat.S_ISREG(found.st_mode):
            raise DataError(f"is no regular file: {name}", key=key)
        if found.st_size > most:
            raise DataError(
                f"{name} has {found.st_size / 2**20:,.1f} MiB, at most {most / 2**20:,g} MiB",
                key=key,
            )


def _meant(path: Path) -> str:
    """The file beside it that is meant, as a question; empty where none is like it."""
    try:
        beside = islice(path.parent.iterdir(), _BESIDE)
        names = sorted({file.name for file in beside} - {path.name})
        longer = [name for name in names if name.startswith(f"{path.name}.")]
        return hint_at(path.name, longer or names, alike=0.0 if longer else _ALIKE)
    except OSError:
        return ""


def read_bytes(
    path: Path, name: str, *, most: float = math.inf, key: tuple[str | int, ...] = ()
) -> bytes:
    """What is in a file: as many bytes as it says, which are none of what only looks like a file.

    Args:
        path: The file.
        name: What it is called in errors.
        most: Bytes that it may have.
        key: Where in the recipe it is named.

    Raises:
        DataError: if there is no such file, or it cannot be read.
    """
    require_file(path, name, key, most=most)
    with reading(name, key=key), path.open("rb") as file:
        return file.read(path.stat().st_size)


def read_text(
    path: Path, name: str, *, most: int, lines: int = 2**32, key: tuple[str | int, ...] = ()
) -> str:
    """The text of a file in UTF-8, a byte order mark left out.

    Args:
        path: The file.
        name: What it is called in errors.
        most: Bytes that it may have.
        lines: Lines that it may have.
        key: Where in the recipe it is named.

    Raises:
        DataError: if there is no such file or it is no such text; names the line.
    """
    data = read_bytes(path, name, most=most, key=key)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DataError(f"{name}:{line}: is no text in UTF-8", key=key) from None
    if (found := sum(map(text.count, _LINE_ENDS))) > lines:
        raise DataError(f"{name} has {found:,} lines, at most {lines:,}", key=key)
    return text


def read_lines(path: Path, name: str) -> Iterator[str]:
    """The lines of a table of UTF-8, one by one, so that none fills the memory.

    Args:
        path: The file, 16 GiB at most.
        name: What it is called in errors.

    Raises:
        DataError: if there is no such file, or one of its lines is too long for one.
    """
    require_file(path, name, most=_MOST_TABLE)
    with path.open(encoding="utf-8", newline="") as file:
        while line := file.readline(_LONGEST_LINE):
            if len(line) == _LONGEST_LINE:
                raise DataError(f"{name}: a line has more than {_LONGEST_LINE:,} characters")
            yield line


def read_json(path: Path, name: str, *, most: int = MAX_STATE) -> Any:
    """What a file in JSON says, as plain values.

    Args:
        path: The file.
        name: What it is called in errors.
        most: Bytes that it may have.

    Raises:
        DataError: if there is no such file or it is no JSON.
    """
    text = read_text(path, name, most=most)
    with reading(name):
        return json.loads(text)


def read_arrays(path: Path, name: str = "", *, mapped: bool = False) -> dict[str, NDArray[Any]]:
    """The arrays of an npz that is stored as it is, not compressed: no array is larger than it.

    Args:
        path: The file.
        name: What it is called in errors, its own name without.
        mapped: Leave the numbers in the file, which must stay as it is: what is looked at is read
            from there. Arrays of `write_arrays` can be.

    Raises:
        DataError: if there is no such file, or its bytes are not the arrays'.
    """
    require_file(path, name or path.name)
    with reading(name or path.name):
        return _arrays(path, mapped=mapped)


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write an npz, not compressed, in which arrays begin where memory can be mapped to them."""
    with path.open("wb") as file, ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            info = ZipInfo(f"{name}.npy")
            fixed = _LOCAL + len(info.filename.encode()) + _LONG + _FIELD.size
            pad = -(file.tell() + fixed) % _ALIGNED
            info.extra = _FIELD.pack(_PADDING, pad) + bytes(pad)
            with archive.open(info, "w", force_zip64=True) as member:
                write_array(member, array, allow_pickle=False)


def _arrays(path: Path, *, mapped: bool) -> dict[str, NDArray[Any]]:
    found: dict[str, NDArray[Any]] = {}
    with ZipFile(path) as archive:
        parts = archive.infolist()
        for part in parts:
            if part.compress_type != ZIP_STORED or part.file_size != part.compress_size:
                raise ValueError(f"{part.filename} is compressed")
            with archive.open(part) as file:
                readers = {(1, 0): read_array_header_1_0, (2, 0): read_array_header_2_0}
                shape, by_columns, kind = readers[read_magic(file)](file)
                if part.file_size - file.tell() != math.prod(shape) * kind.itemsize:
                    raise ValueError(f"{part.filename} is not of the size it says")
                place = _begin_of(path, part) + file.tell()
                if mapped and not (by_columns or kind.hasobject or place % _ALIGNED):
                    while file.read(_PIECE):  # which checks its sum
                        pass
                    found[part.filename.removesuffix(".npy")] = _mapped(path, place, shape, kind)
        if sum(part.file_size for part in parts) > path.stat().st_size:
            raise ValueError("it claims more bytes than it has")
    with np.load(path, allow_pickle=False) as arrays:
        return {name: found[name] if name in found else arrays[name] for name in arrays.files}


def _begin_of(path: Path, part: ZipInfo) -> int:
    """Where the bytes of a stored part of an archive begin."""
    with path.open("rb") as file:
        file.seek(part.header_offset + _LOCAL - _FIELD.size)
        name, more = _FIELD.unpack(file.read(_FIELD.size))
    return int(part.header_offset + _LOCAL + name + more)


def _mapped(path: Path, place: int, shape: tuple[int, ...], kind: np.dtype[Any]) -> NDArray[Any]:
    if not math.prod(shape):
        return np.empty(shape, kind)
    return np.memmap(path, kind, "r", place, shape).view(np.ndarray)


def require_gltf(content: bytes, *, most: int) -> None:
    """Refuse a glTF or GLB that states or repeats more numbers than its size would let one expect.

    A few words are enough for arrays of any length, and for a mesh that is shown without end.

    Args:
        content: What stands in the file.
        most: Numbers of its arrays in all, once more for each mesh and node that has them.

    Raises:
        ValueError: if there are more, or nodes within themselves.
    """
    binary = content[:4] == b"glTF"
    text = content[20 : 20 + int.from_bytes(content[12:16], "little")] if binary else content
    told = json.loads(text)
    nodes = told.get("nodes", ())
    sizes = [abs(one["count"]) * _COMPONENTS[one["type"]] for one in told.get("accessors", ())]
    meshes = [
        sum(sizes[number] for part in mesh["primitives"] for number in _arrays_of(part))
        for mesh in told.get("meshes", ())
    ]
    shown = sum(meshes[node["mesh"]] for node in nodes if "mesh" in node)
    if not sum(sizes) + sum(meshes) + shown <= most:  # which no NaN is either
        raise ValueError("it has too many numbers")
    if sum(len(node.get("children", ())) for node in nodes) >= max(len(nodes), 1):
        raise ValueError("it has nodes within themselves")


def _arrays_of(primitive: dict[str, Any]) -> list[int]:
    """Numbers of the arrays that a part of a glTF's mesh is made of."""
    indices = [primitive["indices"]] if "indices" in primitive else []
    return [*primitive["attributes"].values(), *indices]
