"""What a sensor is, and how it tells exporters what they can write of it."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_type_hints

import numpy as np
from annotated_types import Interval

from terrain_forge.base import (
    Array,
    Coordinate,
    FileName,
    RecipeError,
    Record,
    Spec,
    hint_at,
    parts,
)

Angle = Annotated[float, Interval(ge=-360, le=360)]
Near = Annotated[float, Interval(ge=0.005, le=10)]

GROUP = "terrain_forge.sensor_kinds"
"""Entry points that name modules of other packages with kinds of sensors."""


Form = Literal["sdf", "mjcf", "usd"]
"""A format that sensors are written in; the sensors of a URDF are SDF's."""

Sdf = tuple[str, Mapping[str, Any]]
"""The type of an SDF `<sensor>` and its elements by their tags, attributes by `@` and name."""


class View(NamedTuple):
    """The picture of a pinhole camera that looks along the sensor's x axis."""

    width_px: int
    height_px: int
    horizontal_fov: float
    """Between the left and the right edge, as if the axis met the middle [rad]."""
    aspect: float = 1.0
    """Focal length in pixels down a column over that along a row."""
    offset_px: tuple[float, float] = (0.0, 0.0)
    """Where the axis meets the picture, right of its middle and below it [px]."""
    lens: Literal["", "radtan", "equidistant"] = ""
    """Model of the distortion, as OpenCV has it; empty where there is none."""
    coefficients: tuple[float, ...] = ()
    """Of the distortion: k1, k2, p1, p2, k3 of `radtan`, k1 to k4 of `equidistant`."""

    @property
    def focal_px(self) -> tuple[float, float]:
        """Focal lengths along a row and down a column [px]."""
        along = self.width_px / (2 * math.tan(self.horizontal_fov / 2))
        return along, along * self.aspect

    @property
    def centre_px(self) -> tuple[float, float]:
        """Where the axis meets the picture, from its upper left corner [px]."""
        right, down = self.offset_px
        return self.width_px / 2 + right, self.height_px / 2 + down

    @property
    def centred(self) -> bool:
        """Whether one angle says it: square pixels, and the axis in the middle."""
        return self.aspect == 1.0 and self.offset_px == (0.0, 0.0)

    def sdf_lens(self) -> dict[str, Any]:
        """What SDF adds to the angle: distortion, and intrinsics where one angle is too little."""
        told: dict[str, Any] = {}
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        if self.lens == "radtan":
            names = ("k1", "k2", "p1", "p2", "k3")
            bent = dict(zip(names, self.coefficients, strict=False))
            told["distortion"] = bent | {"center": (cx / self.width_px, cy / self.height_px)}
        if not self.centred:
            own = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "s": 0}
            told["lens"] = {"type": "gnomonical", "scale_to_hfov": "true", "intrinsics": own}
        return told


class Topic(NamedTuple):
    """What a sensor publishes in gz-sim, and what ROS 2 calls it."""

    name: str
    """Topic, without a leading slash; of a kind of sensor: below the sensor's own."""
    gz_type: str
    """Type of its messages in Gazebo."""
    ros_type: str
    """Type of the ROS message that the bridge makes of them."""


class _Preset(type):
    """Of a sensor that is made in Python its preset fills in what is not given, as in a recipe."""

    def __call__(cls, **given: Any) -> Any:
        return super().__call__(**{**_figures(cls, given.get("preset") or ""), **given})


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensor(Record, Spec, metaclass=_Preset):
    """A sensor and where it sits; a kind is a subclass with a literal `kind` and its figures.

    It is a part of a recipe and of the rover that carries it at once: one description, which the
    recorder measures by and which exporters ask what their format can say of it; what a kind does
    not answer is told as a loss.
    """

    ROOT: ClassVar[str] = "base_link"
    """What every rover calls its root link."""
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
    link: str = ""
    """Link that it sits on, in the frame that the rover's file gives; without one it sits on the
    body, in the rover's own frame, whose origin is on the ground amid the driven wheels."""
    position_m: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    """Where it sits in that frame [m]."""
    rpy_deg: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw in that frame [degrees]; a camera looks along its x axis."""
    preset: str = ""
    """A set of figures with a name, for what is not given here."""
    rate_hz: Annotated[float, Interval(ge=0.01, le=10_000)]
    """Samples per second [Hz]."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        from pydantic_core.core_schema import no_info_before_validator_function

        # Inside the dataclass's own schema, which pydantic takes again where a kind is used twice.
        schema = handler(source)
        own = handler.resolve_ref_schema(schema)
        if own["schema"]["type"] != "function-before":
            own["schema"] = no_info_before_validator_function(cls._with_preset, own["schema"])
        return schema

    @classmethod
    def _with_preset(cls, given: Any) -> Any:
        """What was given, and the figures of the preset that it names."""
        if not isinstance(given, dict):
            return given
        given = _with_tuples(given)  # pydantic takes what comes here for Python's, no longer JSON's
        if not (name := given.get("preset")):
            return given
        if text := _unknown(cls, name):
            from pydantic_core import PydanticCustomError, ValidationError

            why = PydanticCustomError("unknown_preset", "{text}", {"text": text})
            raise ValidationError.from_exception_data(
                cls.__name__, [{"type": why, "loc": ("preset",), "input": name}]
            )
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
    def seated(self) -> Self:
        """Itself on a link of the rover: without one it sits on the root."""
        return self if self.link else self.replace(link=self.ROOT)

    @property
    def figures(self) -> dict[str, Any]:
        """What its kind says of it by the names of the fields, as plain data."""
        told = {name: getattr(self, name) for name in self._own}
        return {name: _plain(value) for name, value in told.items() if value is not None}

    def said(self, form: Form) -> Collection[str]:  # noqa: ARG002
        """The fields whose figures a format says of it; the others are losses."""
        return ()

    def unsaid(self, form: Form) -> tuple[str, ...]:
        """The fields whose figures a format does not say; of what is not there it need not."""
        told = self.said(form)
        return tuple(name for name in self._own if name not in told and getattr(self, name))

    @property
    def _own(self) -> tuple[str, ...]:
        shared = {f.name for f in fields(Sensor)} - {"rate_hz"}
        return tuple(f.name for f in fields(self) if f.name not in shared)

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


def _unknown(kind: type[Sensor], preset: Any) -> str:
    """What is wrong with the name of a preset; empty where it is known."""
    if isinstance(preset, str) and preset in kind.PRESETS:
        return ""
    known = ", ".join(kind.PRESETS) or "none"
    return f"unknown preset {preset!r}{hint_at(str(preset), kind.PRESETS)}, there are: {known}"


@cache
def _figures(kind: Any, preset: str) -> Mapping[str, Any]:
    """What a preset of a kind says, as values of its fields."""
    if not preset:
        return {}
    if text := _unknown(kind, preset):
        raise RecipeError(text, key=("preset",))
    from pydantic import TypeAdapter

    types, told = get_type_hints(kind, include_extras=True), _with_tuples(kind.PRESETS[preset])
    return {name: TypeAdapter(types[name]).validate_python(told[name]) for name in told}


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


def figures_lost(sensors: Iterable[Sensor], form: Form) -> list[str]:
    """A sentence for each kind of which a format does not say all figures."""
    lost = dict.fromkeys((sensor.title, sensor.unsaid(form)) for sensor in sensors)
    return [
        f"{form.upper()} does not say of the rover's {title}: {', '.join(names)}."
        for title, names in lost
        if names
    ]


def _plain(value: Any) -> Any:
    """A field's value as numbers, texts, lists and mappings, without what is None."""
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    if isinstance(value, Record):
        told = {f.name: getattr(value, f.name) for f in fields(value)}
        return {name: _plain(own) for name, own in told.items() if own is not None}
    return value


@cache
def sensor_kinds() -> dict[str, type[Sensor]]:
    """All installed kinds of sensors by their names."""
    return {str(vars(k)["kind"]): k for k in parts(Sensor, "terrain_forge.model.sensors", GROUP)}


def titles(sensors: Iterable[Sensor]) -> list[str]:
    """What the kinds of some sensors are called, each once."""
    return list(dict.fromkeys(sensor.title for sensor in sensors))
