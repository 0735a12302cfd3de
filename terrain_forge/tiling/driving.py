"""The drive along a path of a site in tiles, through a corridor of scenes one after the other."""

from __future__ import annotations

import json
import shutil
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import OutputError, SimulationError, Stopwatch
from terrain_forge.model import Check, Trajectory, exporter, failed
from terrain_forge.recipe import DriveSpec
from terrain_forge.rovers import rover_of
from terrain_forge.tiling.joining import faults_of_files, read_site
from terrain_forge.tiling.making import world_of
from terrain_forge.tiling.order import STAGING, TileOrder
from terrain_forge.tiling.routing import Land, reach_of
from terrain_forge.validation import drive_checks, drive_json, read_checks

DRIVE = "validation/drive.json"
"""How the drive went, in the site's folder."""
_FILES = "validation/drive"
"""What the names of a drive's files begin with."""
_BESIDE = 0.15
"""Ground around a part of the path in its scene, over the length of the part."""
_LEAST_BESIDE = 6.0
"""The same at least [m]."""


class Corridor:
    """The scenes along a path: each holds a part of it, and is made when the rover comes there."""

    def __init__(self, order: TileOrder, path: Trajectory, folder: Path) -> None:
        self._order, self._land = order, Land(order)
        self._path, self._folder = path, folder
        self._length = reach_of(order.site)
        steps = np.linalg.norm(np.diff(path.position[:, :2], axis=0), axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(steps)])
        self._number = 0

    def __len__(self) -> int:
        return max(int(np.ceil(self._along[-1] / self._length)), 1)

    def first(self) -> Any:
        """The model of the scene of the path's start."""
        return self._scene(0)

    def onward(self, progress: float) -> Any | None:
        """The model of the next scene, once the rover is so far along the path [m]."""
        number = min(int(progress // self._length), len(self) - 1)
        if number <= self._number:
            return None
        self._number = number
        return self._scene(number)

    def _scene(self, number: int) -> Any:
        from terrain_forge.driving import load_scene

        low, high = number * self._length, (number + 1) * self._length
        beside = max(_BESIDE * self._length, _LEAST_BESIDE)
        here = (self._along >= low - beside) & (self._along <= high + beside)
        (west, south), (east, north) = (
            side(self._path.position[here, :2], axis=0) for side in (np.min, np.max)
        )
        bounds = west - beside, south - beside, east + beside, north + beside
        world = world_of(self._order, self._land.window(bounds))
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir(parents=True)
        mjcf = exporter("mjcf")
        mjcf.export(world.replace(trajectories=()), self._folder, options=mjcf.Options())
        return load_scene(self._folder / "scene.xml")


def drive_far(
    order: TileOrder, paths: tuple[Trajectory, ...], spec: DriveSpec, watch: Stopwatch
) -> bool:
    """Drive a path of the site, unless that was done; returns whether the drive kept its limits.

    A drive with a file that is missing or not as the finished site had it is none.

    Writes validation/drive_PATH.csv and its like, and `DRIVE`, last.
    """
    folder = order.out / "validation"
    told = order.out / DRIVE
    if not told.is_file() or _is_altered(order):
        watch(f"drive: {spec.path}")
        folder.mkdir(exist_ok=True)
        path = next(one for one in paths if one.name == spec.path)
        content = _driven(order, path, spec, watch)
        fresh = folder / f".{told.name}"
        fresh.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        fresh.replace(told)
    return all(check.passed for check in checks_of_drive(order))


def _is_altered(order: TileOrder) -> bool:
    """Whether the site was finished with other files of its drive."""
    try:
        listed = read_site(order.out)["outputs"]
    except OutputError:  # it was not, or nobody knows
        return False
    drive = {name: wanted for name, wanted in listed.items() if name.startswith(_FILES)}
    return bool(faults_of_files(order.out, drive))


def checks_of_drive(order: TileOrder) -> list[Check]:
    """What a site's drive was checked for; nothing where there was none.

    Raises:
        OutputError: if what was written of it is damaged.
    """
    told = order.out / DRIVE
    try:
        checks = read_checks(told)
    except ValueError:
        checks = []
    if told.is_file() and not checks:
        raise OutputError(f"{told} is damaged: move it away, and build again, which drives anew")
    return checks


def _driven(
    order: TileOrder, path: Trajectory, spec: DriveSpec, watch: Stopwatch
) -> dict[str, Any]:
    from terrain_forge.driving import drive, write_tables  # which load MuJoCo and matplotlib

    staging = order.out / STAGING / "drive"
    corridor = Corridor(order, path, staging)
    try:
        result = drive(
            scene=corridor.first(),
            trajectory=path,
            rover=rover_of(order.site),
            spec=spec,
            progress=partial(watch, f"drive: {spec.path}"),
            onward=corridor.onward,
        )
    except SimulationError as error:
        checks: list[Check] = [failed(f"drive {spec.path}", str(error))]
        return {"checks": [vars(check) for check in checks]}
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    write_tables(result, order.out / "validation")
    checks = drive_checks(result, spec)
    plain = [vars(check) for check in checks]
    return {"checks": plain, "drive": drive_json(result), "scenes": len(corridor)}
