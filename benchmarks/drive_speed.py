"""Measures the drive against bare steps: `python benchmarks/drive_speed.py [-n RUNS] [WORLD …]`.

A WORLD is a built folder with an MJCF export and a path; without one, `recipes/hello.yaml` is built
first. The rover drives the path, and what it did is written as pictures and tables. The same scene
takes the same steps, with the same controls, by `mj_step` alone: as it was exported, and with
MuJoCo's sleep flag, which the drive sets. `--before FOLDER` does the first two by an older checkout
too (`git worktree add FOLDER COMMIT`). All in turns, each in a process of its own, in processor
time. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import math
import os
import pickle
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from run import HERE, model

from terrain_forge.base import Array, quaternion_from_rpy
from terrain_forge.driving import (
    ARRIVAL,
    Vehicle,
    drive,
    load_scene,
    write_figure,
    write_film,
    write_tables,
)
from terrain_forge.model import World
from terrain_forge.recipe import DriveSpec


def main() -> None:
    """Print the table, or one figure of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", "--runs", type=int, default=3, help="runs of each, in turns")
    parser.add_argument("--before", type=Path, help="an older checkout to compare with")
    parser.add_argument("--part", choices=PARTS, help="do this alone and print its seconds")
    parser.add_argument("worlds", nargs="*", type=Path)
    asked = parser.parse_args()
    if asked.part:
        world, notes = asked.worlds
        print(PARTS[asked.part](world, notes))
        return
    print(f"{model()}, MuJoCo {mujoco.__version__}, medians of {asked.runs}, processor time")
    with tempfile.TemporaryDirectory() as folder:
        for world in asked.worlds or [hello(Path(folder) / "hello")]:
            table(world, asked.runs, asked.before, Path(folder) / "notes")


def hello(out: Path) -> Path:
    """The first world, with nothing but its MJCF."""
    from terrain_forge.pipeline import build
    from terrain_forge.recipe import load_recipe

    found = load_recipe(HERE.parent / "recipes" / "hello.yaml")
    build(found.recipe, out, folder=found.folder, only=("mjcf",))
    return out


def table(world: Path, runs: int, before: Path | None, notes: Path) -> None:
    """Measure a world in all ways and print their lines."""
    simulated = one("note", world, notes)
    ways: list[tuple[str, str, Path | None]]
    ways = [(part, part, None) for part in PARTS if part != "note"]
    ways += [(f"{part} before", part, before) for part in ("drive", "pictures") if before]
    measured = [[one(part, world, notes, tree) for _, part, tree in ways] for _ in range(runs)]
    took = dict(zip((name for name, *_ in ways), zip(*measured, strict=True), strict=True))
    seconds = {name: statistics.median(times) for name, times in took.items()}
    print(f"\n{world.name}: {simulated:.1f} s of driving\n"
          f"{'':<18}{'s':>8}{'x real time':>14}{'x bare':>10}{'x bare, asleep':>17}")  # fmt: skip
    for name, median in seconds.items():
        ratios = seconds["bare"] / median, seconds["bare, asleep"] / median
        print(f"{name:<18}{median:>8.2f}{simulated / median:>14.1f}"
              f"{ratios[0]:>10.2f}{ratios[1]:>17.2f}")  # fmt: skip


def one(part: str, world: Path, notes: Path, tree: Path | None = None) -> float:
    """What a part of the work prints, done in a process of its own by a checkout."""
    command = [sys.executable, __file__, "--part", part, str(world), str(notes)]
    path = os.pathsep.join(
        filter(None, [str(tree.resolve()) if tree else "", os.environ.get("PYTHONPATH")])
    )
    done = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": path}, stdout=subprocess.PIPE, check=True
    )
    return float(done.stdout)


def driven(folder: Path) -> tuple[Any, float]:
    """A drive along the first path, and how long it took [s]."""
    world, scene = World.load(folder), load_scene(folder / "mjcf" / "scene.xml")
    path, begin = world.trajectories[0], time.process_time()
    result = drive(scene=scene, trajectory=path, rover=world.rover, spec=DriveSpec(path=path.name))
    return result, time.process_time() - begin


def note(folder: Path, notes: Path) -> float:
    """Keep a drive and its controls for the other parts; how long it lasts, simulated [s]."""
    controls, step = list[tuple[Array, Array]](), Vehicle.step

    def noting(vehicle: Vehicle, wheel_rates: Array, count: int) -> None:
        before, parts = vehicle.data.ctrl.copy(), np.arange(1, count + 1)[:, None] * (1.0 / count)
        change = np.zeros(len(before))
        change[vehicle.motors] = vehicle.sides * wheel_rates - before[vehicle.motors]
        step(vehicle, wheel_rates, count)
        controls.append((before + parts * change, vehicle.data.act.copy()))

    Vehicle.step = noting  # type: ignore[method-assign, assignment]
    result, _ = driven(folder)
    notes.write_bytes(pickle.dumps((result, controls)))
    return float(result.duration)


def pictures(folder: Path, notes: Path) -> float:
    """Tables, figure and film of a drive [s]."""
    world, (result, _) = World.load(folder), pickle.loads(notes.read_bytes())
    with tempfile.TemporaryDirectory() as out:
        begin = time.process_time()
        write_tables(result, Path(out))
        write_figure(world, result, Path(out) / "drive.png")
        write_film(world, result, Path(out) / "drive.webp")
        return time.process_time() - begin


def bare(folder: Path, notes: Path, *, sleep: bool = False) -> float:
    """Steps alone [s]."""
    world, (result, controls) = World.load(folder), pickle.loads(notes.read_bytes())
    loaded, path = load_scene(folder / "mjcf" / "scene.xml"), world.trajectories[0]
    exported = loaded.opt.enableflags, loaded.opt.disableflags
    vehicle = Vehicle(loaded, world.rover)
    vehicle.set_down(path.position[0], quaternion_from_rpy(path.rpy[0]))
    # As it was exported: without what the drive sets.
    loaded.opt.enableflags, loaded.opt.disableflags = exported
    if sleep:
        loaded.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    data, step = vehicle.data, mujoco.mj_step
    begin = time.process_time()
    for commands, held in controls:
        for command in commands:
            data.ctrl[:] = command
            step(loaded, data)
        data.act[:] = held
    took = time.process_time() - begin
    assert math.dist(vehicle.place, result.position[-1, :2]) < ARRIVAL  # it went the same way
    return took


PARTS: dict[str, Callable[[Path, Path], float]] = {
    "note": note,
    "bare": bare,
    "bare, asleep": lambda folder, notes: bare(folder, notes, sleep=True),
    "drive": lambda folder, _: driven(folder)[1],
    "pictures": pictures,
}  # fmt: skip


if __name__ == "__main__":
    main()
