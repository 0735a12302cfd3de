"""Measures the report page: `python benchmarks/report.py [-n RUNS] [RECIPE]`.

Prints the median and range of the wall time of writing the page of a world (by default that of
build_1025.yaml) whose truth and preview lie in its folder, warm, the processor time of it, and the
page's size. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

from terrain_forge.making import plan
from terrain_forge.model import World
from terrain_forge.pipeline import realise
from terrain_forge.recipe import load_recipe
from terrain_forge.report import write_report_page
from terrain_forge.scene import write_preview
from terrain_forge.truth import write_truth

HERE = Path(__file__).parent


def main() -> None:
    """Make the world, write its page again and again, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", nargs="?", type=Path, default=HERE / "build_1025.yaml")
    parser.add_argument("-n", "--runs", type=int, default=5, help="counted runs")
    arguments = parser.parse_args()
    file = load_recipe(arguments.recipe)
    world = realise(plan(file.recipe, folder=file.folder))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_truth(world, folder)
        write_preview(world, folder / "preview.png")
        size = write_report_page(world, folder).stat().st_size
        begun = time.process_time()
        seconds = [once(world, folder) for _ in range(arguments.runs)]
        processor = (time.process_time() - begun) / arguments.runs
    middle = statistics.median(seconds)
    rows, columns = world.ground.shape
    print(f"{os.cpu_count()} processors; median (min to max) of {arguments.runs}")
    spread = f"{middle:.2f} s ({min(seconds):.2f} to {max(seconds):.2f})"
    print(f"{columns} × {rows} nodes, {len(world.field):,} rocks: {size / 1e6:.2f} MB in {spread}")
    print(f"processor time of all threads {processor:.2f} s")


def once(world: World, folder: Path) -> float:
    """Wall time of one page [s]."""
    start = time.perf_counter()
    write_report_page(world, folder)
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
