"""A tile: its ground and rocks are made, its files written, and moved to their place at once."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import platform
import resource
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from terrain_forge.base import OutputError, Stopwatch, silent, storing, sync, write_through
from terrain_forge.making import make_world
from terrain_forge.model import Tile, Window, World
from terrain_forge.paths import known_within
from terrain_forge.recipe import sha256
from terrain_forge.rovers import rover_of
from terrain_forge.tiling.beyond import shows_horizon, write_strips
from terrain_forge.tiling.exporting import export_tile
from terrain_forge.tiling.order import STAGING, TILE, TILE_FORMAT, TileOrder, load_order
from terrain_forge.tiling.picture import PICTURE, tile_step, write_picture
from terrain_forge.truth import write_tile_truth
from terrain_forge.writers import band_statistics


def make_tile(out: str, number: int) -> dict[str, Any]:
    """Make a tile of the site in a folder, unless it is there; returns what that took.

    Raises:
        StorageError: if the disk does not take it.
        OutputError: if something else than a tile is at its place.
    """
    begin = time.perf_counter(), time.process_time()
    order = load_order(Path(out))
    if not (order.folder(number) / TILE).is_file():
        with placing(order, number) as fresh:
            _write(order, number, fresh)
    return {
        "wall_s": time.perf_counter() - begin[0],
        "processor_s": time.process_time() - begin[1],
        "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }


@contextmanager
def placing(order: TileOrder, number: int) -> Iterator[Path]:
    """A new folder that takes the place of a tile, at once, when the block ends well.

    Raises:
        StorageError: if the disk does not take it.
        OutputError: if something else than a tile is at its place.
    """
    place = order.folder(number)
    # As deep as its place, so that what it refers to in the site's folder is there already.
    fresh = order.out / STAGING / f"{number}" / f"{platform.node()}-{os.getpid()}"
    with storing(place, order.out):
        shutil.rmtree(fresh, ignore_errors=True)
        try:
            fresh.parent.mkdir(exist_ok=True)  # an ended build's staging folder stays away
            fresh.mkdir()
            begun = fresh.stat().st_ino
            yield fresh
            if fresh.stat().st_ino != begun:  # the build has cleared up meanwhile
                raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(fresh))
            write_through(fresh)
            place.parent.mkdir(parents=True, exist_ok=True)
            _take_place(fresh, place)
            sync(place.parent)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
            with suppress(OSError):  # what an exporter made anew after an ended build cleared up
                fresh.parent.rmdir()
                fresh.parent.parent.rmdir()


def _take_place(fresh: Path, place: Path) -> None:
    """Move a tile to its place, if no other worker has done so meanwhile."""
    try:
        fresh.rename(place)
    except OSError as error:
        if (place / TILE).is_file():
            return
        if error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
            raise OutputError(
                f"{place} has no {TILE}, and is in the way of the tile: move it away, and build "
                "again, which makes it anew"
            ) from None
        raise


def _write(order: TileOrder, number: int, folder: Path) -> None:
    tile = tile_of(order, number)
    tiles = order.site.recipe.tiles
    parquet = tiles is not None and tiles.parquet
    counts, rock_id = write_tile_truth(tile, folder / "truth", parquet=parquet)
    write_picture(tile, rock_id, folder / PICTURE, step=tile_step(order.grid))
    if shows_horizon(order):
        write_strips(tile, order.grid, folder)
    figures: dict[str, Any] = {}
    for export in order.exports:
        place = folder / export.folder
        figures[export.folder] = export_tile(export, tile, order.grid, place)
    ground = tile.ground.elevation
    row, column = order.grid.place(number)
    names = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    told = {
        "format": TILE_FORMAT,
        "row": row,
        "column": column,
        "rocks": len(tile.field),
        "height_m": [float(ground.min()), float(ground.max())],
        "bytes": sum((folder / name).stat().st_size for name in names),
        "files": {name.as_posix(): sha256(folder / name) for name in names},
        "figures": figures,
        "statistics": {
            name.as_posix(): band_statistics(folder / name)
            for name in names
            if name.suffix == ".tif"
        },
        "counts": counts,
    }
    told["digest"] = digest_of(told)
    text = json.dumps(told, indent=1, allow_nan=False) + "\n"
    (folder / TILE).write_text(text, encoding="utf-8")


def digest_of(told: dict[str, Any]) -> str:
    """The hash of what a tile says of itself, but for its `digest`."""
    rest = {key: value for key, value in told.items() if key != "digest"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def tile_of(order: TileOrder, number: int) -> Tile:
    """A tile, in a world that is somewhat larger: what shapes its border lies beyond it."""
    window = order.grid.window(number)
    site, rover = order.site, rover_of(order.site)
    margin = known_within(rover, site.spacing) if rover.wheels else 1  # normals need one cell
    around = site.padded(window, margin * site.spacing)
    return world_of(order, around).tile(window, number=number)


def world_of(order: TileOrder, window: Window) -> World:
    """The world of a window of the site; what lies beyond is mostly other tiles."""
    watch = Stopwatch(silent)
    return make_world(order.site, window, settled=True, progress=watch, horizon=False)
