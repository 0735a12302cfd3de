"""Names of the frames that a recording's sensors measure in, as ROS has them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from terrain_forge.datasets.reader import BASE, Recording
from terrain_forge.datasets.streams import RecordedCamera, RecordedSensor

WORLD = "map"
"""The world's frame."""


def frames_of(recording: Recording) -> dict[str, str]:
    """Names of the sensors' frames by their folders, each another.

    A sensor's frame has its own name, or its folder's where that has letters that ROS's names do
    not, or where another frame has it; a camera's is optical: x right, y down, z forward.
    """
    found: dict[str, str] = {}
    taken = {BASE, WORLD}
    for sensor in sorted(recording.sensors, key=lambda one: not _is_plain(one.name)):
        name = next(name for name in _names(sensor) if name not in taken)
        taken.add(name)
        found[sensor.key] = name
    return found


def is_own(sensor: RecordedSensor, frame: str) -> bool:
    """Whether a frame has the name of its sensor."""
    return frame == sensor.name + _ending(sensor)


def _names(sensor: RecordedSensor) -> Iterator[str]:
    """What its frame may be called, best first."""
    ending = _ending(sensor)
    if _is_plain(sensor.name):
        yield sensor.name + ending
    yield sensor.key + ending
    for number in count(2):
        yield f"{sensor.key}_{number}{ending}"


def _ending(sensor: RecordedSensor) -> str:
    return "_optical" if isinstance(sensor, RecordedCamera) else ""


def _is_plain(name: str) -> bool:
    return name.isascii() and name.replace("_", "a").isalnum()
