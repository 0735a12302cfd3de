"""The recording that a recipe asks for: along which path, moved by what, in which formats."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from terrain_forge.base import FileName, Idle, NotNegative, Options, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class DatasetSpec(Spec):
    """What `terrain-forge record` records with the rover's sensors."""

    path: FileName | None = None
    """Name of the path; the first by default."""
    motion: Literal["path", "drive"] = "path"
    """How the rover moves: `path`, as the path says, without a jolt; `drive`, as the rover with its
    suspension drives along it in the simulation."""
    still_s: Annotated[float, Interval(ge=0, le=3600)] = 3.0
    """How long it stands before it starts and, at the end of a path that nothing drives, after it
    stopped [s]; systems with an IMU need it to begin with."""
    ramp_s: Annotated[float, Interval(ge=0, le=60)] = 2.0
    """How long it takes to start and to stop along a path [s]."""
    tracks: Literal["behind", "none"] = "behind"
    """Whether the wheels leave tracks behind the rover, which cameras see."""
    pebbles_min_m: NotNegative = 0.0
    """Smallest pebbles near the paths that cameras and lidars see [m]; 0 for none. Their number is
    what the law of the recipe's smallest rocks gives on down to there; nothing else knows of
    them."""
    pebbles_within_m: Positive = 2.0
    """How far from a path they lie, at most [m]."""
    gravity_m_s2: Literal["body"] | Annotated[float, Interval(ge=0, le=1000)] = "body"
    """What accelerometers feel at rest [m/s²]: the body's own gravity, or a number, since several
    systems know of 9.81 alone."""
    formats: tuple[FileName, ...] | dict[FileName, Options] = ("euroc",)
    """Formats of the dataset: a list, or a mapping from their names to their options; `euroc`, of
    which the others are made, is always among them."""
    profile: Literal["full", "quick"] = "full"
    """`quick` records a first look: pictures of half the size, few and without truth channels, and
    fewer sweeps."""

    def idle(self) -> Iterator[Idle]:
        """Where pebbles would lie that there are none of, and the start of a path not followed."""
        if self.pebbles_min_m == 0.0:
            yield Idle("pebbles_within_m", "there are no pebbles; give pebbles_min_m")

    def gravity(self, own: float) -> float:
        """What is felt [m/s²] on a body of some gravity."""
        return own if self.gravity_m_s2 == "body" else self.gravity_m_s2
