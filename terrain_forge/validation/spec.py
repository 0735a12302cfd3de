"""What a recipe can ask of the validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Interval

from terrain_forge.specs import FileName, Positive, Spec


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


@dataclass(frozen=True, kw_only=True)
class ValidateSpec(Spec):
    """What is checked after a build."""

    drive: FileName | DriveSpec | None = None
    """The path that the rover must drive: its name, or a mapping with limits; none if left out."""
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
