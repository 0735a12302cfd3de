"""Measures the drive against bare steps: `python benchmarks/drive_speed.py [-n RUNS] [WORLD …]`.

A WORLD is a built folder with an MJCF export and a path; without one, `recipes/hello.yaml` is built
first. The rover drives the path; then the same scene takes as many steps by `mj_step` alone, its
wheels commanded at the rates that they had in the drive: as it was exported, and with MuJoCo's
sleep flag, which the drive sets. All in turns and in processor time. Nothing is asserted: read the
table.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from run import HERE, model

from terrain_forge.base import quaternion_from_rpy
from terrain_forge.driving import DriveResult, Vehicle, drive, load_scene
from terrain_forge.model import World
from terrain_forge.pipeline import build
from terrain_forge.recipe import DriveSpec, load_recipe

SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", "--runs", type=int, default=3, help="runs of each, in turns")
    parser.add_argument("worlds", nargs="*", type=Path)
    asked = parser.parse_args()
    print(f"{model()}, MuJoCo {mujoco.__version__}, medians of {asked.runs}, simulated over "
          "processor time")  # fmt: skip
    print(f"\n{'world':<20}{'rocks':>8}{'drive':>8}{'bare':>8}{'ratio':>8}{'bare, sleep':>14}"
          f"{'ratio':>8}")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for world in asked.worlds or [hello(Path(folder) / "hello")]:
            row(world, asked.runs)


def hello(out: Path) -> Path:
    """The first world, with nothing but its MJCF."""
    found = load_recipe(HERE.parent / "recipes" / "hello.yaml")
    build(found.recipe, out, folder=found.folder, only=["mjcf"])
    return out


def row(folder: Path, runs: int) -> None:
    """Measure a world and print its line."""
    world, scene = World.load(folder), folder / "mjcf" / "scene.xml"
    factors = np.array([once(world, scene) for _ in range(runs)]).T
    driven, bare, asleep = (statistics.median(times) for times in factors.tolist())
    print(
        f"{world.site.name:<20}{len(world.field):>8}{driven:>8.1f}{bare:>8.1f}{driven / bare:>8.2f}"
        f"{asleep:>14.1f}{driven / asleep:>8.2f}"
    )


def once(world: World, scene: Path) -> tuple[float, float, float]:
    """Simulated over processor time of the drive and of bare steps without and with sleep."""
    path = world.trajectories[0]
    loaded, begin = load_scene(scene), time.process_time()
    result = drive(scene=loaded, trajectory=path, rover=world.rover, spec=DriveSpec(path=path.name))
    driven = result.duration / (time.process_time() - begin)
    return driven, bare(world, load_scene(scene), result, 0), bare(
        world, load_scene(scene), result, SLEEP
    )  # fmt: skip


def bare(world: World, loaded: Any, result: DriveResult, flag: int) -> float:
    """Simulated over processor time of steps alone, ten at a call."""
    vehicle, path = Vehicle(loaded, world.rover), world.trajectories[0]
    vehicle.set_down(path.position[0], quaternion_from_rpy(path.rpy[0]))
    # As it was exported: without what the drive sets.
    loaded.opt.enableflags = flag
    names = result.wheels
    motors = [loaded.actuator(name).id for name in names]
    sides = [np.sign(loaded.joint(name).axis[1]) for name in names]
    begin = time.process_time()
    count = round(0.02 / loaded.opt.timestep)
    for now in np.arange(0.0, result.duration, 0.02).tolist():
        vehicle.data.ctrl[motors] = sides * result.wheel_rate[np.searchsorted(result.time, now)]
        mujoco.mj_step(loaded, vehicle.data, count)
    return result.duration / (time.process_time() - begin)


if __name__ == "__main__":
    main()
