"""Reading a recording: what is there, checked, each measurement when it is asked for."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import (
    Array,
    DataError,
    ExportError,
    checked,
    inverse_pose,
    portable,
    read_lines,
    read_text,
    reading,
)
from terrain_forge.datasets.poses import Poses, Stamps
from terrain_forge.datasets.streams import (
    RecordedCamera,
    RecordedLidar,
    RecordedSensor,
    RecordedSeries,
    ascending,
)

VERSION = 1
"""Of the layout of a recording, as its dataset.json says."""
_MOST_CRS = 60_000
"""Bytes of WKT: LAS holds some more."""
INDEX = "dataset.json"
BASE = "base_link"
"""The rover's own frame."""
TRUTH = "state_groundtruth_estimate0"
_LARGEST_TEXT = 2**24
_PARALLEL = 1e-9
"""How far the second camera of a pair may be off the first one's x axis, for its distance."""
_KINDS: dict[str, type[RecordedSensor]] = {"camera": RecordedCamera, "lidar": RecordedLidar}


@dataclass(frozen=True, kw_only=True, eq=False)
class StereoPair:
    """Two cameras side by side that take their pictures at once."""

    left: RecordedCamera
    """The left one."""
    right: RecordedCamera
    """The right one."""
    baseline: float
    """Their distance [m]."""

    @property
    def alike(self) -> bool:
        """Whether both have the same focal lengths and principal point."""
        return bool(np.array_equal(self.left.intrinsics, self.right.intrinsics))

    @property
    def rectified(self) -> bool:
        """Whether both pictures are those of one pinhole, moved along its rows."""
        return self.left.straight and self.right.straight and self.alike


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """A recorded dataset on disk."""

    folder: Path
    """The folder that holds dataset.json."""
    about: Mapping[str, Any]
    """What dataset.json says."""
    sensors: tuple[RecordedSensor, ...]
    """What was recorded, in the order of dataset.json."""

    @property
    def cameras(self) -> tuple[RecordedCamera, ...]:
        """Its cameras."""
        return tuple(s for s in self.sensors if isinstance(s, RecordedCamera))

    @property
    def lidars(self) -> tuple[RecordedLidar, ...]:
        """Its lidars."""
        return tuple(s for s in self.sensors if isinstance(s, RecordedLidar))

    def series(self, word: str) -> tuple[RecordedSeries, ...]:
        """Its tables whose folders begin with a word: `imu`, `odometry`, `sun`, …."""
        found = (s for s in self.sensors if isinstance(s, RecordedSeries))
        return tuple(one for one in found if one.word_of_folder == word)

    @property
    def imus(self) -> tuple[RecordedSeries, ...]:
        """Its IMUs."""
        return self.series("imu")

    def sensor(self, name: str) -> RecordedSensor:
        """The sensor of a name, or of a folder such as `cam0`.

        Raises:
            DataError: if there is none; lists what there is.
        """
        for one in self.sensors:
            if name in (one.key, one.name):
                return one
        known = ", ".join(f"{one.key} ({one.name})" for one in self.sensors)
        raise DataError(f"no sensor {name!r} was recorded, there are: {known}")

    def recipe_of(self, sensor: RecordedSensor) -> Mapping[str, Any]:
        """What the recipe says of a sensor; nothing where dataset.json does not have it."""
        told = {one.get("name"): one for one in self.about.get("sensors", ())}
        pair = re.sub("_(left|right)$", "", sensor.name)
        found: Mapping[str, Any] = told.get(sensor.name) or told.get(pair) or {}
        return found

    @property
    def name(self) -> str:
        """Name of the world."""
        return str(self.about["world"]["name"])

    @property
    def crs(self) -> str:
        """WKT of the CRS whose east and north are the world's; empty where it has none."""
        return str(self.about["world"].get("crs", ""))

    @property
    def gravity(self) -> float:
        """What its IMUs feel at rest [m/s²]."""
        return float(self.about["gravity_m_s2"])

    @property
    def body_name(self) -> str:
        """The frame that T_BS and the truth are of: the first IMU's folder, or `base_link`."""
        return str(self.about["body"])

    @cached_property
    def base_from_body(self) -> Array:
        """From the body's frame to base_link's where the rover stands, shape [4, 4]."""
        if self.body_name == BASE:
            return np.eye(4)
        told = self.about["transforms"].get(self.body_name)
        with reading(f"transforms of {INDEX}"):
            return np.array(told, np.float64).reshape(4, 4)

    def base_pose(self, sensor: RecordedSensor) -> Array:
        """From a sensor's frame to base_link's where the rover stands, shape [4, 4]."""
        return np.asarray(portable.product(self.base_from_body, sensor.body_pose))

    def link_of(self, key: str) -> str:
        """The link that the sensor of a folder moves with: base_link, or one of `moving_links`."""
        link = self._links.get(key, BASE)
        return link if link in self.about.get("moving_links", ()) else BASE

    @cached_property
    def _links(self) -> Mapping[str, str]:
        """Links by folders; recordings of earlier versions tell them in the recipe's sensors."""
        told: Mapping[str, str] | None = self.about.get("links")
        if told is not None:
            return told
        return {one.key: self.recipe_of(one).get("link", BASE) for one in self.sensors}

    def carrier(self, sensor: RecordedSensor) -> tuple[Poses, Array]:
        """Poses, at the truth's rate, of what a sensor is fixed to, and its own there, [4, 4].

        Raises:
            ExportError: if it sits on a moving link that the body does not sit on.
        """
        link = self.link_of(sensor.key)
        if link == self.link_of(self.body_name):
            return self.body_poses, sensor.body_pose
        if link == BASE:
            return self.base_poses, self.base_pose(sensor)
        raise ExportError(
            f"{sensor.name!r} cannot be followed between its own stamps: it sits on {link!r}, "
            f"which moves against base_link and {self.body_name}"
        )

    @cached_property
    def pairs(self) -> tuple[StereoPair, ...]:
        """Its stereo pairs: cameras of one size, parallel, beside each other, at equal stamps."""
        found = []
        for left in self.cameras:
            for right in self.cameras:
                offset = portable.product(inverse_pose(left.body_pose), right.body_pose)
                baseline = float(offset[0, 3])
                flat = offset - np.eye(4)
                flat[0, 3] = 0.0
                beside = baseline > 0.0 and np.abs(flat).max() <= max(baseline, 1.0) * _PARALLEL
                beside &= self.link_of(left.key) == self.link_of(right.key)
                at_once = np.array_equal(left.stamps, right.stamps)
                if beside and left.size == right.size and at_once and left.span:
                    found.append(StereoPair(left=left, right=right, baseline=baseline))
        return tuple(found)

    @cached_property
    def body_poses(self) -> Poses:
        """The truth: where the body is in the world, at the rate of its IMU."""
        kept = [(stamps, values[:, :7].copy()) for stamps, values in self._truth_blocks()]
        if not kept:
            raise DataError(f"{TRUTH}/data.csv has no rows")
        stamps, values = (np.concatenate(part) for part in zip(*kept, strict=True))
        return Poses(stamps=stamps, position=values[:, :3], quaternion=values[:, 3:])

    def body_pieces(self) -> Iterator[tuple[Poses, Array, slice]]:
        """The truth in pieces: poses of the body, its velocity in the world [m/s], its own rows.

        Beside its own rows may lie the one before and the one after.
        """
        before: tuple[Stamps, Array] | None = None
        blocks = self._truth_blocks()
        block = next(blocks, None)
        while block is not None:
            after = next(blocks, None)
            first = [] if before is None else [(before[0][-1:], before[1][-1:])]
            last = [] if after is None else [(after[0][:1], after[1][:1])]
            stamps, v = (np.concatenate(c) for c in zip(*first, block, *last, strict=True))
            poses = Poses(stamps=stamps, position=v[:, :3], quaternion=v[:, 3:7])
            yield poses, v[:, 7:10], slice(len(first), len(first) + len(block[0]))
            before, block = block, after

    def _truth_blocks(self) -> Iterator[tuple[Stamps, Array]]:
        for stamps, values in self.truth.blocks():
            if values.shape[1] < 10:
                columns = values.shape[1] + 1
                raise DataError(f"{TRUTH}/data.csv has {columns} columns, EuRoC's has 17")
            yield stamps, values

    @cached_property
    def span(self) -> tuple[int, int]:
        """The first and the last stamp of all sensors and of the truth [ns].

        Raises:
            DataError: if nothing was recorded.
        """
        ends = [stamp for one in (*self.sensors, self.truth) for stamp in one.span]
        if not ends:
            raise DataError(f"nothing was recorded in {self.folder}")
        return min(ends), max(ends)

    @cached_property
    def truth(self) -> RecordedSeries:
        """EuRoC's table of the truth."""
        folder = self.folder / "mav0" / TRUTH
        return RecordedSeries(folder=folder, name="truth", about={}, channels={"data": {}})

    def truth_of(self, sensor: RecordedSensor) -> Poses:
        """Exact poses of a sensor's own frame in the world, at its own stamps."""
        poses = self._truth_file(sensor.key)
        if len(poses) != len(sensor.stamps) or np.abs(poses.stamps - sensor.stamps).max() > 1000:
            raise DataError(f"truth/{sensor.key}.tum is not at the stamps of {sensor.key}")
        return Poses(stamps=sensor.stamps, position=poses.position, quaternion=poses.quaternion)

    @cached_property
    def base_poses(self) -> Poses:
        """Where base_link is in the world, at the stamps of the body's truth."""
        return self._truth_file(BASE)

    def _truth_file(self, name: str) -> Poses:
        path, where = self.folder / "truth" / f"{name}.tum", f"truth/{name}.tum"
        with reading(where):
            lines = (line.replace(".", " ", 1) for line in read_lines(path, where))
            rows = np.loadtxt(lines, _TUM, ndmin=1)
            values = rows["values"]
            if not np.isfinite(values).all():
                raise DataError(f"{where}: a value is no number")
            length = portable.norm(values[:, 3:])
            if np.abs(length - 1.0).max(initial=0.0) > 1e-6:
                row = int(np.argmax(np.abs(length - 1.0)))
                raise DataError(f"{where}:{row + 1}: its quaternion is not of length one")
        stamps = rows["second"] * 10**9 + rows["fraction"]
        ascending(stamps, where)
        turns = np.roll(values[:, 3:], 1, axis=1)
        return Poses(stamps=stamps, position=values[:, :3], quaternion=turns)


_TUM = np.dtype([("second", "i8"), ("fraction", "i8"), ("values", "f8", (7,))])


@checked
def open_recording(folder: Path | str) -> Recording:
    """A recorded dataset; pictures, sweeps and tables are read when they are asked for.

    Args:
        folder: The folder `dataset` of a built world, or the world's own.

    Raises:
        DataError: if there is none, or a file of it is broken; names the file.
    """
    place = Path(folder)
    if not (place / INDEX).exists() and (place / "dataset" / INDEX).exists():
        place = place / "dataset"
    if not (place / INDEX).exists():
        raise DataError(
            f"{folder} holds no recording (no {INDEX}): `terrain-forge record` of a built world "
            "makes one"
        )
    text = read_text(place / INDEX, f"{place / INDEX}", most=_LARGEST_TEXT)
    with reading(INDEX):
        about = json.loads(text, object_pairs_hook=_stated)
    _check(about)
    return Recording(
        folder=place,
        about=about,
        sensors=tuple(_sensor(place, stream) for stream in about["streams"]),
    )


_NEEDED: dict[str, Any] = {
    "world": dict, "gravity_m_s2": int | float, "streams": list, "body": str, "transforms": dict,
    "classes": dict,
}  # fmt: skip
"""Kinds of what an index has."""
_KNOWN: dict[str, Any] = {
    "sensors": list, "links": dict, "moving_links": list, "motion": dict, "profile": str
}  # fmt: skip
"""Kinds of what those of some versions lack."""
_MOTION: dict[str, Any] = {
    "path": str, "source": str, "duration_s": int | float, "still_s": int | float
}  # fmt: skip
_STREAM: dict[str, Any] = {
    "folder": str, "name": str, "kind": str, "table": bool, "count": int, "first_ns": int,
    "last_ns": int, "channels": dict,
}  # fmt: skip
_CHANNEL: dict[str, Any] = {
    "suffix": str, "bits": int, "values_per_metre": int | float, "instance": dict
}  # fmt: skip
"""Kinds of what its motion, a stream of it, and a channel of that may have."""


def _stated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A table of keys without those of null, which says no more than none."""
    return {key: value for key, value in pairs if value is not None}


def _require_kinds(told: Mapping[str, Any], kinds: Mapping[str, Any], where: str) -> None:
    for key, kind in kinds.items():
        if key in told and not isinstance(told[key], kind):
            raise DataError(f"{where}: its {key!r} is not of the kind that it must be")


def _check(about: Any) -> None:
    if not isinstance(about, dict) or about.get("version") != VERSION:
        found = about.get("version") if isinstance(about, dict) else type(about).__name__
        raise DataError(f"{INDEX} is of version {found!r}, this terrain-forge reads {VERSION}")
    for key, kind in _NEEDED.items():
        if not isinstance(about.get(key), kind):
            raise DataError(f"{INDEX} has no {key!r} of the kind that it must be")
    _require_kinds(about, _KNOWN, INDEX)
    _require_kinds(about.get("motion", {}), _MOTION, f"{INDEX}: motion")
    if not isinstance(about["world"].get("name"), str):
        raise DataError(f"{INDEX} has no name of the world")
    crs = about["world"].get("crs", "")
    if not isinstance(crs, str) or len(crs.encode()) > _MOST_CRS:
        raise DataError(f"{INDEX}: the world's CRS is no WKT of at most {_MOST_CRS} bytes")
    if not all(isinstance(one, dict) for one in about.get("sensors", ())):
        raise DataError(f"{INDEX}: its sensors are no tables of keys")
    if not all(number.isdecimal() for number in about["classes"]):
        raise DataError(f"{INDEX}: its classes are no numbers")
    for number, stream in enumerate(about["streams"]):
        if not isinstance(stream, dict) or not {"folder", "name", "kind"} <= set(stream):
            raise DataError(f"{INDEX}: stream {number} has no folder, name and kind")
        where = f"{INDEX}: stream {number}"
        _require_kinds(stream, _STREAM, where)
        for name, one in stream.get("channels", {}).items():
            if not isinstance(one, dict):
                raise DataError(f"{where}: channel {name!r} is no table of keys")
            _require_kinds(one, _CHANNEL, f"{where}: channel {name!r}")
    for folder, count in Counter(one["folder"] for one in about["streams"]).items():
        if count > 1:
            raise DataError(f"{INDEX}: the stream {folder!r} is listed {count} times")


def _sensor(place: Path, stream: Mapping[str, Any]) -> RecordedSensor:
    from ruamel.yaml import YAML

    folder = place / stream["folder"]
    if not folder.resolve().is_relative_to(place.resolve()):
        raise DataError(f"{INDEX}: the stream {stream['folder']!r} lies outside of the dataset")
    where = f"{folder.name}/sensor.yaml"
    text = read_text(folder / "sensor.yaml", where, most=_LARGEST_TEXT)
    with reading(where):
        about = YAML(typ="safe", pure=True).load(text)
        if not isinstance(about, dict):
            raise DataError(f"{where} is no table of keys")
    # Earlier versions recorded no other files than pictures and sweeps.
    other = RecordedSeries if stream.get("table", True) else RecordedSensor
    kind = _KINDS.get(stream["kind"], other)
    channels = stream.get("channels") or {"data": {}}
    return kind(folder=folder, name=stream["name"], about=about, channels=channels)
