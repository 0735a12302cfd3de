"""What tiles of a large site cost: processor time and memory of each, and planning.

    python benchmarks/tiles.py RECIPE [--tiles 3] [--out FOLDER]

The recipe is planned, and some tiles from the middle of its site are made in this process, one
after another.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import terrain_forge as tf
from terrain_forge.building import chosen_exports, holding
from terrain_forge.tiling import begin_site, make_tile, order_tiles, save_order


def main() -> None:
    """Make some tiles and print what each took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path)
    parser.add_argument("--tiles", type=int, default=3)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    out = given.out or Path(tempfile.mkdtemp()) / "site"
    file = tf.load_recipe(given.recipe)
    begin = time.perf_counter(), time.process_time()
    site = tf.plan(file.recipe, folder=file.folder)
    order = order_tiles(site, out, chosen_exports(file.recipe, None))
    with holding(out):
        save_order(order)
        begin_site(order)
    tell("plan", begin, f"{len(order.grid)} tiles")
    middle = order.grid.up // 2 * order.grid.across + order.grid.across // 2
    for number in range(middle, middle + given.tiles):
        begin = time.perf_counter(), time.process_time()
        make_tile(str(out), number)
        files = [path for path in order.folder(number).rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
        tell(order.grid.folder(number), begin, f"{len(files)} files, {size / 1e6:.1f} MB")


def tell(what: str, begin: tuple[float, float], more: str) -> None:
    """Print what something took."""
    wall, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    print(f"{what}: {wall:.2f} s, {processor:.2f} s of processors, peak {peak:.0f} MB, {more}")


if __name__ == "__main__":
    main()
