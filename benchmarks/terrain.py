"""Measures the ground alone: `python benchmarks/terrain.py [-n RUNS]`.

Prints, for grids of 1025² and 4000² nodes with detail of eight octaves below a DTM, the median wall
and processor time of warm runs, and the peak memory that the ground adds, as a multiple of its
float32 grid. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import time

import numpy as np

import terrain_forge as tf
from terrain_forge.dtm.spec import ArrayDtm
from terrain_forge.recipe import TerrainSpec
from terrain_forge.terrain.ground import shape_ground
from terrain_forge.terrain.layers.fractal import Fractal

SPACING = 0.125
POSTING = 12.0
"""With a longest wavelength of twice that: 24, 12, 6, 3, 1.5, 0.75, 0.375, 0.1875 m."""


def main() -> None:
    """Measure each grid in a process of its own, so that peaks of memory do not mix."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", "--runs", type=int, default=5, help="counted runs of each grid")
    parser.add_argument("--nodes", type=int, help="measure one grid here")
    arguments = parser.parse_args()
    if arguments.nodes:
        measure(arguments.nodes, arguments.runs)
        return
    print(f"{os.cpu_count()} processors; median of {arguments.runs}")
    for nodes in (1025, 4000):
        command = [sys.executable, __file__, "--nodes", str(nodes), "-n", str(arguments.runs)]
        subprocess.run(command, check=True)


def measure(nodes: int, runs: int) -> None:
    """Print one line of the table."""
    site, layer = place(nodes)
    shape_ground(site=place(200)[0], window=place(200)[0].window, layers=(layer,))
    before = peak()
    rows = []
    for _ in range(runs):
        wall, processor = time.perf_counter(), time.process_time()
        ground = shape_ground(site=site, window=site.window, layers=(layer,))
        rows.append((time.perf_counter() - wall, time.process_time() - processor))
    wall, processor = (statistics.median(column) for column in zip(*rows, strict=True))
    memory = (peak() - before) / ground.elevation.nbytes
    print(f"{nodes}²: {wall:.2f} s wall, {processor:.2f} s processor, {memory:.1f} × float32 grid")


def place(nodes: int) -> tuple[tf.Site, Fractal]:
    """A site of so many nodes a side over an array of posts."""
    size = (nodes - 1) * SPACING
    posts = max(int(size / POSTING) + 16, 64)
    random = np.random.default_rng(1)
    heights = random.normal(size=(posts, posts)).cumsum(axis=0).cumsum(axis=1) / 20.0
    layer = Fractal()
    recipe = tf.Recipe(
        name="benchmark",
        body="mars",
        dtm=ArrayDtm(posting_m=POSTING, size_m=(size, size)),
        terrain=TerrainSpec(spacing_m=SPACING, layers=(layer,)),
    )
    return tf.plan(recipe, heights=heights), layer


def peak() -> int:
    """Peak memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    main()
