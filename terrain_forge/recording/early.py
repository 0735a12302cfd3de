"""What of a recipe's recording can be refused before there is a world."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from terrain_forge.base import Key, RecipeError, hint_at
from terrain_forge.datasets import dataset_kind
from terrain_forge.model import CameraSensor, LidarSensor, Rover, Sensor, simple_sensors
from terrain_forge.recipe import DatasetSpec, Recipe
from terrain_forge.recording.driven import STEP
from terrain_forge.recording.formats import formats_of
from terrain_forge.recording.rig import folder_names
from terrain_forge.recording.setting import as_recorded, named_path
from terrain_forge.rovers import MoreSensors
from terrain_forge.sensors import Series, instrument_kinds, require_carried, require_free


def require_recordable(recipe: Recipe, rover: Rover) -> None:
    """Refuse a recording that cannot be made of a recipe's world, as far as that is known before.

    Args:
        recipe: The recipe; without a `dataset` its sensors alone are looked at.
        rover: Its rover, which carries them.

    Raises:
        RecipeError: for the first that is wrong: path, rig, format, mount or rate.
    """
    spec = recipe.dataset
    if spec is not None:
        named_path([path.name for path in recipe.paths], spec.path)
        require_formats(spec, rover)
        require_rig(spec, rover)
    listed = recipe.sensors or ()
    key: Key = ("sensors",)
    if isinstance(listed, MoreSensors):
        listed, key = listed.add, ("sensors", "add")
    carried = {sensor.name: sensor for sensor in rover.sensors}  # on links that the rover has
    places: dict[str, Key] = {}
    for number, sensor in enumerate(listed):
        places[sensor.name] = (*key, number)
        if spec is not None:
            with _at((*key, number, "link")):
                require_carried(carried[sensor.name], rover)
        with _at((*key, number, "position_m")):
            require_free(carried[sensor.name], rover)
    if spec is not None and spec.motion == "drive":
        for sensor in as_recorded(rover.sensors, spec):
            place = places.get(sensor.name)
            with _at((*place, "rate_hz") if place else ("dataset", "motion")):
                kind = instrument_kinds().get(sensor.kind)
                if kind is not None and issubclass(kind, Series):
                    kind.require_logged(sensor, STEP)


@contextmanager
def _at(key: Key) -> Iterator[None]:
    """Errors within are of a key of the recipe."""
    try:
        yield
    except RecipeError as error:
        raise RecipeError(str(error), key=key) from None


def require_rig(spec: DatasetSpec, rover: Rover) -> None:
    """Refuse a rover without any sensor that is recorded.

    Raises:
        RecipeError: if there is none.
    """
    if not any(one.kind in instrument_kinds() for one in as_recorded(rover.sensors, spec)):
        raise RecipeError(
            f"a recording needs a sensor that is recorded, and the rover has {_carried(rover)}",
            key=("sensors",),
        )


def require_formats(spec: DatasetSpec, rover: Rover) -> None:
    """Refuse formats that need what the rover does not carry, or what is not recorded.

    Raises:
        RecipeError: for the first such format.
    """
    rig = simple_sensors(as_recorded(rover.sensors, spec))
    cameras = [one for one in rig if isinstance(one, CameraSensor)]
    lidar = any(isinstance(one, LidarSensor) for one in rig)
    for name, options in formats_of(spec).items():
        _require_names(name, options, rig)
        asked = options.get("camera")
        used = [one for one in cameras if one.name == asked] or cameras
        there = {
            "two cameras": len(cameras) > 1,
            "pictures without distortion": any(map(_is_straight, used)),
            "a lidar": lidar,
            **{name: any(name in one.channels for one in used) for name in ("depth", "class")},
        }
        for need in dataset_kind(name).needs:
            if there[need]:
                continue
            why = f"and the rover has {_carried(rover)}"
            whose = f"camera {asked!r} does not record" if used != cameras else "no camera records"
            if need in ("depth", "class"):
                full = ", and record with profile: full" if spec.profile == "quick" else ""
                why = f"which {whose}: give it channels: [{need}]{full}"
            elif need == "pictures without distortion":
                why = f"which {whose}: give it images: [rectified], or [raw, rectified]"
            raise RecipeError(
                f"format {name!r} needs {need}, {why}",
                key=("dataset", "formats"),
            )


def _is_straight(camera: CameraSensor) -> bool:
    """Whether it records pictures without distortion."""
    return camera.distortion is None or "rectified" in camera.images


def _require_names(kind: str, options: Mapping[str, Any], rig: Sequence[Sensor]) -> None:
    """Refuse an option of a format that names a sensor which there is not, nor a folder of it.

    An option that is called as a kind of sensor names one of these.
    """
    kinds = instrument_kinds()
    recorded = [one for one in rig if one.kind in kinds]
    folders = list(folder_names(kinds[one.kind] for one in recorded))
    for option in dataset_kind(kind).naming:
        what = option if option in kinds else "sensor"
        mine = [
            (one.name, folder)
            for one, folder in zip(recorded, folders, strict=True)
            if what in ("sensor", one.kind)
        ]
        known = [name for name, _ in mine]
        told = options.get(option) or ()
        for name in (told,) if isinstance(told, str) else told:
            if not any(name in names for names in mine):
                there = f"there are: {', '.join(sorted(known)) or 'none'}"
                raise RecipeError(
                    f"format {kind!r}: no {what} {name!r}{hint_at(name, known)}, {there}",
                    key=("dataset", "formats", kind, option),
                )


def _carried(rover: Rover) -> str:
    """The sensors of a rover by kind and name."""
    return ", ".join(f"{one.kind} {one.name!r}" for one in rover.sensors) or "no sensors"
