"""What of a recording is asked for, and by how many hands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import OutputError, hint_at
from terrain_forge.sensors import NANOSECONDS, Frames, Instrument

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

    @property
    def span(self) -> tuple[int, int]:
        """The time that is recorded [ns]."""
        last = _EVER if self.end is None else round(self.end * NANOSECONDS)
        return round(self.begin * NANOSECONDS), last

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

    def chosen(self, instruments: Sequence[Instrument]) -> tuple[Instrument, ...]:
        """The instruments of the sensors that are asked for.

        Raises:
            OutputError: for the name of no sensor that can be recorded.
        """
        names = [one.sensor.name for one in instruments]
        for name in self.only:
            if name not in names:
                known = ", ".join(names) or "none"
                raise OutputError(
                    f"--only {name}: no sensor is called so{hint_at(name, names)}, there are: "
                    f"{known}"
                )
        return tuple(one for one in instruments if not self.only or one.sensor.name in self.only)

    def require_some(self, instruments: Sequence[Instrument], *, end: float, path: str) -> None:
        """Refuse a time in which a sensor measures nothing.

        Args:
            instruments: Those that are asked for.
            end: How long the motion lasts [s].
            path: The path's name.

        Raises:
            OutputError: if the recording would end before it begins, or an instrument stays idle.
        """
        if self.begin > end:
            raise OutputError(
                f"--from {self.begin:g}: the recording of path {path!r} ends at {end:.6g} s"
            )
        for one in instruments:
            step = 1.0 / one.sensor.rate_hz
            if isinstance(one, Frames) and end < step:
                raise OutputError(
                    f"path {path!r}: its recording lasts {end:.3g} s, sensor {one.sensor.name!r} "
                    f"takes {step:.3g} s for one measurement"
                )
            if not within(one.times, (self.span,)).any():
                raise OutputError(
                    f"sensor {one.sensor.name!r} measures nothing between {self.begin:g} and "
                    f"{end if self.end is None else min(self.end, end):.6g} s: it does every "
                    f"{step:.3g} s"
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
