"""Measures the sweeps of lidars: `python benchmarks/lidar.py [-n SWEEPS] [--rocks ROCKS]`.

A rover turns on a ground of 1025² nodes strewn with rocks. Prints, for each preset, the median and
range of the wall time of a sweep and of its file, the processor time, the points, and how far those
on the ground are off it without noise, each at its own time. The paper's lidar is measured with a
pose for each column too. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from exports import made_world
from run import model, spread

from terrain_forge.model import LidarSensor, Trajectory, World
from terrain_forge.rovers import find_rover
from terrain_forge.sensors import (
    Scenery,
    Setting,
    deskewed_points,
    instrument_kinds,
    motion_of_path,
    take_sweep,
)

PLACE = (0.1, 0.0, 0.9)
JOBS = {
    "paper-64": {},
    "paper-64, not at once": {"snapshot": False},
    "vlp-16": {},
    "vlp-16, 3 mrad": {"divergence_mrad": 3.0},
    "hdl-32e": {},
    "hdl-64e": {},
    "os1-64": {},
    "livox-avia": {},
}
SWEEPS = 40
"""Sweeps that the circle lasts for."""
EXACT = {"noise_m": 0.0, "quantum_m": 0.0, "divergence_mrad": 0.0}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=20, help="sweeps of each")
    parser.add_argument("--rocks", type=int, default=20_000, help="rocks on the ground")
    parser.add_argument("--side", type=int, default=1025, help="nodes of the ground each way")
    options = parser.parse_args()
    world = made_world(options.side, options.rocks).replace(rover=find_rover("skid4"))
    motion = motion_of_path(turning(world), ramp=0.0)
    print(f"{model()}; ground of {options.side}² nodes, {options.rocks} rocks")
    print(f"{'':<24}{'sweep, ms':>22}{'CPU':>7}{'file, ms':>22}{'points':>9}{'off, mm':>9}")
    with Scenery(world, motion) as scenery:
        setting = Setting(world=world, motion=motion, scenery=scenery, gravity=3.7, seed=1)
        for name, changes in JOBS.items():
            figures = LidarSensor.PRESETS[name.split(",")[0]] | changes
            lidar = LidarSensor(name="lidar", position_m=PLACE, **figures)
            instrument = instrument_kinds()["lidar"](lidar, setting)
            swept, busy = timed(lambda n, one=lidar: take_sweep(setting, one, n), options.n)
            filed, _ = timed(instrument.measure, options.n)  # type: ignore[attr-defined]
            exact = lidar.replace(**EXACT)
            sweep = take_sweep(setting, exact, 1)
            points = deskewed_points(setting, exact, sweep)[sweep.instance == -1]
            off = np.abs(points[:, 2] - world.ground.height_at(points[:, 0], points[:, 1]))
            print(
                f"{name:<24}{spread(swept, 1):>22}{busy:>7.1f}{spread(filed, 1):>22}"
                f"{len(sweep.points):>9}{1e3 * off.max():>9.4f}"
            )


def turning(world: World) -> Trajectory:
    """A circle driven fast, which tilts."""
    time = np.arange(0.0, 5.0, 1.0 / 12.0)
    angle = 1.5 * time
    xy = 4.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return Trajectory(
        name="circle",
        time=time,
        position=np.column_stack([xy, world.ground.height_at(xy[:, 0], xy[:, 1])]),
        rpy=np.stack([0.05 * np.sin(3 * time), 0.05 * np.cos(3 * time), angle + np.pi / 2], -1),
        closed=False,
    )


def timed(job: Callable[[int], object], runs: int) -> tuple[tuple[float, ...], float]:
    """Wall times of warm runs [ms], and the median processor time of one [ms]."""
    job(0)
    walls, busy = [], []
    for n in range(runs):
        wall, processor = time.perf_counter(), time.process_time()
        job(n % SWEEPS)
        walls.append(1e3 * (time.perf_counter() - wall))
        busy.append(1e3 * (time.process_time() - processor))
    return tuple(walls), float(np.median(busy))


if __name__ == "__main__":
    main()
