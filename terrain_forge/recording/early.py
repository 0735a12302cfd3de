"""What of a recipe's recording can be refused before there is a world."""

from __future__ import annotations

import re
from collections.abc import Mapping, Set
from typing import Any

from terrain_forge.base import RecipeError, hint_at
from terrain_forge.datasets import dataset_kind
from terrain_forge.model import CameraSensor, LidarSensor, Rover, simple_sensors
from terrain_forge.recipe import DatasetSpec, Recipe
from terrain_forge.recording.formats import formats_of
from terrain_forge.recording.setting import as_recorded
from terrain_forge.rovers import MoreSensors
from terrain_forge.sensors import instrument_kinds, require_free


def require_recordable(recipe: Recipe, rover: Rover) -> None:
    """Refuse sensors of a recipe that would see the rover's inside or the soil, and formats.

    Args:
        recipe: The recipe.
        rover: Its rover, which carries them.

    Raises:
        RecipeError: for the first that is wrong.
    """
    if recipe.dataset is not None:
        require_formats(recipe.dataset, rover)
    listed = recipe.sensors or ()
    key: tuple[str, ...] = ("sensors",)
    if isinstance(listed, MoreSensors):
        listed, key = listed.add, ("sensors", "add")
    for number, sensor in enumerate(listed):
        try:
            require_free(sensor, rover)
        except RecipeError as error:
            raise RecipeError(str(error), key=(*key, number, "position_m")) from None


def require_formats(spec: DatasetSpec, rover: Rover) -> None:
    """Refuse formats that need what the rover does not carry, or what is not recorded.

    Raises:
        RecipeError: for the first such format.
    """
    rig = simple_sensors(as_recorded(rover.sensors, spec))
    cameras = [one for one in rig if isinstance(one, CameraSensor)]
    there = {
        "two cameras": len(cameras) > 1,
        "a lidar": any(isinstance(one, LidarSensor) for one in rig),
        **{name: any(name in one.channels for one in cameras) for name in ("depth", "class")},
    }
    for name, options in formats_of(spec).items():
        _require_names(name, options, {one.name for one in rig})
        for need in dataset_kind(name).needs:
            if there[need]:
                continue
            why = f"and the rover has {_carried(rover)}"
            if need in ("depth", "class"):
                full = ", and record with profile: full" if spec.profile == "quick" else ""
                why = f"which no camera records: give it channels: [{need}]{full}"
            raise RecipeError(
                f"format {name!r} needs {need}, {why}",
                key=("dataset", "formats"),
            )


def _require_names(kind: str, options: Mapping[str, Any], known: Set[str]) -> None:
    """Refuse an option of a format that names a sensor which there is not; folders are let pass."""
    words = "|".join(re.escape(one.folder) for one in instrument_kinds().values())
    for option in dataset_kind(kind).naming:
        told = options.get(option) or ()
        for name in (told,) if isinstance(told, str) else told:
            if name not in known and not re.fullmatch(f"({words})[0-9]+", name):
                there = f"there are: {', '.join(sorted(known))}"
                raise RecipeError(
                    f"format {kind!r}: no sensor {name!r}{hint_at(name, known)}, {there}",
                    key=("dataset", "formats", kind, option),
                )


def _carried(rover: Rover) -> str:
    """The sensors of a rover by kind and name."""
    return ", ".join(f"{one.kind} {one.name!r}" for one in rover.sensors) or "no sensors"
