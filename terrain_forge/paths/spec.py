"""The recipe's `paths` part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Interval, Le, MinLen

from terrain_forge.specs import FileName, NotNegative, Pair, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class Spline(Spec):
    """A smooth curve through given points."""

    kind: Literal["spline"] = "spline"
    points_m: Annotated[tuple[Pair, ...], MinLen(2)]
    """Points, metres east and north of the site's centre."""
    closed: bool = False
    """Whether it returns to its first point, with the direction that it left it."""


@dataclass(frozen=True, kw_only=True)
class Shake(Spec):
    """Vibration of the body: band-limited noise on roll, pitch and yaw."""

    rms_deg: Annotated[float, Interval(ge=0, le=20)] = 0.0
    """RMS of each angle [degrees]."""
    cutoff_hz: Positive = 2.0
    """Highest frequency in it [Hz]; at most half the path's rate."""


@dataclass(frozen=True, kw_only=True)
class Corridor(Spec):
    """A strip along the path that is kept free of rocks."""

    width_m: Annotated[float, Interval(ge=0, le=100)] | None = None
    """Width of the strip [m]; 0 for none; without it the rover's width and 0.4 m."""
    clearance_m: NotNegative = 0.15
    """Height above the ground that no rock in the strip exceeds [m]."""


@dataclass(frozen=True, kw_only=True)
class PathSpec(Spec):
    """A path of the rover over the ground."""

    name: FileName
    """Name of the path and of its files."""
    route: Spline
    """Where it goes."""
    speed_m_s: Annotated[float, Interval(ge=0.001, le=100)]
    """Speed along the route [m/s]."""
    rate_hz: Annotated[float, Ge(0.1), Le(1000)] = 12.0
    """Samples per second [Hz]."""
    height_m: Annotated[float, Interval(ge=0, le=100)] = 0.0
    """Height of base_link's origin above the ground under the rover [m]."""
    shake: Shake = Shake()
    """Vibration; none by default."""
    corridor: Corridor | None = None
    """The strip without rocks; by default only where the validation drives the path."""
