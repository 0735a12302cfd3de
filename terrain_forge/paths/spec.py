"""The recipe's `paths` part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, Union

from annotated_types import Ge, Interval, Le, MinLen

from terrain_forge.base import (
    ByKind,
    FileName,
    Idle,
    InputFile,
    NotNegative,
    Pair,
    Positive,
    Spec,
    parts,
)
from terrain_forge.paths.named_shape import NamedShape


@dataclass(frozen=True, kw_only=True)
class Spline(Spec):
    """A smooth curve through given points."""

    kind: Literal["spline"] = "spline"
    points_m: Annotated[tuple[Pair, ...], MinLen(2)]
    """Points, metres east and north of the site's centre."""
    closed: bool = False
    """Whether it returns to its first point, with the direction that it left it."""


@dataclass(frozen=True, kw_only=True)
class Polyline(Spec):
    """Straight legs from corner to corner."""

    kind: Literal["polyline"] = "polyline"
    points_m: Annotated[tuple[Pair, ...], MinLen(2)]
    """Corners, metres east and north of the site's centre."""
    closed: bool = False
    """Whether a last leg returns to the first point."""
    corner_radius_m: NotNegative = 0.0
    """Radius of the arc around each corner [m]; at 0 the rover stops there, turns on the spot and
    goes on."""


@dataclass(frozen=True, kw_only=True)
class Recorded(Spec):
    """A path from a file: a table with a line of column names, a plain list of x and y, or TUM."""

    kind: Literal["file"] = "file"
    file: Annotated[str, InputFile(kind="route")]
    """CSV with columns x, y and perhaps time and yaw or qw, qx, qy, qz, with or without units as in
    our own paths/NAME.csv (x_m, time_s, yaw_rad, yaw_deg); x and y without names; or TUM (time x y
    z qx qy qz qw). Other columns are ignored."""
    timing: Literal["speed", "recorded"] = "speed"
    """`speed`: its track in the plane is followed, at the path's speed. `recorded`: its times too,
    and its yaw where it has one."""
    attitude: Literal["ground", "recorded"] = "ground"
    """Height, roll and pitch. `ground`: of the ground's plane under the rover. `recorded`: the
    file's, from its z and qw, qx, qy, qz, such as the true motion of a suspension; with `timing:
    recorded`."""
    closed: bool = False
    """Whether it returns to its first point; with `timing: speed`."""
    spacing_m: Positive = 0.1
    """Points nearer than this to the one before are ignored [m]; with `timing: speed`."""
    origin_m: Pair = (0.0, 0.0)
    """Where the file's origin lies, metres east and north of the site's centre."""
    turn_deg: Annotated[float, Interval(ge=-360, le=360)] = 0.0
    """How far the file's axes are turned anticlockwise [degrees]."""

    def idle(self) -> Iterator[Idle]:
        """What is for a path at a speed of its own."""
        if self.timing == "recorded":
            yield from (Idle(name, "it is for timing: speed") for name in ("closed", "spacing_m"))


@dataclass(frozen=True, kw_only=True)
class Planned(Spec):
    """A path that is found: the cheapest way over what the rover can pass, made smooth."""

    kind: Literal["planned"] = "planned"
    start_m: Pair
    """Where it begins, metres east and north of the site's centre."""
    goal_m: Pair
    """Where it ends."""
    via_m: tuple[Pair, ...] = ()
    """Places that it passes on the way, in this order."""
    margin_m: Annotated[float, Interval(ge=0, le=10)] = 0.1
    """Distance that the rover's side keeps from what it cannot pass [m]."""

    @property
    def stops(self) -> tuple[tuple[str, Pair], ...]:
        """All places in their order, each after the name of its key."""
        between = (("via_m", place) for place in self.via_m)
        return ("start_m", self.start_m), *between, ("goal_m", self.goal_m)


if TYPE_CHECKING:
    RouteSpec = Spline | Polyline | NamedShape | Recorded | Planned
else:
    _SHAPES = parts(
        NamedShape,
        "terrain_forge.paths.shapes",
        "terrain_forge.route_shapes",
        taken=[route.kind for route in (Spline, Polyline, Recorded, Planned)],
    )
    RouteSpec = Annotated[
        Union[(Spline, Polyline, *_SHAPES, Recorded, Planned)], ByKind(default="spline")
    ]


@dataclass(frozen=True, kw_only=True)
class Shake(Spec):
    """Vibration of the body: band-limited noise on roll, pitch and yaw."""

    rms_deg: Annotated[float, Interval(ge=0, le=20)] = 0.0
    """RMS of each angle [degrees]."""
    cutoff_hz: Positive = 2.0
    """Highest frequency in it [Hz]; at most half the path's rate."""

    def idle(self) -> Iterator[Idle]:
        """The frequencies of no vibration."""
        if self.rms_deg == 0.0:
            yield Idle("cutoff_hz", "nothing vibrates; give rms_deg")


@dataclass(frozen=True, kw_only=True)
class Corridor(Spec):
    """A strip along the path that is kept free of rocks."""

    width_m: Annotated[float, Interval(ge=0, le=100)] | None = None
    """Width of the strip [m]; 0 for none; without it the rover's width and 0.4 m."""
    clearance_m: NotNegative | None = None
    """Height above the ground that no rock in the strip exceeds [m]; without it 0.15 m, or what the
    rover goes over where that is less."""


@dataclass(frozen=True, kw_only=True)
class PathSpec(Spec):
    """A path of the rover over the ground."""

    name: FileName
    """Name of the path and of its files."""
    route: RouteSpec
    """Where it goes."""
    speed_m_s: Annotated[float, Interval(ge=0.001, le=100)]
    """Speed along the route [m/s]."""
    acceleration_m_s2: Annotated[float, Interval(ge=0.001, le=100)] | None = None
    """Largest gain and loss of speed [m/s²]: the path then begins and ends at rest. Without it the
    speed is constant, or 0.2 m/s² on a route with turns on the spot."""
    turn_rate_deg_s: Annotated[float, Interval(ge=0.1, le=360)] = 15.0
    """Largest rate of turns on the spot [degrees/s]."""
    rate_hz: Annotated[float, Ge(0.1), Le(1000)] = 12.0
    """Samples per second [Hz]."""
    height_m: Annotated[float, Interval(ge=0, le=100)] = 0.0
    """Height of base_link's origin above the ground under the rover [m]."""
    shake: Shake = Shake()
    """Vibration; none by default."""
    corridor: Corridor | None = None
    """The strip without rocks; by default only where the validation drives the path; none for a
    planned one, which goes around the rocks."""
