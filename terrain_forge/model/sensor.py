"""What a sensor is, and how it tells exporters what they can write of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from annotated_types import Interval, MinLen

from terrain_forge.base import Array, Coordinate, FileName, Record, Spec, parts

Angle = Annotated[float, Interval(ge=-360, le=360)]

GROUP = "terrain_forge.sensor_kinds"
"""Entry points that name modules of other packages with kinds of sensors."""


Sdf = tuple[str, Mapping[str, Any]]
"""The type of an SDF `<sensor>` and its elements by their tags, attributes by `@` and name."""


class View(NamedTuple):
    """The picture of a pinhole camera that looks along the sensor's x axis."""

    width_px: int
    height_px: int
    horizontal_fov: float
    """[rad]"""


class Topic(NamedTuple):
    """What a sensor publishes in gz-sim, and what ROS 2 calls it."""

    name: str
    """Topic, without a leading slash; of a kind of sensor: below the sensor's own."""
    gz_type: str
    """Type of its messages in Gazebo."""
    ros_type: str
    """Type of the ROS message that the bridge makes of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensor(Record, Spec):
    """A sensor and where it sits; a kind is a subclass with a literal `kind` and its figures.

    It is a part of a recipe and of the rover that carries it at once: one description, which the
    recorder measures by and which exporters ask what their format can say of it; what a kind does
    not answer is told as a loss.
    """

    title: ClassVar[str]
    """What the kind is called in a sentence."""
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    """What a preset says of the fields that are not given, by its name."""
    topics: ClassVar[tuple[Topic, ...]] = ()
    """What it publishes in gz-sim."""
    sdf_topic: ClassVar[str] = ""
    """What the `<topic>` of its SDF adds to the sensor's own."""
    mjcf: ClassVar[tuple[str, ...]] = ()
    """MuJoCo's sensors, by their tags, that stand for it at its site."""
    actor_loss: ClassVar[str] = ""
    """What it does not measure on an actor of Gazebo, which physics does not move."""

    kind: str
    """The kind's name; a kind overrides it by a `Literal` and its default."""
    name: FileName
    """Unique name."""
    link: Annotated[str, MinLen(1)] = "base_link"
    """Link of the rover that carries it."""
    position_m: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    """Where it sits in the link's frame [m]."""
    rpy_deg: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw in the link's frame [degrees]; a camera looks along its x axis."""
    preset: str = ""
    """A set of figures with a name, for what is not given here."""
    rate_hz: Annotated[float, Interval(ge=0.01, le=10_000)]
    """Samples per second [Hz]."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        from pydantic_core.core_schema import no_info_before_validator_function

        return no_info_before_validator_function(cls._with_preset, handler(source))

    @classmethod
    def _with_preset(cls, given: Any) -> Any:
        """What was given, and the figures of the preset that it names."""
        if not isinstance(given, dict):
            return given
        given = _with_tuples(given)  # pydantic takes what comes here for Python's, no longer JSON's
        if not (name := given.get("preset")):
            return given
        if name not in cls.PRESETS:
            known = ", ".join(cls.PRESETS) or "none"
            raise ValueError(f"unknown preset {name!r}, there are: {known}")
        return {**cls.PRESETS[name], **given}

    @property
    def position(self) -> Array:
        """Where it sits in the link's frame [m], shape [3]."""
        return np.array(self.position_m)

    @property
    def rpy(self) -> Array:
        """Roll, pitch, yaw in the link's frame [rad], shape [3]."""
        return np.radians(self.rpy_deg)

    @property
    def figures(self) -> dict[str, float]:
        """The numbers of its kind by their names."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {n: float(v) for n, v in values.items() if isinstance(v, int | float)}

    @property
    def simple(self) -> tuple[Sensor, ...]:
        """The sensors that formats know it by: itself, or its parts."""
        return (self,)

    @property
    def quick(self) -> Self:
        """What stands for it in a recording for a first look."""
        return self

    @property
    def view(self) -> View | None:
        """Its picture, where it is a camera of a format's own."""
        return None

    def sdf(self, *, classic: bool, far: float) -> Sdf | None:  # noqa: ARG002
        """What it is in SDF, without name, pose, rate and topic; None where SDF has none.

        Args:
            classic: Whether for Gazebo Classic, else for gz-sim.
            far: How far a camera shall see [m].
        """
        return None


def _with_tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _with_tuples(one) for key, one in value.items()}
    return tuple(map(_with_tuples, value)) if isinstance(value, list) else value


def white_noise(deviation: float) -> dict[str, Any]:
    """SDF's `<noise>` of a standard deviation; nothing where there is none."""
    return {"noise": {"type": "gaussian", "mean": 0, "stddev": deviation}} if deviation else {}


def simple_sensors(sensors: Iterable[Sensor]) -> tuple[Sensor, ...]:
    """Sensors as formats know them: a stereo pair is two cameras."""
    return tuple(part for sensor in sensors for part in sensor.simple)


@cache
def sensor_kinds() -> dict[str, type[Sensor]]:
    """All installed kinds of sensors by their names."""
    return {str(vars(k)["kind"]): k for k in parts(Sensor, "terrain_forge.model.sensors", GROUP)}


def titles(sensors: Iterable[Sensor]) -> list[str]:
    """What the kinds of some sensors are called, each once."""
    return list(dict.fromkeys(sensor.title for sensor in sensors))
