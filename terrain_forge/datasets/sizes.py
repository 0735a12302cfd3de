"""About what pictures and sweeps take in other formats, by what they take in a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from terrain_forge.datasets.pictures import RECTIFIED
from terrain_forge.datasets.writer import Footprint
from terrain_forge.model import CameraSensor, LidarSensor

POSE = 170.0
"""A pose and its stamp as text [bytes]."""
_POINT = 26.0
"""A point of a recorded sweep [bytes]."""
_DEEP, _COLOURS = 2.0, 3.0
"""How many times as large pictures of 16 bits or in colour are."""


def cameras(
    footprints: Sequence[Footprint], *channels: str, name: str | None = None
) -> Iterator[tuple[Footprint, CameraSensor]]:
    """Cameras that an option may name and that record some channels."""
    for one in footprints:
        named = isinstance(one.sensor, CameraSensor) and one.is_called(name)
        if named and set(channels) <= one.sizes.keys():
            assert isinstance(one.sensor, CameraSensor)
            yield one, one.sensor


def lidars(footprints: Sequence[Footprint], *, name: str | None = None) -> Iterator[Footprint]:
    """Lidars that an option may name."""
    return (o for o in footprints if isinstance(o.sensor, LidarSensor) and o.is_called(name))


def tables(footprints: Sequence[Footprint]) -> Iterator[Footprint]:
    """All else: tables and the truth."""
    frames = CameraSensor, LidarSensor
    return (one for one in footprints if not isinstance(one.sensor, frames))


def points(lidar: Footprint) -> float:
    """Points of a sweep."""
    return lidar.sizes["data"] / _POINT


def picture(camera: Footprint, *, to_grey: bool = False) -> float:
    """Bytes of a PNG of 8 bits, without distortion where there is one."""
    sensor = camera.sensor
    assert isinstance(sensor, CameraSensor)
    size = camera.sizes[RECTIFIED if RECTIFIED in camera.sizes else "data"]
    size /= _DEEP if sensor.bits > 8 else 1.0
    return size / (_COLOURS if sensor.colour and to_grey else 1.0)


def depth(camera: Footprint) -> float:
    """Bytes of a PNG of depth, of a recording's .npy 0.7 for each 4."""
    sensor = camera.sensor
    assert isinstance(sensor, CameraSensor)
    share = 0.7 / 4.0 if sensor.depth_factor is None else 1.0
    return share * camera.sizes["depth"]
