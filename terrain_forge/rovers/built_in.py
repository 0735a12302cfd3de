"""Built-in rovers: a data file each, NAME.urdf or NAME.xacro, with NAME.yaml beside it.

They lie in our folder `builtin`, or in packages that an entry point names (docs/rovers.md).
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, make_dataclass
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Gt, Interval, Le, Lt
from pydantic import Field, TypeAdapter, ValidationError

from terrain_forge.base import (
    DataError,
    Pair,
    Positive,
    RecipeError,
    Spec,
    complaint,
    load_plugin,
    plugins,
)
from terrain_forge.model import Grousers, Rover, Sensor, Shape, Wheel, sensor_kinds
from terrain_forge.rovers.custom import FileRover, FoundRover, RoverSpec
from terrain_forge.rovers.expressions import Scope, Value, evaluate
from terrain_forge.rovers.macros import expand_xacro
from terrain_forge.rovers.packages import Packages
from terrain_forge.rovers.rig import carried
from terrain_forge.rovers.rolling import make_rover
from terrain_forge.rovers.substitution import Substitution
from terrain_forge.rovers.urdf import read_urdf

GROUP = "terrain_forge.rovers"
"""Entry points that name packages of rovers' files."""
_OURS = Path(__file__).with_name("builtin")
_KEY = ("rover",)
_RESERVED = {"file", "name"}
_log = logging.getLogger(__name__)
_adapter = cache(TypeAdapter)
_made: dict[str, type] = {}
"""The classes that are made here, by their names, for pickle."""


@dataclass(frozen=True, kw_only=True)
class Dimension(Spec):
    """A number, or several, that a recipe may change."""

    default: float | tuple[float, ...]
    """What it is by default; all of several are positive."""
    meaning: str
    """A sentence, with the unit."""
    source: str = ""
    """Where the default is from, if not where the rover's others are."""
    below: float | None = None
    """What it must be below; above 0 in any case."""
    between: Pair | None = None
    """Least and largest value, in place of being above 0."""

    def annotation(self) -> Any:
        """Its type with its limits."""
        number: Any = Annotated[float, Gt(0)]
        if self.below is not None:
            number = Annotated[float, Gt(0), Lt(self.below)]
        if self.between:
            number = Annotated[float, Ge(self.between[0]), Le(self.between[1])]
        if isinstance(self.default, tuple):
            number = tuple[(number,) * len(self.default)]  # type: ignore[misc]
        return Annotated[number, Field(description=self.meaning)]


@dataclass(frozen=True, kw_only=True)
class Requirement(Spec):
    """What a dimension must be more than."""

    above: str
    """An expression of the others."""
    meaning: str
    """What that is, in words."""


@dataclass(frozen=True, kw_only=True)
class Description(Spec):
    """NAME.yaml: what a URDF cannot say of a rover."""

    text: str = "A built-in rover."
    """What it is, a sentence."""
    source: str = ""
    """Where its dimensions are from."""
    dimensions: dict[str, Dimension] = field(default_factory=dict)
    """What a recipe may change; expressions in both files use these names."""
    require: dict[str, Requirement] = field(default_factory=dict)
    """How its dimensions must fit each other."""
    reading: dict[str, Any] = field(default_factory=dict)
    """How to read the file: keys of `rover: {kind: file}`, with expressions."""
    sensors: tuple[dict[str, Any], ...] = ()
    """The rig, with expressions: `name`, `kind`, `link`, `position_m`, `rpy_deg`, and figures
    of its kind."""


@dataclass(frozen=True, kw_only=True)
class GrouserSpec(Spec):
    """Bars across a wheel's tread."""

    count: Annotated[int, Interval(ge=3, le=200)] = 24
    """How many, evenly around the wheel."""
    height_m: Positive = 0.01
    """Above the tread [m]; the wheel's radius reaches to their tops."""
    thickness_m: Positive = 0.004
    """Along the tread [m]."""
    collides: bool = False
    """Whether physics sees the bars. By default it rolls on a smooth cylinder of the wheel's
    radius: bars on hard ground jolt as they would on rock."""


@dataclass(frozen=True, kw_only=True)
class BuiltInRover(RoverSpec):
    """What a recipe may say about a rover of our own."""

    FILE: ClassVar[Path]
    DESCRIPTION: ClassVar[Description]

    model: Literal["detailed", "simplified"] = "simplified"
    """How it looks; masses, inertias and what physics touches are the same."""
    grousers: GrouserSpec | None = None
    """Bars across the wheels' treads; without it they are smooth."""


@cache
def built_in_rovers() -> dict[str, type[BuiltInRover]]:
    """What a recipe may say of each built-in rover, by their names."""
    folders = [_OURS]
    for point in plugins(GROUP).values():
        folders += map(Path, getattr(load_plugin(point, GROUP), "__path__", ()))
    found: dict[str, type[BuiltInRover]] = {}
    for file in (file for folder in folders for file in sorted(folder.iterdir())):
        if file.suffix not in (".urdf", ".xacro"):
            continue
        if file.stem in found.keys() | _RESERVED:
            _log.warning("rover %s is skipped: there is one of that name", file)
            continue
        try:
            found[file.stem] = _spec_type(file)
        except DataError as error:
            _log.warning("rover %s is skipped: %s", file, error)
    return dict(sorted(found.items()))


def _spec_type(file: Path) -> type[BuiltInRover]:
    """The class of a rover's options: those of all rovers, its kind and its dimensions."""
    told, title = _describe(file.with_suffix(".yaml")), file.stem[0].upper() + file.stem[1:]
    options: list[tuple[str, Any, Any]] = [
        ("kind", Annotated[Literal[file.stem], Field(description="This rover.")], file.stem)  # type: ignore[misc]
    ]
    if told.dimensions:
        made = [(name, one.annotation(), one.default) for name, one in told.dimensions.items()]
        text = "Lengths, masses and limits"
        kind = _make(f"{title}Dimensions", Spec, made, f"{text} of {file.stem}.")
        dimensions = Annotated[kind, Field(description=f"{text}.")]  # type: ignore[valid-type]
        options.append(("dimensions", dimensions, field(default_factory=kind)))
    spec: type[BuiltInRover] = _make(f"{title}Spec", BuiltInRover, options, told.text)
    spec.FILE, spec.DESCRIPTION = file, told
    return spec


def _make(name: str, base: type, options: list[tuple[str, Any, Any]], text: str) -> Any:
    space: dict[str, Any] = {"__doc__": text, "__module__": __name__}
    made = make_dataclass(name, options, bases=(base,), namespace=space, frozen=True, kw_only=True)
    _made[name] = made
    return made


def __getattr__(name: str) -> Any:
    """A class that is made here; where one is unpickled, another process made it."""
    built_in_rovers()
    if name in _made:
        return _made[name]
    raise AttributeError(name)


def _describe(file: Path) -> Description:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    if not file.is_file():
        return Description()
    try:
        plain = YAML(typ="safe", pure=True).load(file.read_text(encoding="utf-8"))
        told: Description = _adapter(Description).validate_json(json.dumps(plain), strict=True)
    except ValidationError as error:
        why = complaint(error, _adapter(Description), plain)
        raise DataError(f"{file.name}: {why}", key=_KEY) from None
    except (YAMLError, ValueError) as error:
        raise DataError(f"{file.name}: {' '.join(str(error).split())}", key=_KEY) from None
    return told


@lru_cache(maxsize=16)
def build_rover(choice: BuiltInRover) -> FoundRover:
    """The rover of these options.

    Raises:
        RecipeError: if its parts do not fit together.
        DataError: if its files are not right.
    """
    told, file = choice.DESCRIPTION, choice.FILE
    sizes = getattr(choice, "dimensions", None)
    names: dict[str, Value] = {name: getattr(sizes, name) for name in told.dimensions}
    for name, value in names.items():
        if isinstance(value, tuple):
            names[name] = _Listed(value)
    _require_fit(told, names)
    names["detailed"] = choice.model == "detailed"
    names["grouser_height_m"] = choice.grousers.height_m if choice.grousers else 0.0
    packages = Packages({}, file, library=_OURS)
    root, _ = expand_xacro(file, packages, names=names)
    assembly, _ = read_urdf(root, file, packages)
    texts = Substitution(packages)
    filled = partial(_filled, texts=texts, names=Scope(values=names))
    try:
        reading = {"file": file.name, "step_limit_m": choice.step_limit_m}
        reading |= filled(told.reading)
        rover, frames = make_rover(assembly, _read(FileRover, reading, "reading"))
        links = {link.name for link in rover.links}  # what is fixed to them is no name of ours
        frames = {name: frame for name, frame in frames.items() if name in links}
        sensors = tuple(
            _sensor(filled(sensor), f"sensors[{n}]") for n, sensor in enumerate(told.sensors)
        )
        lost = {sensor.link for sensor in sensors} - {"", *links}
        if lost:
            raise ValueError(f"a sensor sits on {lost.pop()!r}, which is no link of the rover")
    except (ValueError, TypeError, LookupError) as error:
        raise DataError(f"{file.stem}.yaml: {' '.join(str(error).split())}", key=_KEY) from None
    sensors = tuple(carried(sensor, frames) for sensor in sensors)
    rover = rover.replace(name=file.stem, sensors=sensors)
    rover = _add_grousers(rover, choice.grousers) if choice.grousers else rover
    return FoundRover(rover=rover, frames=frames)


def _require_fit(told: Description, names: Mapping[str, Value]) -> None:
    for name, requirement in told.require.items():
        key = ("rover", "dimensions", name)
        try:
            found, least = names[name], evaluate(requirement.above, names)
        except ValueError as error:  # of sizes that no rover has
            why = f"must be more than {requirement.meaning}, {error}"
            raise RecipeError(why, key=key) from None
        if found <= least:  # type: ignore[operator]
            why = f"{found:g} m, must be more than {requirement.meaning}, {least:g} m"
            raise RecipeError(why, key=key)


class _Listed(tuple[float, ...]):
    """Several numbers, which a text has as URDF writes them."""

    def __str__(self) -> str:
        return " ".join(map(repr, self))


def _filled(told: Any, *, texts: Substitution, names: Scope) -> Any:
    """A part of a description with its expressions evaluated."""
    again = partial(_filled, texts=texts, names=names)
    if isinstance(told, str):
        return texts.value(told, names)
    if isinstance(told, Mapping):
        return {key: again(value) for key, value in told.items()}
    return tuple(map(again, told)) if isinstance(told, list) else told


def _sensor(told: dict[str, Any], where: str) -> Sensor:
    kind, kinds = told.pop("kind", None), sensor_kinds()
    if kind not in kinds:
        raise ValueError(f"unknown kind of sensor {kind!r}, there are: {', '.join(sorted(kinds))}")
    sensor: Sensor = _read(kinds[kind], told, where)
    return sensor


def _read(kind: type, told: dict[str, Any], where: str) -> Any:
    """A spec of what a description says at a place.

    Raises:
        ValueError: says what is wrong there and what is allowed.
    """
    try:
        return _adapter(kind).validate_python(told)
    except ValidationError as error:
        raise ValueError(f"{where}.{complaint(error, _adapter(kind), told)}") from None


def _add_grousers(rover: Rover, spec: GrouserSpec) -> Rover:
    """The rover with bars on its wheels, which weigh what they did.

    A wheel's cylinder is seen as the drum between the bars; it collides as that too, or as before.
    """
    radius = min(wheel.radius for wheel in rover.wheels)
    if spec.height_m >= 0.5 * radius:
        raise RecipeError(
            f"{spec.height_m:g} m, must be less than half the wheel's radius",
            key=("rover", "grousers", "height_m"),
        )
    most = 2.0 * math.sqrt(radius**2 - (radius - spec.height_m) ** 2)
    if spec.thickness_m >= most:
        raise RecipeError(
            f"{spec.thickness_m:g} m, bars of that height on this wheel must be less than "
            f"{most:.4g} m thick",
            key=("rover", "grousers", "thickness_m"),
        )
    bars = Grousers(count=spec.count, height=spec.height_m, thickness=spec.thickness_m)
    wheels = {wheel.link: wheel for wheel in rover.wheels}
    links = []
    for link in rover.links:
        made: list[Shape] = []
        for shape in link.shapes:
            wheel = wheels.get(link.name)
            if not wheel or shape.kind != "cylinder" or shape.size[0] < wheel.radius:
                made.append(shape)
                continue
            drum = shape.replace(size=(shape.size[0] - bars.height, *shape.size[1:]))
            if shape.collides and not spec.collides:
                made.append(shape.replace(visible=False))
                drum = drum.replace(collides=False)
            if drum.visible or drum.collides:
                made += [drum, *_bars(shape, wheel, bars, spec.collides)]
        links.append(link.replace(shapes=tuple(made)))
    barred = tuple(wheel.replace(grousers=bars) for wheel in rover.wheels)
    return rover.replace(links=tuple(links), wheels=barred)


def _bars(rim: Shape, wheel: Wheel, bars: Grousers, collides: bool) -> list[Shape]:
    # Their outer edges, not the middles of their tops, reach the wheel's radius.
    top, tread = math.sqrt(wheel.radius**2 - bars.thickness**2 / 4), wheel.radius - bars.height
    size, made = (bars.thickness, wheel.width, top - tread), []
    for angle in (2 * math.pi * n / bars.count for n in range(bars.count)):
        place = (top + tread) / 2 * np.array([math.sin(angle), 0.0, math.cos(angle)])
        made.append(
            Shape(
                kind="box", size=size, position=rim.position + place,
                rpy=np.array([0.0, angle, 0.0]), collides=collides, rgb=rim.rgb,
            )
        )  # fmt: skip
    return made
