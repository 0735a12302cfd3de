"""The sensors that a recipe gives to its rover."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Union

import numpy as np

from terrain_forge.base import (
    BY_KIND,
    Array,
    RecipeError,
    Spec,
    hint_at,
    matrix_from_quaternion,
    placed,
    portable,
    quaternion_from_rpy,
    rpy_from_matrix,
)
from terrain_forge.model import Rover, Sensor, sensor_kinds, simple_sensors
from terrain_forge.rovers.custom import Frame

if TYPE_CHECKING:
    AnySensor = Sensor
else:
    AnySensor = Annotated[Union[tuple(sensor_kinds().values())], BY_KIND]  # noqa: UP007 (a tuple)


_FRAMES = ("world", "map", "odom", "base_link", "base_footprint")
"""Names of frames that a dataset's readers take for other things than a sensor."""


@dataclass(frozen=True, kw_only=True)
class MoreSensors(Spec):
    """Sensors beside the rover's own."""

    add: tuple[AnySensor, ...]
    """The sensors; one that has the name of one of the rover's own takes its place."""


SensorsChoice = tuple[AnySensor, ...] | MoreSensors
"""What a recipe's `sensors` may be: a list takes the place of the rover's own rig."""


def with_sensors(
    rover: Rover, choice: SensorsChoice | None, *, frames: Mapping[str, Frame] | None = None
) -> Rover:
    """A rover that carries what a recipe says.

    A sensor that names a link sits in the frame that the rover's file gives it, one of `frames`: it
    is told in that of the rover's link that carries it.

    Raises:
        RecipeError: if two sensors have one name, one has that of a link or frame, or sits on a
            link that the rover lacks.
    """
    if choice is None:
        return rover
    more = isinstance(choice, MoreSensors)
    added: tuple[Sensor, ...] = choice.add if isinstance(choice, MoreSensors) else choice
    own, key = (rover.sensors, ("sensors", "add")) if more else ((), ("sensors",))
    frames = frames or {}
    links = list(dict.fromkeys([*(link.name for link in rover.links), *frames]))
    named: dict[str, int] = {}
    for number, sensor in enumerate(added):
        if sensor.link and sensor.link not in links:
            hint = hint_at(sensor.link, links)
            raise RecipeError(
                f"{sensor.link!r} is no link of the rover {rover.name}{hint}, there are: "
                f"{', '.join(links)}",
                key=(*key, number, "link"),
            )
        for part in {sensor.name, *(one.name for one in sensor.simple)}:
            if named.setdefault(part, number) != number:
                raise RecipeError(
                    f"{part!r} is the name of another sensor too", key=(*key, number, "name")
                )
            if part in (*links, *_FRAMES):
                raise RecipeError(
                    f"{part!r} is the name of a link or frame, choose another for the sensor's",
                    key=(*key, number, "name"),
                )
    added = tuple(carried(sensor, frames) for sensor in added)
    kept = [sensor for sensor in own if sensor.name not in {one.name for one in added}]
    sensors = (*kept, *added)
    names = [part.name for part in simple_sensors(sensors)]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise RecipeError(f"{twice!r} is the name of a sensor of the rover too", key=key)
    return rover.replace(sensors=sensors)


def carried(sensor: Sensor, frames: Mapping[str, Frame]) -> Sensor:
    """A sensor in the frame of the rover's link that carries the one that it names."""
    if sensor.link not in frames:
        return sensor
    link, pose = frames[sensor.link]
    return told_in(sensor, link, pose)


def told_in(sensor: Sensor, link: str, pose: Array) -> Sensor:
    """A sensor in the frame of a link, in which that of its own has a pose, shape [4, 4]."""
    if np.array_equal(pose, np.eye(4)):
        return sensor.replace(link=link)
    turn = matrix_from_quaternion(quaternion_from_rpy(sensor.rpy))
    place = portable.product(pose, placed(sensor.position, turn))
    rpy = sensor.rpy_deg
    if not np.array_equal(pose[:3, :3], np.eye(3)):
        rpy = tuple(np.degrees(rpy_from_matrix(place[:3, :3])).tolist())
    return sensor.replace(link=link, position_m=tuple(place[:3, 3].tolist()), rpy_deg=rpy)
