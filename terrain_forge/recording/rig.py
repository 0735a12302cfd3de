"""The folders of a recording: which sensor's each is, and where that sensor sits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inverse_pose, is_file_name, placed, portable, returning
from terrain_forge.model import Sensor
from terrain_forge.sensors import OPTICAL, Frames, Instrument, State, Stream

QUICK = 5.0
"""Measurements of a look at a recording per second [Hz]."""
_CAMERAS = "cam"
"""Folders of those whose poses are told in the optical frame."""


@dataclass(frozen=True, kw_only=True)
class Folder:
    """A folder of a recording: what one instrument measures."""

    name: str
    """Below `mav0`: `cam0`, `lidar0`, …"""
    instrument: Instrument
    """What measures."""
    every: int = 1
    """Of its measurements every such one is recorded, from the first on."""

    @cached_property
    def times(self) -> NDArray[np.int64]:
        """When it measures what is recorded, from 0 [ns], ascending."""
        return self.instrument.times[:: self.every]

    @property
    def rate(self) -> float:
        """Measurements that are recorded per second [Hz]."""
        return self.sensor.rate_hz / self.every

    @property
    def sensor(self) -> Sensor:
        """The sensor; of a stereo pair one of the two."""
        return self.instrument.sensor

    @property
    def optical(self) -> bool:
        """Whether its frame is the optical one of a camera."""
        return self.instrument.folder == _CAMERAS

    @property
    def is_table(self) -> bool:
        """Whether it is one table, not files of their own."""
        return not isinstance(self.instrument, Frames)

    @cached_property
    def streams(self) -> dict[str, Stream]:
        """Its streams by the names of their folders."""
        what = f"instrument {self.instrument.kind!r}: streams"
        with returning(self.instrument, what, "Streams whose names can name folders"):
            streams = self.instrument.streams()
            if not streams:
                raise ValueError("found none")
            for one in streams:
                if not isinstance(one, Stream):
                    raise TypeError(f"found {one!r:.40}")
                if not (is_file_name(one.name) and is_file_name(f"0{one.suffix}")):
                    raise ValueError(f"found {one.name!r} with {one.suffix!r}")
        return {stream.name: stream for stream in streams}

    @cached_property
    def at_rest(self) -> Array:
        """From its frame to that of base_link where the rover stands, shape [4, 4]."""
        (place, turn), rover = self.instrument.mount, self.instrument.setting.world.rover
        if self.optical:
            turn = portable.product(turn, OPTICAL)
        return placed(rover.origins[self.sensor.link] + place, turn)

    def state(self, times: NDArray[np.int64]) -> State:
        """How its frame stands and moves in the world at times from 0 [ns]."""
        state = self.instrument.state(times / 1e9)
        return state.at_mount(np.zeros(3), OPTICAL) if self.optical else state


def folders_of(instruments: Sequence[Instrument], *, quick: bool) -> tuple[Folder, ...]:
    """The folders of some instruments, numbered in their order.

    Args:
        instruments: The instruments.
        quick: Whether those that measure files of their own do so at `QUICK` at most.
    """
    found = []
    for name, instrument in zip(folder_names(map(type, instruments)), instruments, strict=True):
        few = quick and isinstance(instrument, Frames)
        every = quick_step(instrument.sensor.rate_hz) if few else 1
        found.append(Folder(name=name, instrument=instrument, every=every))
    return tuple(found)


def quick_step(rate: float) -> int:
    """Of so many measurements one is recorded in a look at a recording, by their rate [Hz]."""
    return max(ceil(rate / QUICK - 1e-9), 1)


def folder_names(kinds: Iterable[type[Instrument]]) -> Iterator[str]:
    """What the folders of some instruments are called, numbered by kind in their order."""
    numbers: Counter[str] = Counter()
    for kind in kinds:
        yield f"{kind.folder}{numbers[kind.folder]}"
        numbers[kind.folder] += 1


def body_of(folders: Sequence[Folder]) -> Folder | None:
    """Whose frame is the body's: the first IMU's; None where there is none, and it is base_link."""
    return next((one for one in folders if one.instrument.kind == "imu"), None)


def from_body(folder: Folder, body: Folder | None) -> Array:
    """From a folder's frame to the body's where the rover stands, shape [4, 4]."""
    if body is None:
        return folder.at_rest
    return portable.product(inverse_pose(body.at_rest), folder.at_rest)
