"""Where a recording is made: the world, how its rover moves, the rays' scene, the instruments."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

from terrain_forge.base import Progress, RecipeError, checked, hint_at, silent
from terrain_forge.model import Sensor, World
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.driven import motion_of_drive
from terrain_forge.rocks import with_pebbles
from terrain_forge.sensors import (
    Instrument,
    Motion,
    Scenery,
    Setting,
    instruments_of,
    motion_of_path,
)

_log = logging.getLogger(__name__)


def spec_of(world: World, *, path: str | None = None) -> DatasetSpec:
    """What a world's recipe says of its recording, with the path's name.

    Raises:
        RecipeError: if the world has no path, or none of that name.
    """
    return with_path(world, world.site.recipe.dataset or DatasetSpec(), path=path)


def with_path(world: World, spec: DatasetSpec, *, path: str | None = None) -> DatasetSpec:
    """What is recorded, with the name of a path that the world has.

    Raises:
        RecipeError: if the world has no path, or none of that name.
    """
    names = [one.name for one in world.trajectories]
    return replace(spec, path=named_path(names, spec.path if path is None else path))


def named_path(names: Sequence[str], asked: str | None) -> str:
    """The path of a recording: that which is asked for, or the first of some names.

    Raises:
        RecipeError: if there is none, or none of that name.
    """
    if not names:
        raise RecipeError(
            "a recording needs a path that the rover follows, and the world has none: give the "
            "recipe one, and build its world with that",
            key=("paths",),
        )
    named = names[0] if asked is None else asked
    if named not in names:
        what = f"no path is called {named!r}{hint_at(named, names)}, the world has"
        raise RecipeError(f"{what}: {', '.join(names)}", key=("dataset", "path"))
    return named


@checked
@contextmanager
def open_setting(
    world: World,
    dataset: DatasetSpec | None = None,
    *,
    path: str | None = None,
    progress: Progress = silent,
) -> Iterator[Setting]:
    """What the instruments measure in, until the end of the block.

        with open_setting(world, path="short") as setting:
            files = find_instrument(setting, "camera_left").measure(100)

    Args:
        world: The world.
        dataset: What is recorded; by default what the world's recipe says.
        path: Name of the path; by default the dataset's.
        progress: Called with the share of a drive that is simulated.

    Raises:
        RecipeError: if there is no such path.
        DataError: if it is too short.
        SimulationError: if a drive cannot begin.
        ExportError: if no law tells the number of pebbles that it wants.
    """
    spec = with_path(world, dataset, path=path) if dataset else spec_of(world, path=path)
    world = with_rig(world, spec)
    seen = world
    if spec.pebbles_min_m > 0.0:
        seen = with_pebbles(world, smallest=spec.pebbles_min_m, within=spec.pebbles_within_m)
    motion = motion_of(world, spec, progress)
    with Scenery(seen, motion) as scenery:
        yield Setting(
            world=seen,
            motion=motion,
            scenery=scenery,
            gravity=spec.gravity(world.site.body.gravity),
            seed=world.site.seed,
            tracks=spec.tracks == "behind",
        )


def with_rig(world: World, spec: DatasetSpec) -> World:
    """The world whose rover carries what is recorded."""
    sensors = as_recorded(world.rover.sensors, spec)
    return world.replace(rover=world.rover.replace(sensors=sensors))


def as_recorded(sensors: Iterable[Sensor], spec: DatasetSpec) -> tuple[Sensor, ...]:
    """Sensors as a recording's profile has them."""
    return tuple(sensor.quick if spec.profile == "quick" else sensor for sensor in sensors)


def motion_of(world: World, spec: DatasetSpec, progress: Progress = silent) -> Motion:
    """How the rover moves along the path of a recording."""
    assert spec.path is not None
    if spec.motion == "drive":
        told = partial(progress, "scene: drive")
        return motion_of_drive(world, spec.path, still=spec.still_s, progress=told)
    path = next(one for one in world.trajectories if one.name == spec.path)
    return motion_of_path(path, still=spec.still_s, ramp=spec.ramp_s)


@checked
def find_instrument(setting: Setting, name: str) -> Instrument:
    """What measures for the sensor of a name, of a stereo pair NAME_left or NAME_right.

    Raises:
        RecipeError: if there is none; suggests the nearest name and lists all.
    """
    known = {one.sensor.name: one for one in instruments_of(setting)}
    if name not in known:
        there = ", ".join(known) or "none"
        raise RecipeError(
            f"no sensor that is recorded is called {name!r}{hint_at(name, known)}, "
            f"there are: {there}"
        )
    return known[name]


def tell_unmeasured(setting: Setting) -> None:
    """Warn of sensors that nothing measures for."""
    measured = {one.sensor.name for one in instruments_of(setting)}
    for sensor in setting.world.rover.sensors:
        if measured.isdisjoint(part.name for part in sensor.simple):
            _log.warning("sensor %r is left out: nothing measures %r", sensor.name, sensor.kind)
