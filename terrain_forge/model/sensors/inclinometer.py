"""An inclinometer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.model.sensor import Sensor


@dataclass(frozen=True, kw_only=True, eq=False)
class InclinometerSensor(Sensor):
    """Tells roll and pitch by what it feels as down, so accelerations tilt them.

    Its figures are nominal, of a MEMS one.
    """

    title: ClassVar[str] = "inclinometer"
    mjcf: ClassVar[tuple[str, ...]] = ("framequat",)

    kind: Literal["inclinometer"] = "inclinometer"
    """An inclinometer."""
    rate_hz: Annotated[float, Interval(ge=0.1, le=1000)] = 10.0
    """Samples per second [Hz]."""
    noise_deg: Annotated[float, Interval(ge=0, le=10)] = 0.02
    """White noise of a sample, its standard deviation [degrees]."""
    bias_deg: Annotated[float, Interval(ge=0, le=10)] = 0.05
    """Error that stays, drawn once, its standard deviation [degrees]."""
    range_deg: Annotated[float, Interval(gt=0, le=180)] = 180.0
    """Largest angle that it tells, to either side [degrees]."""
    step_deg: Annotated[float, Interval(ge=0, le=10)] = 0.0
    """Step in which it tells angles [degrees]; 0 for none."""
