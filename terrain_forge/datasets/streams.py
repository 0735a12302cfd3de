"""What a recording holds of one sensor, read when it is asked for."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    is_file_name,
    read_lines,
    reading,
    require_file,
    require_measurement,
    require_unlinked,
)
from terrain_forge.datasets.poses import Stamps

DISTORTIONS = {"radtan": (4, 5), "equidistant": (4,), "none": (0,)}
"""Models of a lens's distortion, and how many coefficients they may have."""
_SAME_WORD = {"radial-tangential": "radtan", "radtan": "radtan", "plumb_bob": "radtan"}
_BLOCK = 8192
"""Rows of a table that are read at a time."""
_LARGEST = 2**31
"""Bytes that a sweep may have."""
_QUIET = Lock()
"""Held while warnings are silenced, which is for all threads at once."""
POINT_FIELDS = ("x", "y", "z", "intensity", "ring", "time", "instance")


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedSensor:
    """A sensor's folder in a recording."""

    folder: Path
    """Its folder."""
    name: str
    """What the recipe calls it."""
    about: Mapping[str, Any]
    """What its `sensor.yaml` says."""
    channels: Mapping[str, Mapping[str, Any]]
    """Its streams by their folders, and what a reader must know of each."""

    @property
    def key(self) -> str:
        """The name of its folder, such as `cam0`."""
        return self.folder.name

    @property
    def word_of_folder(self) -> str:
        """The folder's name without its number, such as `cam` or `imu`."""
        return self.key.rstrip("0123456789")

    @property
    def place(self) -> str:
        """What it is called in a message."""
        return f"{self.key}/sensor.yaml"

    def value(self, name: str) -> Any:
        """What its `sensor.yaml` says under a name.

        Raises:
            DataError: if it says nothing there.
        """
        if name not in self.about:
            raise DataError(f"{self.place} has no {name!r}")
        return self.about[name]

    def numbers(self, name: str, count: tuple[int, ...]) -> Array:
        """Numbers that its `sensor.yaml` gives under a name; `count` are the lengths allowed."""
        with reading(f"{name} of {self.place}"):
            found = np.asarray(self.value(name), np.float64).ravel()
            if found.size not in count or not np.isfinite(found).all():
                wanted = " or ".join(map(str, count))
                raise DataError(
                    f"{name} of {self.place}: {found.size} numbers, {wanted} finite ones are needed"
                )
            return found

    @cached_property
    def body_pose(self) -> Array:
        """T_BS: from the sensor's frame to the body's, shape [4, 4]."""
        told = self.value("T_BS")
        if not isinstance(told, Mapping) or "data" not in told:
            raise DataError(f"T_BS of {self.place} has no data")
        with reading(f"T_BS of {self.place}"):
            pose = np.array(told["data"], np.float64).reshape(4, 4)
        turn = pose[:3, :3]
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) or np.linalg.det(turn) < 0.0:
            raise DataError(f"T_BS of {self.place} is no rigid transform")
        return pose

    @cached_property
    def rate(self) -> float:
        """Measurements per second [Hz]."""
        rate = float(self.numbers("rate_hz", (1,))[0])
        if rate <= 0.0:
            raise DataError(f"rate_hz of {self.place}: {rate:g}, it must be above 0")
        return rate

    @property
    def table_file(self) -> Path:
        """Its `data.csv`."""
        return self.folder / "data.csv"

    @cached_property
    def _rows(self) -> tuple[Stamps, tuple[str, ...]]:
        """Stamps, and the names of the files where the table has them."""
        path = self.table_file
        where = f"{self.key}/data.csv"
        stamps, names = [], []
        with reading(where):
            for number, line in enumerate(read_lines(path, where), 1):
                if line.startswith("#") or not line.strip():
                    continue
                stamp, _, name = line.strip().partition(",")
                if not is_file_name(name):
                    raise DataError(f"{where}:{number}: {name[:60]!r} is no file's name")
                stamps.append(int(stamp))
                names.append(name)
            found = np.array(stamps, np.int64)
        return ascending(found, where), tuple(names)

    @property
    def stamps(self) -> Stamps:
        """When it measured [ns], shape [measurements]."""
        return self._rows[0]

    @cached_property
    def span(self) -> tuple[int, ...]:
        """Its first and its last stamp [ns]; none if it measured nothing."""
        return tuple(self.stamps[[0, -1]].tolist()) if len(self.stamps) else ()

    def file(self, number: int, channel: str = "data") -> Path:
        """The file of a measurement, by its number from 0.

        Raises:
            DataError: if there is no such measurement, or channel.
            OutputError: if it is a link: a recording packs nothing from elsewhere.
        """
        stems = self._rows[1]
        require_measurement(number, len(stems), self.key)
        stem = stems[number]
        if channel not in self.channels:
            raise DataError(f"{self.key} has no {channel!r}: it was not recorded")
        if channel != "data":
            stem = f"{Path(stem).stem}{self.channels[channel].get('suffix', '.png')}"
        return require_unlinked(self.folder, f"{channel}/{stem}")


def stored_size(files: Iterable[Path]) -> int:
    """Bytes of some files, those that are missing left out."""
    return sum(file.stat().st_size for file in files if file.is_file())


def stored_array(path: Path, where: str) -> NDArray[Any]:
    """An array of a .npy, not larger than its file; reading it runs no code.

    Raises:
        DataError: if the file is none.
    """
    require_file(path, where, most=_LARGEST)
    with reading(where):
        found = np.load(path, mmap_mode="r", allow_pickle=False)
        if not isinstance(found, np.ndarray):
            raise DataError(f"{where} is no array")
        return found


def ascending(stamps: Stamps, where: str) -> Stamps:
    """Stamps as they are.

    Raises:
        DataError: if they do not ascend from 0 on; names the row.
    """
    if len(stamps) and stamps[0] < 0:
        raise DataError(f"{where}: the stamp {stamps[0]} is before 0")
    if (late := np.flatnonzero(np.diff(stamps) <= 0)).size:
        raise DataError(f"{where}: the stamp of row {late[0] + 2} is not after the one before it")
    return stamps


def _bits(path: Path) -> int:
    """Bits of a value of a PNG, as its header tells."""
    with path.open("rb") as file:
        return file.read(25)[24]


def _deep_colours(path: Path) -> NDArray[np.uint16]:
    """A PNG with colours of 16 bits, of which Pillow would keep 8."""
    from rasterio.errors import NotGeoreferencedWarning
    from rasterio.io import MemoryFile

    with MemoryFile(path.read_bytes()) as memory:
        with _QUIET, warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            dataset = memory.open(driver="PNG")
        with dataset:
            return np.ascontiguousarray(np.moveaxis(dataset.read(), 0, -1))


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedCamera(RecordedSensor):
    """A camera's pictures and calibration, in OpenCV's convention: a first pixel's centre is 0."""

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        width, height = self.numbers("resolution", (2,))
        return int(width), int(height)

    @cached_property
    def intrinsics(self) -> Array:
        """Focal lengths and principal point fu, fv, cu, cv [px]."""
        return self.numbers("intrinsics", (4,))

    @property
    def matrix(self) -> Array:
        """The camera matrix, shape [3, 3]."""
        fu, fv, cu, cv = self.intrinsics
        return np.array([[fu, 0.0, cu], [0.0, fv, cv], [0.0, 0.0, 1.0]])

    @cached_property
    def distortion(self) -> tuple[str, Array]:
        """Model (`radtan`, `equidistant`, `none`) and coefficients, as OpenCV orders them."""
        told = str(self.value("distortion_model"))
        model = _SAME_WORD.get(told, told)
        if model not in DISTORTIONS:
            known = ", ".join(DISTORTIONS)
            raise DataError(f"distortion_model of {self.place}: {told!r}, there are: {known}")
        if model == "none":
            return model, np.zeros(0)
        found = self.numbers("distortion_coefficients", DISTORTIONS[model])
        return (model, found) if found.any() or model == "equidistant" else ("none", np.zeros(0))

    @cached_property
    def exposures(self) -> Array:
        """Time of exposure [s] and gain of each picture, shape [pictures, 2].

        Raises:
            DataError: if they are not those of its pictures; earlier versions did not write them.
        """
        where = f"{self.key}/exposure.csv"
        kinds = np.dtype([("stamp", "i8"), ("values", "f8", (2,))])
        with reading(where):
            lines = read_lines(self.folder / "exposure.csv", where)
            rows = np.loadtxt(lines, kinds, delimiter=",", ndmin=1)
        if not np.array_equal(rows["stamp"], self.stamps) or not np.all(rows["values"] > 0.0):
            raise DataError(f"{where} has no time and gain above 0 at each stamp of {self.key}")
        return np.asarray(rows["values"])

    @cached_property
    def _modes(self) -> dict[str, str]:
        """Pillow's mode of the pictures of each stream, of which one was read."""
        return {}

    @property
    def straight(self) -> bool:
        """Whether its pictures have no distortion."""
        return self.distortion[0] == "none"

    @property
    def depth_factor(self) -> float:
        """Units of its depth pictures in a metre.

        Raises:
            DataError: if its depth was not recorded, or the factor is not told.
        """
        told = self.channels.get("depth", {}).get("values_per_metre")
        if not isinstance(told, int | float) or told <= 0:
            raise DataError(f"{self.key} has no depth, or no values_per_metre of it above 0")
        return float(told)

    def depth(self, number: int) -> Array:
        """True depth along the optical axis [m], 0 where nothing is, shape [height, width]."""
        path = self.file(number, "depth")
        if path.suffix != ".npy":
            return np.asarray(self.image(number, "depth") / self.depth_factor, np.float64)
        found = stored_array(path, f"{self.key}/depth/{path.name}")
        if found.shape != self.size[::-1]:
            raise DataError(f"{self.key}/depth/{path.name} is of shape {found.shape}")
        return np.nan_to_num(found.astype(np.float64), posinf=0.0)

    def image(self, number: int, channel: str = "data") -> NDArray[Any]:
        """A picture, uint8 or uint16, shape [height, width] or [height, width, channels]."""
        from PIL import Image

        path = self.file(number, channel)
        where = f"{self.key}/{channel}/{path.name}"
        require_file(path, where, most=_LARGEST)
        with reading(where), Image.open(path, formats=("PNG",)) as picture:
            if picture.size != self.size:
                raise DataError(f"{where} has {picture.size} pixels, {self.key} has {self.size}")
            others = self._modes.setdefault(channel, picture.mode)
            if picture.mode != others:
                raise DataError(f"{where} is of mode {picture.mode}, others beside it {others}")
            if picture.mode in ("RGB", "RGBA") and _bits(path) > 8:
                return _deep_colours(path)
            return np.asarray(picture)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedLidar(RecordedSensor):
    """A lidar's sweeps: points in its frame at each point's own time."""

    @cached_property
    def sweep_s(self) -> float:
        """How long a sweep takes [s]; a look at a recording has but some of the sweeps."""
        if "sweep_s" not in self.about:  # of an earlier version
            return 1.0 / self.rate
        found = float(self.numbers("sweep_s", (1,))[0])
        if found <= 0.0:
            raise DataError(f"sweep_s of {self.place}: {found:g}, it must be above 0")
        return found

    @property
    def codes(self) -> Mapping[str, Any]:
        """Instances that are no rock's: what a point is on, and its number."""
        told = self.channels["data"].get("instance", {})
        return told if isinstance(told, Mapping) else {}

    def sweep(self, number: int) -> NDArray[Any]:
        """The points of a sweep, fields x, y, z [m], intensity, ring, time [s], instance."""
        path = self.file(number)
        where = f"{self.key}/data/{path.name}"
        points = stored_array(path, where)
        missing = [name for name in POINT_FIELDS[:6] if name not in (points.dtype.names or ())]
        if missing or points.ndim != 1:
            raise DataError(f"{where} is no row of points: {(*missing, 'one axis')[0]} is missing")
        if not all(np.isfinite(points[name]).all() for name in ("x", "y", "z", "time")):
            raise DataError(f"{where} holds a point that is no number")
        return np.array(points)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedSeries(RecordedSensor):
    """A sensor whose measurements are the rows of a table."""

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The headings behind the stamp, without their units."""
        where = f"{self.key}/data.csv"
        with reading(where):
            head = next(read_lines(self.table_file, where), "")
        if not head.startswith("#timestamp"):
            raise DataError(f"{where}:1: no heading that begins with #timestamp")
        return tuple(name.partition("[")[0].strip() for name in head[1:].strip().split(",")[1:])

    def blocks(self) -> Iterator[tuple[Stamps, Array]]:
        """Stamps and the other columns, some rows at a time, so that a long table can be read."""
        kinds = np.dtype([("stamp", "i8"), ("values", "f8", (len(self.columns),))])
        where, last = f"{self.key}/data.csv", np.zeros(0, np.int64)
        lines = islice(read_lines(self.table_file, where), 1, None)
        while True:
            with reading(where):
                some = list(islice(lines, _BLOCK))
                if not some:
                    return
                rows = np.loadtxt(some, kinds, delimiter=",", ndmin=1, comments=None)
                if not np.isfinite(rows["values"]).all():
                    raise DataError(f"{where}: a value is no number")
            ascending(np.concatenate([last, rows["stamp"]]), where)
            last = rows["stamp"][-1:]
            yield rows["stamp"], rows["values"]

    @cached_property
    def table(self) -> tuple[Stamps, Array]:
        """All stamps [ns] and the other columns, shape [rows, columns]."""
        blocks = list(self.blocks())
        if not blocks:
            raise DataError(f"{self.key}/data.csv has no rows")
        stamps, values = zip(*blocks, strict=True)
        return np.concatenate(stamps), np.concatenate(values)

    @property
    def stamps(self) -> Stamps:
        """When it measured [ns], shape [measurements]."""
        return self.table[0]

    @cached_property
    def span(self) -> tuple[int, ...]:
        """Its first and its last stamp [ns], without its table in memory."""
        ends = [(int(stamps[0]), int(stamps[-1])) for stamps, _ in self.blocks()]
        return (ends[0][0], ends[-1][1]) if ends else ()
