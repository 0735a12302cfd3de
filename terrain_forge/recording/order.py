"""What of a recording is asked for, and by how many hands."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import OutputError, hint_at
from terrain_forge.model import Sensor
from terrain_forge.recording.rig import Folder
from terrain_forge.sensors import NANOSECONDS, Motion

Spans = tuple[tuple[int, int], ...]
"""Times [ns], each from one up to but without another, ascending and apart."""
_EVER = 2**62


@dataclass(frozen=True, kw_only=True)
class Order:
    """Which part of a recording is made."""

    begin: float = 0.0
    """From when [s]."""
    end: float | None = None
    """Until when [s], which is not part of it; None for all that follows."""
    only: tuple[str, ...] = ()
    """Names of the sensors; all, where none is named."""
    workers: int | None = None
    """How many measurements are made at once; None for one a processor core."""
    force: bool = False
    """Whether another recording of ours in the folder is replaced."""
    all_formats: bool = True
    """Whether a format that lacks something is refused; else it is left out, and told."""

    @property
    def span(self) -> tuple[int, int]:
        """The time that is recorded [ns]."""
        last = np.inf if self.end is None else self.end
        begin, end = (round(min(time * NANOSECONDS, _EVER)) for time in (self.begin, last))
        return begin, end

    def require(self) -> None:
        """Refuse times and numbers that no recording has.

        Raises:
            OutputError: says which.
        """
        if self.begin < 0.0 or not np.isfinite(self.begin):
            raise OutputError(f"--from {self.begin:g}: a recording begins at 0 s")
        if self.end is not None and not self.end > self.begin:
            raise OutputError(f"--to {self.end:g}: it must be after --from {self.begin:g}")
        if self.workers is not None and self.workers < 1:
            raise OutputError(f"--workers {self.workers}: at least 1")

    def require_named(self, rig: Sequence[Sensor]) -> None:
        """Refuse names of sensors that a rig does not carry; a kind may yet not be measured.

        Raises:
            OutputError: for the name of no sensor.
        """
        simple = [part.name for sensor in rig for part in sensor.simple]
        self._require_named([*simple, *(sensor.name for sensor in rig)])

    def chosen(self, folders: Sequence[Folder], rig: Sequence[Sensor]) -> tuple[Folder, ...]:
        """The folders of the sensors that are asked for; a stereo pair's name stands for both.

        Raises:
            OutputError: for the name of no sensor that can be recorded.
        """
        parts = {one.sensor.name: (one.sensor.name,) for one in folders}
        pairs = {s.name: tuple(part.name for part in s.simple if part.name in parts) for s in rig}
        known = {name: of for name, of in {**parts, **pairs}.items() if of}
        self._require_named(known)
        wanted = {part for name in self.only or known for part in known[name]}
        return tuple(one for one in folders if one.sensor.name in wanted)

    def _require_named(self, known: Collection[str]) -> None:
        for name in self.only:
            if name not in known:
                raise OutputError(
                    f"--only {name}: no sensor that is recorded is called so"
                    f"{hint_at(name, known)}, there are: "
                    f"{', '.join(dict.fromkeys(known)) or 'none'}"
                )

    def require_some(self, folders: Sequence[Folder], motion: Motion) -> None:
        """Refuse a time in which there is no motion, or a sensor measures nothing.

        Raises:
            OutputError: says which.
        """
        begin, end = self.begin, motion.end
        if begin > end:
            raise OutputError(
                f"--from {begin:g}: the motion along {motion.path!r} ends at {end:.6g} s"
            )
        for one in folders:
            name, step = one.sensor.name, 1.0 / one.rate
            if not one.is_table and end < step:
                raise OutputError(
                    f"path {motion.path!r}: its recording lasts {end:.3g} s, sensor {name!r} takes "
                    f"{step:.3g} s for one measurement"
                )
            if not within(one.times, (self.span,)).any():
                last = end if self.end is None else min(self.end, end)
                raise OutputError(
                    f"sensor {name!r} measures nothing between {begin:g} and {last:.6g} s: it does "
                    f"every {step:.3g} s"
                )


def within(times: NDArray[np.int64], spans: Spans) -> NDArray[np.bool_]:
    """Which times [ns] lie in spans."""
    inside = np.zeros(len(times), np.bool_)
    for begin, end in spans:
        inside |= (begin <= times) & (times < end)
    return inside


def joined(spans: Spans) -> Spans:
    """Spans in order, of which no two touch."""
    found: list[tuple[int, int]] = []
    for begin, end in sorted(spans):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], end)
        else:
            found.append((begin, end))
    return tuple(found)
