"""Measures the ground alone: `python benchmarks/terrain.py [-n RUNS]`.

Prints, for grids of 1025² and 4000² nodes with detail of eight octaves below a DTM, without and
with thousands of craters, and of nine octaves on a flat site with craters, the median wall and
processor time of warm runs, and the peak memory that the ground adds, as a multiple of its float32
grid. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys

import numpy as np
from run import peak, timed

import terrain_forge as tf
from terrain_forge.dtm import ArrayDtm, FlatDtm
from terrain_forge.recipe import TerrainSpec
from terrain_forge.terrain import (
    BodyProduction,
    CraterLayer,
    Fractal,
    Layer,
    make_craters,
    shape_ground,
)

SPACING = 0.125
SMALLEST = {1025: 0.5, 4000: 1.4}
"""Smallest craters [m] on a grid of so many nodes: 5 000 and 10 000 of them and larger ones."""
POSTING = 12.0
"""With a longest wavelength of twice that: 24, 12, 6, 3, 1.5, 0.75, 0.375, 0.1875 m."""


def main() -> None:
    """Measure each grid in a process of its own, so that peaks of memory do not mix."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", "--runs", type=int, default=5, help="counted runs of each grid")
    parser.add_argument("--nodes", type=int, help="measure one grid here")
    parser.add_argument("--craters", action="store_true", help="with craters")
    parser.add_argument("--flat", action="store_true", help="without a DTM")
    arguments = parser.parse_args()
    if arguments.nodes:
        measure(arguments.nodes, arguments.runs, craters=arguments.craters, flat=arguments.flat)
        return
    print(f"{os.cpu_count()} processors; median of {arguments.runs}")
    for nodes in SMALLEST:
        for kind in ([], ["--craters"], ["--craters", "--flat"]):
            command = [sys.executable, __file__, "--nodes", str(nodes), "-n", str(arguments.runs)]
            subprocess.run([*command, *kind], check=True)


def measure(nodes: int, runs: int, *, craters: bool, flat: bool) -> None:
    """Print one line of the table."""
    site, layers = place(nodes, craters=craters, flat=flat)
    small, _ = place(nodes, craters=craters, flat=flat, size=200 * SPACING)
    shape_ground(site=small, window=small.window, layers=layers)
    before = peak()
    times = timed(lambda: shape_ground(site=site, window=site.window, layers=layers), runs)
    wall, processor = map(statistics.median, times)
    memory = (peak() - before) * 1024**2 / (4 * nodes**2)
    last = layers[-1]
    made = isinstance(last, CraterLayer)
    number = len(make_craters(last, site=site, area=site.bounds)) if made else 0
    print(
        f"{nodes}²{', flat' if flat else ''}, {number} craters: {wall:.2f} s wall, "
        f"{processor:.2f} s processor, {memory:.1f} × float32 grid"
    )


def place(
    nodes: int, *, craters: bool, flat: bool, size: float | None = None
) -> tuple[tf.Site, tuple[Layer, ...]]:
    """A site of so many nodes a side, or of another size [m], over an array of posts."""
    size = size or (nodes - 1) * SPACING
    posts = max(int(size / POSTING) + 16, 64)
    random = np.random.default_rng(1)
    heights = random.normal(size=(posts, posts)).cumsum(axis=0).cumsum(axis=1) / 20.0
    layers: tuple[Layer, ...] = (Fractal(longest_wavelength_m=2.0 * POSTING),)
    if craters:
        law = BodyProduction(kind="neukum", age_ga=3.5)
        layers += (CraterLayer(production=law, diameter_m=(SMALLEST[nodes], 60.0)),)
    recipe = tf.Recipe(
        name="benchmark",
        body="moon",
        dtm=FlatDtm(size_m=(size, size))
        if flat
        else ArrayDtm(posting_m=POSTING, size_m=(size, size)),
        terrain=TerrainSpec(spacing_m=SPACING, layers=layers),
    )
    return tf.plan(recipe, heights=None if flat else heights), layers


if __name__ == "__main__":
    main()
