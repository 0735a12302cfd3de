"""Maps of systems and of users: clouds of points and height grids, as points with rock flags."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    python_words,
    read_text,
    reading,
    require_file,
)
from terrain_forge.dtm import crs_of, ellipsoid, open_dataset, transform

MOST = 2**32
"""Bytes of a map."""
_HEADER = 2**16
MAX_PIXELS = 2**26
"""Pixels of a raster."""
MAX_NUMBERS = 1000
"""Numbers of a point of PCD."""
_PLY = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2"},
    **{"ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
_ROCK = "rock"


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPoints:
    """A map as points; of a grid, the middles of its cells."""

    name: str
    """What tables call it."""
    position: Array
    """Places [m], shape [points, 3]."""
    rock: NDArray[np.bool_] | None = None
    """Which are said to be rock, shape [points]; None where the map has no such flags."""

    def moved(self, motion: Array) -> MapPoints:
        """The map after a motion, shape [4, 4], which may scale."""
        place = (self.position[:, None, :] * motion[:3, :3]).sum(axis=-1) + motion[:3, 3]
        return MapPoints(name=self.name, position=place, rock=self.rock)


def read_map(path: Path | str, *, name: str = "", crs: str = "") -> MapPoints:
    """Read a map: PLY, PCD, LAS, LAZ, GeoTIFF, NumPy's array, or text of x y z.

    Places are metres. A GeoTIFF's first band holds heights at its pixels' middles, its second, if
    there is one, rock flags. An array has x, y, z and perhaps a rock flag last, shape [n, 3],
    [n, 4] or [rows, columns, 4]; so has text, with commas or blanks. What is not finite is left
    out, as a cell that was not mapped.

    Args:
        path: The file.
        name: What tables call it; by default the file's name.
        crs: WKT of the world's CRS, in which the places of a GeoTIFF are told that has another.

    Raises:
        DataError: if it is none of these, holds no point, or lies on another body.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in _READERS:
        raise DataError(f"{path}: must end in {', '.join(_READERS)}")
    require_file(path, str(path), most=MOST)
    with reading(str(path)):
        table, flagged = _READERS[ending](path)
    if crs and _READERS[ending] is _raster:
        table[:, 0], table[:, 1] = _laid(path, table[:, 0], table[:, 1], crs)
    finite = np.isfinite(table[:, :3]).all(axis=1)
    table = table[finite]
    if not len(table):
        raise DataError(f"{path}: holds no point")
    rock = np.nan_to_num(table[:, 3], neginf=0.0) > 0.5 if flagged else None
    return MapPoints(name=name or path.stem, position=table[:, :3], rock=rock)


def _table(values: Array, path: Path) -> tuple[Array, bool]:
    """A table of x, y, z and perhaps a flag."""
    if values.ndim == 3:
        values = values.reshape(-1, values.shape[-1])
    if values.ndim != 2 or values.shape[1] not in (3, 4):
        shape = " x ".join(map(str, values.shape))
        raise DataError(f"{path}: has shape {shape}, must be rows of x, y, z and perhaps a flag")
    return np.asarray(values, np.float64), values.shape[1] == 4


def _array(path: Path) -> tuple[Array, bool]:
    found = np.load(path, allow_pickle=False)
    if not isinstance(found, np.ndarray) or found.dtype.kind not in "fiub":
        raise DataError(f"{path}: must be an array of numbers")
    return _table(found, path)


def _text(path: Path) -> tuple[Array, bool]:
    rows: list[list[float]] = []
    headed = False
    for number, line in enumerate(read_text(path, str(path), most=MOST).splitlines(), 1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            if rows or headed:
                raise DataError(f"{path}:{number}: {line[:60]!r}, must be numbers") from None
            headed = True
            continue
        if len(rows[-1]) != len(rows[0]):
            raise DataError(f"{path}:{number}: {len(words)} numbers, the first row {len(rows[0])}")
    return _table(np.array(rows) if rows else np.zeros((0, 3)), path)


def _raster(path: Path) -> tuple[Array, bool]:
    with open_dataset(path) as dataset:
        if dataset.width * dataset.height > MAX_PIXELS:
            size = f"{dataset.width:,} x {dataset.height:,}"
            raise DataError(f"{path}: has {size} pixels, at most {MAX_PIXELS:,} in all")
        heights = dataset.read(1, masked=True).astype(np.float64).filled(np.nan)
        heights = heights * dataset.scales[0] + dataset.offsets[0]
        flags = dataset.read(2, masked=True).filled(0) if dataset.count > 1 else None
        rows, columns = np.mgrid[: dataset.height, : dataset.width] + 0.5
        t = dataset.transform
        east, north = t.a * columns + t.b * rows + t.c, t.d * columns + t.e * rows + t.f
    parts = [east, north, heights, *([] if flags is None else [flags])]
    return np.stack([part.ravel() for part in parts], axis=-1), flags is not None


def _laid(path: Path, x: Array, y: Array, crs: str) -> tuple[Array, Array]:
    """Places of a raster in the CRS `crs`: as they are where it is the raster's, or it has none."""
    from rasterio.crs import CRS

    with open_dataset(path) as dataset:
        own = dataset.crs
        if own is None or own == CRS.from_wkt(crs) or not (own.is_projected or own.is_geographic):
            return x, y
        wkt = crs_of(dataset)
    found, radius = ellipsoid(wkt)[0], ellipsoid(crs)[0]
    if abs(found / radius - 1.0) > 0.05:
        raise DataError(
            f"{path}: lies on a body of {found / 1e3:.0f} km radius, the world on one of "
            f"{radius / 1e3:.0f} km: give it the world's CRS, or none"
        )
    return transform(wkt, crs, x, y)


_READ_LAS = """
import resource, sys
import laspy, numpy
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[3]),) * 2)
cloud = laspy.read(sys.argv[1])
numpy.save(sys.argv[2], numpy.column_stack([cloud.x, cloud.y, cloud.z]).astype(float))
"""
PATIENCE = 10.0, 1e6
"""Seconds that reading LAS may take, and bytes for each further one."""


def _las(path: Path) -> tuple[Array, bool]:
    """Points by laspy in a process of its own, which a damaged file can end, fill or keep busy."""
    if find_spec("laspy") is None:
        raise DataError(f"{path} needs laspy: pip install 'terrain-forge[datasets]'")
    patience = PATIENCE[0] + path.stat().st_size / PATIENCE[1]
    with TemporaryDirectory() as folder:
        points = Path(folder) / "points.npy"
        words = [*python_words(_READ_LAS), str(path), str(points), str(2 * MOST)]
        try:
            done = subprocess.run(words, capture_output=True, timeout=patience, check=False)
        except subprocess.TimeoutExpired:
            raise DataError(f"{path}: is damaged: laspy does not come to its end") from None
        if done.returncode:
            lines = done.stderr.decode(errors="replace").splitlines()
            told = [
                line
                for line in lines
                if line[:1].isalpha() and not line.startswith(("note", "stack"))
            ]
            raise DataError(f"{path}: laspy cannot read it: {(told or ['it ended'])[-1][:200]}")
        return np.load(points), False


def _ply(path: Path) -> tuple[Array, bool]:
    with path.open("rb") as file:
        head = file.read(_HEADER)
    end = re.search(rb"end_header\r?\n", head)
    if not head.startswith(b"ply") or end is None:
        raise DataError(f"{path}: is no PLY")
    form, count, names = "", -1, list[tuple[str, str]]()
    element = ""
    for line in head[: end.start()].decode("ascii", "replace").splitlines():
        words = line.split()
        if words[:1] == ["format"] and len(words) > 1:
            form = words[1]
        elif words[:1] == ["element"] and len(words) == 3:
            if count < 0 and words[1] != "vertex":
                raise DataError(f"{path}: its first element is {words[1]!r}, must be vertex")
            element = words[1]
            count = int(words[2]) if element == "vertex" else count
        elif words[:1] == ["property"] and element == "vertex":
            if len(words) != 3 or words[1] not in _PLY:
                raise DataError(
                    f"{path}: property {' '.join(words[1:])!r} of a vertex is no number"
                )
            names.append((words[2], _PLY[words[1]]))
    order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}.get(form)
    if order is None:
        raise DataError(f"{path}: format {form!r}, must be ascii or binary")
    return _fields(path, names, count, begin=end.end(), order=order)


def _pcd(path: Path) -> tuple[Array, bool]:
    with path.open("rb") as file:
        head = file.read(_HEADER)
    end = re.search(rb"^DATA (\w+)\r?\n", head, re.M)
    if end is None:
        raise DataError(f"{path}: is no PCD")
    told = {
        words[0]: words[1:]
        for line in head[: end.start()].decode("ascii", "replace").splitlines()
        if (words := line.split())
    }
    counts = [int(word) for word in told.get("COUNT", ["1"] * len(told.get("FIELDS", [])))]
    if sum(counts) > MAX_NUMBERS or min(counts, default=0) < 0:
        raise DataError(
            f"{path}: a point has {sum(counts):,} numbers, must be 0 to {MAX_NUMBERS:,}"
        )
    kinds = [
        {"F": "f", "I": "i", "U": "u"}.get(kind, "?") + size
        for kind, size in zip(told.get("TYPE", []), told.get("SIZE", []), strict=True)
    ]
    names = [
        (f"{name}_{n}" if n else name, kind)
        for name, kind, count in zip(told.get("FIELDS", []), kinds, counts, strict=True)
        for n in range(count)
    ]
    form = end[1].decode()
    if form not in ("ascii", "binary"):
        raise DataError(f"{path}: data are {form}, must be ascii or binary")
    count = int(told.get("POINTS", ["0"])[0])
    return _fields(path, names, count, begin=end.end(), order="<" if form == "binary" else "")


def _fields(
    path: Path, names: list[tuple[str, str]], count: int, *, begin: int, order: str
) -> tuple[Array, bool]:
    """Points whose fields follow each other from a byte on; an empty order means text."""
    known = [name for name, _ in names]
    if missing := [axis for axis in "xyz" if axis not in known]:
        raise DataError(f"{path}: its points have no {missing[0]}, only {', '.join(known)}")
    wanted = [*"xyz", *([_ROCK] if _ROCK in known else [])]
    if order:
        kind = np.dtype([(name, order + form) for name, form in names])
        if path.stat().st_size < begin + count * kind.itemsize:
            raise DataError(f"{path}: ends before its {count:,} points do")
        rows: Any = np.fromfile(path, kind, count, offset=begin)
        values = [rows[name].astype(np.float64) for name in wanted]
    else:
        text = path.read_bytes()[begin:].split(b"\n", count)[:count]
        table = np.array([line.split()[: len(known)] for line in text if line.strip()], np.float64)
        if table.shape != (count, len(known)):
            raise DataError(f"{path}: must have {count:,} rows of {len(known)} numbers")
        values = [table[:, known.index(name)] for name in wanted]
    return np.stack(values, axis=-1), len(wanted) == 4


_READERS: dict[str, Callable[[Path], tuple[Array, bool]]] = {
    ".ply": _ply,
    ".pcd": _pcd,
    ".las": _las,
    ".laz": _las,
    ".tif": _raster,
    ".tiff": _raster,
    ".npy": _array,
    ".csv": _text,
    ".txt": _text,
    ".xyz": _text,
}
