"""What a sensor is, and how it tells exporters what they can write of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any, ClassVar, NamedTuple

from terrain_forge.base import Array, Record, parts, shaped

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
class Sensor(Record):
    """A sensor and where it sits; a kind is a subclass whose other fields are its figures.

    Exporters ask it what their format can say; what a kind does not answer is told as a loss.
    """

    kind: ClassVar[str]
    """The kind's name, as files write it."""
    title: ClassVar[str]
    """What the kind is called in a sentence."""
    topics: ClassVar[tuple[Topic, ...]] = ()
    """What it publishes in gz-sim."""
    sdf_topic: ClassVar[str] = ""
    """What the `<topic>` of its SDF adds to the sensor's own."""
    mjcf: ClassVar[tuple[str, ...]] = ()
    """MuJoCo's sensors, by their tags, that stand for it at its site."""
    actor_loss: ClassVar[str] = ""
    """What it does not measure on an actor of Gazebo, which physics does not move."""

    name: str
    """Unique name."""
    link: str = "base_link"
    """Link that carries it."""
    position: Array = field(metadata=shaped(3))
    """In the link's frame [m], shape [3]."""
    rpy: Array = field(metadata=shaped(3))
    """Roll, pitch, yaw in the link's frame [rad]; a camera looks along its x axis, shape [3]."""
    rate: float
    """Samples per second [Hz]."""

    @property
    def figures(self) -> dict[str, float]:
        """The figures of its kind in SI units, by their names."""
        own = [f.name for f in fields(self) if f.name not in ("name", "link", "position", "rpy")]
        values = {name: getattr(self, name) for name in own}
        return {name: float(value) for name, value in values.items() if value is not None}

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


def white_noise(deviation: float) -> dict[str, Any]:
    """SDF's `<noise>` of a standard deviation; nothing where there is none."""
    return {"noise": {"type": "gaussian", "mean": 0, "stddev": deviation}} if deviation else {}


@cache
def sensor_kinds() -> dict[str, type[Sensor]]:
    """All installed kinds of sensors by their names."""
    return {k.kind: k for k in parts(Sensor, "terrain_forge.model.sensors", GROUP)}


def titles(sensors: Iterable[Sensor]) -> list[str]:
    """What the kinds of some sensors are called, each once."""
    return list(dict.fromkeys(sensor.title for sensor in sensors))
