"""What a recipe can ask of the validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Interval

from terrain_forge.base import FileName, Fraction, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class DriveSpec(Spec):
    """A drive of the rover along a path, and the limits that it must keep."""

    path: FileName
    """Name of the path to drive."""
    cross_track_m: Positive = 0.5
    """Largest distance from the path [m]."""
    tilt_deg: Annotated[float, Interval(gt=0, lt=90)] = 35.0
    """Largest tilt of the rover's body from the vertical [deg]."""
    time_factor: Annotated[float, Ge(1)] = 2.0
    """Longest duration, as a multiple of the path's own."""
    film: bool = True
    """Whether to make an animated picture of the drive."""


@dataclass(frozen=True, kw_only=True)
class StartsSpec(Spec):
    """Many drives straight on, from starts and in directions that are drawn at random."""

    count: Annotated[int, Interval(ge=1, le=10_000)]
    """How many."""
    length_m: Annotated[float, Interval(ge=1, le=1000)] = 10.0
    """How far each goes [m]."""
    speed_m_s: Annotated[float, Interval(ge=0.01, le=10)] = 0.3
    """Speed [m/s]; at most the rover's own."""
    arrive: Fraction = 0.0
    """Part of them that must arrive."""


@dataclass(frozen=True, kw_only=True)
class ValidateSpec(Spec):
    """What is checked after a build."""

    drive: FileName | DriveSpec | None = None
    """The path that the rover must drive: its name, or a mapping with limits; none if left out."""
    drives: Annotated[int, Interval(ge=1, le=10_000)] | StartsSpec | None = None
    """Drives straight on from so many random starts: their number, or a mapping; none if left
    out."""
    points: Annotated[int, Interval(ge=1, le=1_000_000)] = 2000
    """Random points at which each format's ground is compared with the world's."""
    consumers: Literal["quick", "all"] = "quick"
    """`all` opens every export in every program that reads its format and is installed, which
    `terrain-forge validate` does in any case; `quick` compares the ground alone, and of MJCF the
    rocks."""

    @property
    def drive_spec(self) -> DriveSpec | None:
        """The drive with its limits, where one is asked for."""
        return DriveSpec(path=self.drive) if isinstance(self.drive, str) else self.drive

    @property
    def starts_spec(self) -> StartsSpec | None:
        """The drives from many starts, where they are asked for."""
        return StartsSpec(count=self.drives) if isinstance(self.drives, int) else self.drives
