"""A rover's own sensors as a recipe would write them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from terrain_forge.base import inverse_pose
from terrain_forge.model import Sensor
from terrain_forge.rovers.catalogue import RoverChoice, resolve_rover
from terrain_forge.rovers.custom import FoundRover
from terrain_forge.rovers.rig import AnySensor, told_in


def rig_of(choice: RoverChoice, folder: Path) -> list[dict[str, Any]]:
    """The sensors that a rover brings, as the `sensors` of a recipe: what presets say is left out.

    Args:
        choice: What the recipe says of its rover.
        folder: What its paths are relative to.

    Raises:
        RecipeError: if there is no such rover.
    """
    adapter: TypeAdapter[Any] = TypeAdapter(AnySensor)
    rover = resolve_rover(choice, folder)
    found = []
    for sensor in rover.rover.sensors:
        told = json.loads(adapter.dump_json(_as_told(sensor, rover)))
        named = {key: told[key] for key in ("kind", "name", "preset") if told[key]}
        plain = json.loads(adapter.dump_json(adapter.validate_json(json.dumps(named))))
        differing = {key: value for key, value in told.items() if plain[key] != value}
        found.append({**named, **differing})
    return found


def _as_told(sensor: Sensor, found: FoundRover) -> Sensor:
    """A sensor in the frame that a recipe means by its link; without one, the rover's own."""
    if sensor.link == Sensor.ROOT:
        return sensor.replace(link="")
    if sensor.link not in found.frames:
        return sensor
    _, pose = found.frames[sensor.link]
    return told_in(sensor, sensor.link, inverse_pose(pose))
