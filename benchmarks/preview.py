"""Measures the preview and the report page: `python benchmarks/preview.py [-n RUNS] [RECIPE]`.

Prints the median and range of the wall and processor time of `render_preview` at 1280 × 720 of a
world (by default that of build_1025.yaml), warm, those of making the world itself, and those of
writing its report page, with the page's size, where truth and preview lie in its folder. Nothing is
asserted: read the table.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

from run import heading, spread, timed

from terrain_forge.making import plan
from terrain_forge.pipeline import realise
from terrain_forge.recipe import load_recipe
from terrain_forge.report import write_report_page
from terrain_forge.scene import render_preview, write_preview
from terrain_forge.truth import write_truth

HERE = Path(__file__).parent


def main() -> None:
    """Make the world, its picture and its page again and again, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", nargs="?", type=Path, default=HERE / "build_1025.yaml")
    parser.add_argument("-n", "--runs", type=int, default=5, help="counted runs")
    arguments = parser.parse_args()
    file = load_recipe(arguments.recipe)
    site = plan(file.recipe, folder=file.folder)
    world = realise(site)
    rows, columns = world.ground.shape
    heading(arguments.runs)
    print(f"{columns} × {rows} nodes, {len(world.field):,} rocks")
    tell("world", arguments.runs, lambda: realise(site))
    tell("preview, 1280 × 720", arguments.runs, lambda: render_preview(world))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_truth(world, folder)
        write_preview(world, folder / "preview.png")
        size = write_report_page(world, folder).stat().st_size
        tell(
            f"page of {size / 1e6:.2f} MB", arguments.runs, lambda: write_report_page(world, folder)
        )


def tell(name: str, runs: int, work: Callable[[], object]) -> None:
    """Print what some work takes, its first run not counted."""
    work()
    walls, works = timed(work, runs)
    print(f"{name:<22} wall {spread(walls, 2)} s, processor {spread(works, 2)} s")


if __name__ == "__main__":
    main()
