"""Files of points, written as they come: PLY, PCD, LAZ, and KITTI's plain floats."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Literal, Self

import numpy as np
from numpy.typing import NDArray

from terrain_forge import __version__
from terrain_forge.base import ExportError

Encoding = Literal["ply", "pcd", "laz", "bin"]
POINT = np.dtype(
    [
        *(("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f4")),
        *(("ring", "<u2"), ("time", "<f8"), ("instance", "<i4")),
    ]
)
"""A point: place [m], time [s]; a sweep's file holds places and times in 32 bits."""
_PLACE = {"x": "<f4", "y": "<f4", "z": "<f4"}
_NARROW = _PLACE | {"time": "<f4"}
_PLY = {"f4": "float", "f8": "double", "u2": "ushort", "i4": "int"}
_SCALE = 1e-4
"""Step of a place in LAZ [m]."""
BRIGHTER = 100
"""Values of LAZ's own intensity for one of ours: a white surface has 10 000 of 16 bits."""
INTENSITY = "intensity_float"
"""LAZ's further dimension of intensities as they are."""
_LAZ = 13.0
"""Bytes of a point in LAZ, which compresses."""
_DAY = (2020, 9, 13)
"""Date of LAZ files, that of the first stamp: their bytes shall not tell when they were written."""


def points_of(sweep: NDArray[Any], places: NDArray[np.float64], begin: float) -> NDArray[Any]:
    """A sweep's points at other places, times from `begin` [s]."""
    found = np.zeros(len(sweep), POINT)
    for name in ("intensity", "ring"):
        found[name] = sweep[name]
    found["instance"] = sweep["instance"] if "instance" in (sweep.dtype.names or ()) else -1
    found["time"] = begin + sweep["time"].astype(np.float64)
    found["x"], found["y"], found["z"] = places.T
    return found


def point_size(encoding: Encoding, *, wide: bool) -> float:
    """About the bytes of a point in a file of an encoding."""
    known = {"bin": 16.0, "laz": _LAZ, "pcd": 30.0 if wide else 26.0}
    return known.get(encoding, 42.0 if wide else 26.0)


class PointFile:
    """A file that points are added to. Use it in a `with` block.

    Args:
        path: The file.
        encoding: Its format.
        wide: Whether places and times have 64 bits where the format has a choice.
        crs: WKT of what places are in, for LAZ; empty where that is no CRS.
    """

    def __init__(self, path: Path, encoding: Encoding, *, wide: bool, crs: str = "") -> None:
        self._path, self._encoding, self._crs = path, encoding, crs
        told = {name: kind.str for name, (kind, *_) in (POINT.fields or {}).items()}
        # The point types of PCL, which PCD is of, have places of 32 bits.
        chosen = (_PLACE if encoding == "pcd" else {}) if wide else _NARROW
        self._fields = told | chosen
        self._count = 0
        self._file: BinaryIO | None = None
        self._laz: Any = None

    def __enter__(self) -> Self:
        self._file = self._path.open("wb+")
        if self._encoding == "laz":
            self._laz = _laz_writer(self._file, self._crs)
        else:
            self._file.write(self._head())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        assert self._file is not None
        with self._file:
            if self._laz is not None:
                self._laz.close()
            else:
                self._file.seek(0)
                self._file.write(self._head())

    def add(self, points: NDArray[Any]) -> None:
        """Add points, of the type `POINT`."""
        self._count += len(points)
        if self._laz is not None:
            self._laz.write_points(_laz_points(points, self._laz.header))
            return
        assert self._file is not None
        if self._encoding == "bin":
            values = [points[n] / (100.0 if n == "intensity" else 1.0) for n in [*self._fields][:4]]
            self._file.write(np.stack(values, axis=-1).astype("<f4").tobytes())
        else:
            self._file.write(points.astype([*self._fields.items()]).tobytes())

    def _head(self) -> bytes:
        """The header, of one length whatever the number of points."""
        heads: dict[str, Callable[[], str]] = {"ply": self._ply, "pcd": self._pcd}
        return heads[self._encoding]().encode() if self._encoding in heads else b""

    def _ply(self) -> str:
        rows = [f"property {_PLY[kind[1:]]} {name}" for name, kind in self._fields.items()]
        lines = ["ply", "format binary_little_endian 1.0", "comment metres, seconds"]
        lines += [f"element vertex {self._count:<12d}", *rows, "end_header"]
        return "\n".join(lines) + "\n"

    def _pcd(self) -> str:
        kinds = list(self._fields.values())
        rows = {
            "VERSION": "0.7",
            "FIELDS": " ".join(self._fields),
            "SIZE": " ".join(kind[2] for kind in kinds),
            "TYPE": " ".join(kind[1].upper() for kind in kinds),
            "COUNT": " ".join("1" for _ in kinds),
            "WIDTH": f"{self._count:<12d}",
            "HEIGHT": "1",
            "VIEWPOINT": "0 0 0 1 0 0 0",
            "POINTS": f"{self._count:<12d}",
            "DATA": "binary",
        }
        return "".join(f"{name} {text}\n" for name, text in rows.items())


def _laz_writer(file: BinaryIO, crs: str) -> Any:
    from datetime import date

    import laspy
    from laspy.vlrs.known import WktCoordinateSystemVlr

    header = laspy.LasHeader(point_format=1, version="1.4" if crs else "1.2")
    if crs:  # LAS 1.4 is the first that knows WKT
        header.vlrs.append(WktCoordinateSystemVlr(crs))
        header.global_encoding.wkt = True
    header.scales, header.offsets = np.full(3, _SCALE), np.zeros(3)
    header.creation_date = date(*_DAY)
    header.system_identifier = "simulated"
    header.generating_software = f"terrain-forge {__version__}"[:32]
    told = f"16-bit intensity is {BRIGHTER} times it"  # LAS has 32 bytes for it
    for name, kind, text in (
        *(("ring", "uint16", ""), ("instance", "int32", "")),
        (INTENSITY, "float32", told),
    ):
        header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=kind, description=text))
    backend = laspy.LazBackend.Lazrs
    return laspy.open(
        *(file, "w"), closefd=False, header=header, do_compress=True, laz_backend=backend
    )


def _laz_points(points: NDArray[Any], header: Any) -> Any:
    import laspy

    largest = max((float(np.abs(points[axis]).max(initial=0.0)) for axis in "xyz"), default=0.0)
    if largest >= _SCALE * 2**31:
        raise ExportError(f"LAZ holds places up to {_SCALE * 2**31:,.0f} m, not {largest:,.0f} m")
    found = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
    found.x, found.y, found.z = points["x"], points["y"], points["z"]
    found.intensity = np.clip(np.rint(BRIGHTER * points["intensity"]), 0, 2**16 - 1)
    found[INTENSITY] = points["intensity"]
    found.gps_time = points["time"]
    # LAS counts from 1; of a beam the lidar records one echo, whichever that is.
    found.return_number[:], found.number_of_returns[:] = 1, 1
    found.ring, found.instance = points["ring"], points["instance"]
    return found
