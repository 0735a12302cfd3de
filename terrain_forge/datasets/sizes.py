"""About what pictures and sweeps take in other formats, by what they take in a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from terrain_forge.base import reading
from terrain_forge.datasets.pictures import RECTIFIED
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.streams import (
    RecordedCamera,
    RecordedLidar,
    RecordedSensor,
    RecordedSeries,
    stored_size,
)

CAMERA, LIDAR = "camera", "lidar"
_WORDS: dict[type[RecordedSensor], str] = {RecordedCamera: CAMERA, RecordedLidar: LIDAR}
POSE = 170.0
"""A pose and its stamp as text [bytes]."""
_POINT = 26.0
"""A point of a recorded sweep [bytes]."""
_PART = 2**20
"""Bytes of a table that are read at a time."""
_DEEP = 2.0
"""How many times as large pictures of 16 bits are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Footprint:
    """About what the measurements of one sensor take in a recording, or the truth's rows."""

    key: str
    """The name of its folder, such as `cam0`."""
    name: str
    """The sensor's name, of a stereo pair that of one of the two; empty for the truth."""
    kind: str
    """The sensor's kind, such as `camera`; `truth`."""
    count: float
    """How many measurements there are."""
    sizes: Mapping[str, float]
    """Bytes of one by its streams, such as `data` and `depth`."""
    pixels: int = 0
    """Of a picture."""
    colours: int = 1
    """Values of a pixel."""
    bits: int = 8
    """Bits of a value."""
    preset: str = ""
    """That of the sensor."""

    @property
    def size(self) -> float:
        """Bytes of all."""
        return self.count * sum(self.sizes.values())

    def is_called(self, name: str | None) -> bool:
        """Whether an option that names a sensor, or none, may mean it."""
        return name in (None, "", self.key, self.name)


def footprints_of(recording: Recording) -> list[Footprint]:
    """What the sensors of a recording and its truth take; no measurement is read.

    Raises:
        DataError: if a table cannot be read.
    """
    found = [_footprint(recording, one) for one in recording.sensors]
    return [*found, _table(recording.truth, name="", kind="truth")]


def _footprint(recording: Recording, one: RecordedSensor) -> Footprint:
    if isinstance(one, RecordedSeries):
        return _table(one, name=one.name, kind=one.word_of_folder)
    count, about = len(one.stamps), one.channels.get("data", {})
    width, height = one.size if isinstance(one, RecordedCamera) else (0, 0)
    return Footprint(
        key=one.key,
        name=one.name,
        kind=_WORDS.get(type(one), one.word_of_folder),
        count=count,
        sizes={
            channel: stored_size(one.file(n, channel) for n in range(count)) / max(count, 1)
            for channel in one.channels
        },
        pixels=width * height,
        colours=3 if about.get("colour") else 1,
        bits=int(about.get("bits", 8)),
        preset=str(recording.recipe_of(one).get("preset", "")),
    )


def _table(table: RecordedSeries, *, name: str, kind: str) -> Footprint:
    with reading(f"{table.key}/data.csv"), table.table_file.open("rb") as file:
        rows = sum(part.count(b"\n") for part in iter(lambda: file.read(_PART), b"")) - 1
    sizes = {"data": stored_size([table.table_file]) / max(rows, 1)}
    return Footprint(key=table.key, name=name, kind=kind, count=max(rows, 0), sizes=sizes)


def cameras(
    footprints: Sequence[Footprint], *channels: str, name: str | None = None
) -> Iterator[Footprint]:
    """Cameras that an option may name and that record some channels."""
    for one in footprints:
        if one.kind == CAMERA and one.is_called(name) and set(channels) <= one.sizes.keys():
            yield one


def lidars(footprints: Sequence[Footprint], *, name: str | None = None) -> Iterator[Footprint]:
    """Lidars that an option may name."""
    return (one for one in footprints if one.kind == LIDAR and one.is_called(name))


def tables(footprints: Sequence[Footprint]) -> Iterator[Footprint]:
    """All else: tables and the truth."""
    return (one for one in footprints if one.kind not in (CAMERA, LIDAR))


def points(lidar: Footprint) -> float:
    """Points of a sweep."""
    return lidar.sizes["data"] / _POINT


def picture(camera: Footprint, *, to_grey: bool = False) -> float:
    """Bytes of a PNG of 8 bits, without distortion where there is one."""
    size = camera.sizes[RECTIFIED if RECTIFIED in camera.sizes else "data"]
    size /= _DEEP if camera.bits > 8 else 1.0
    return size / (camera.colours if to_grey else 1.0)


def depth(camera: Footprint) -> float:
    """Bytes of a PNG of depth, 0.7 for each pixel of a recording's .npy, which has 4."""
    size = camera.sizes["depth"]
    return 0.7 * camera.pixels if size >= 4 * camera.pixels else size
