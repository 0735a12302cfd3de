"""A Sun sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.model.sensor import Near, Sensor


@dataclass(frozen=True, kw_only=True, eq=False)
class SunSensor(Sensor):
    """Tells the direction of the Sun about its z axis, which points up where it is mounted level.

    It tells nothing while the Sun is out of its view, below the horizon, or hidden by ground, rocks
    or the rover itself. Its figures are nominal, of a digital one.
    """

    title: ClassVar[str] = "Sun sensor"

    kind: Literal["sun_sensor"] = "sun_sensor"
    """A Sun sensor."""
    rate_hz: Annotated[float, Interval(ge=0.01, le=1000)] = 1.0
    """Samples per second [Hz]."""
    fov_deg: Annotated[float, Interval(gt=0, le=360)] = 140.0
    """Angle of its view's cone, from side to side [degrees]."""
    near_m: Near = 0.005
    """What of the rover is nearer than this hides nothing, such as the sensor's own housing [m]."""
    noise_deg: Annotated[float, Interval(ge=0, le=10)] = 0.1
    """Error of the direction, its standard deviation in each of two ways across [degrees]."""
    bias_deg: Annotated[float, Interval(ge=0, le=10)] = 0.0
    """The same of an error that stays, drawn once [degrees]."""
