"""Wheel odometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import NotNegative
from terrain_forge.model.sensor import Sensor


@dataclass(frozen=True, kw_only=True, eq=False)
class OdometrySensor(Sensor):
    """Encoders on the wheels, and where the rover would be by them: in the plane, from 0.

    Wheels turn as they did in a simulated drive. Along a path that nobody drove they slip by a
    model; its figures are those of drives (docs/driving.md: distance over what wheels rolled 0.949,
    turn rate by the wheels over the true one 2.1). The odometer knows the rover's wheels and track,
    and of slip what `assumed_` fields say. It sits on base_link.
    """

    title: ClassVar[str] = "wheel odometry"

    kind: Literal["odometry"] = "odometry"
    """Wheel odometry."""
    rate_hz: Annotated[float, Interval(ge=1, le=1000)] = 50.0
    """Samples per second [Hz]."""
    ticks_per_turn: Annotated[int, Interval(ge=1, le=100_000_000)] = 4096
    """Ticks of an encoder for a turn of its wheel."""
    slip: Annotated[float, Interval(ge=-0.9, le=0.9)] = 0.052
    """Mean slip of wheels that nothing simulated: 1 - distance / what they rolled."""
    slip_noise: Annotated[float, Interval(ge=0, le=0.1)] = 0.02
    """How much each wheel's slip varies, its standard deviation; within a second it is alike."""
    skid_gain: Annotated[float, Interval(ge=1, le=10)] = 2.1
    """How many times faster the wheels of a turning rover run against each other than those of one
    that does not skid, where nothing was simulated."""
    assumed_slip: Annotated[float, Interval(ge=-0.9, le=0.9)] = 0.0
    """Mean slip that the odometer makes up for."""
    assumed_skid_gain: Annotated[float, Interval(ge=1, le=10)] = 2.1
    """Skid that the odometer makes up for: it takes the track to be so many times as wide."""
    assumed_noise: NotNegative = 0.05
    """Error of a wheel's speed that the covariance tells, its standard deviation as a share of the
    speed; within a second it is alike."""
