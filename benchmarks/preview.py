"""Measures the preview: `python benchmarks/preview.py [-n RUNS] [RECIPE]`.

Prints the median and range of the wall and processor time of `render_preview` at 1280 × 720 of a
world (by default that of build_1025.yaml), warm, and those of making the world itself.
Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path

from terrain_forge.making import plan
from terrain_forge.pipeline import realise
from terrain_forge.recipe import load_recipe
from terrain_forge.scene import render_preview

HERE = Path(__file__).parent


def main() -> None:
    """Make the world and its picture again and again, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", nargs="?", type=Path, default=HERE / "build_1025.yaml")
    parser.add_argument("-n", "--runs", type=int, default=5, help="counted runs")
    arguments = parser.parse_args()
    file = load_recipe(arguments.recipe)
    site = plan(file.recipe, folder=file.folder)
    world = realise(site)
    rows, columns = world.ground.shape
    print(f"{os.cpu_count()} processors; median (min to max) of {arguments.runs}, warm")
    print(f"{columns} × {rows} nodes, {len(world.field):,} rocks")
    report("world", arguments.runs, lambda: realise(site))
    report("preview, 1280 × 720", arguments.runs, lambda: render_preview(world))


def report(name: str, runs: int, work: Callable[[], object]) -> None:
    """Print what some work takes, its first run not counted."""
    work()
    times = [once(work) for _ in range(runs)]
    columns = [
        f"{statistics.median(values):.2f} ({min(values):.2f} to {max(values):.2f})"
        for values in zip(*times, strict=True)
    ]
    print(f"{name:<22} wall {columns[0]} s, processor {columns[1]} s")


def once(work: Callable[[], object]) -> tuple[float, float]:
    """Wall time and processor time of all threads of one run [s]."""
    wall, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - processor


if __name__ == "__main__":
    main()
