"""What tiles are together: what exports need of the whole, verification, list of files, page."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge import __version__
from terrain_forge.base import DataError, OutputError, Stopwatch, read_json, software, write_whole
from terrain_forge.building import foreign_files, hash_found, lists_outputs
from terrain_forge.dtm import open_dataset
from terrain_forge.model import (
    BuiltTile,
    Export,
    Tile,
    TiledSite,
    Trajectory,
    Window,
    World,
    path_points,
)
from terrain_forge.recipe import sha256
from terrain_forge.tiling.beyond import shows_horizon, site_horizon
from terrain_forge.tiling.exporting import begin_export, join_export
from terrain_forge.tiling.making import digest_of, tile_of, world_of
from terrain_forge.tiling.order import (
    FOLDER,
    STAGING,
    TILE,
    TILE_FORMAT,
    TileOrder,
    reading_of_tile,
)
from terrain_forge.truth import MATERIALS, merge_materials, write_merged
from terrain_forge.writers import write_vrt

MANIFEST = "manifest.json"
FORMAT = "tiles 1"
TABLE = "tiles.csv"
"""The list of tiles, in the folder of the order."""
REPORT = "validation/report.json"
_OWN = "map.png", "report.html", REPORT
"""Files of the whole that are written after its others; not all manifests list them."""
_MOST = 2**26


def sample_world(order: TileOrder) -> World:
    """The world of a corner of the site, for what all tiles share: shapes, colours, light."""
    return world_of(order, Window(column=0, row=0, columns=2, rows=2))


def begin_site(order: TileOrder, world: World) -> None:
    """Write what tiles share, of the sample world, before any of them."""
    for export in order.exports:
        begin_export(export, world, order.out / export.folder)


def read_tile(order: TileOrder, number: int) -> dict[str, Any]:
    """What a tile says of itself.

    Raises:
        OutputError: if it is damaged.
    """
    path = order.folder(number) / TILE
    try:
        told: dict[str, Any] = read_json(path, TILE, most=_MOST)
        here = (told["row"], told["column"]) == order.grid.place(number)
        if told["format"] == TILE_FORMAT and here and told["digest"] == digest_of(told):
            return told
    except (DataError, KeyError, TypeError):
        pass
    raise OutputError(
        f"{path} is damaged: move {path.parent} away, and build again, which makes it anew"
    )


def join(order: TileOrder, paths: tuple[Trajectory, ...], watch: Stopwatch) -> dict[str, Any]:
    """Bring the tiles and paths together; returns the site's manifest.

    Raises:
        OutputError: for a tile that is damaged.
    """
    out, site = order.out, order.site
    watch("verification")
    verification = write_merged(site, (one["counts"] for _, one in _each(order)), out / "truth")
    _join_truth(order)
    exports: dict[str, Any] = {}
    world = sample_world(order)
    if shows_horizon(order):
        watch("joining: horizon")
        heights = [height for _, told in _each(order) for height in told["height_m"]]
        horizon = site_horizon(order, world, lowest=min(heights), highest=max(heights))
        world = world.replace(horizon=horizon)
    for export in order.exports:
        watch(f"joining: {export.folder}")
        tiles = tuple(_built(order, export))
        near = partial(_near_paths, order, paths, tiles)
        tiled = TiledSite(site=site, grid=order.grid, world=world, tiles=tiles, near_paths=near)
        losses = join_export(export, tiled, out / export.folder)
        exports[export.folder] = {
            "kind": export.kind, "options": export.options, "losses": [*losses]
        }  # fmt: skip
    watch("manifest")
    rocks, size = _write_table(order)
    manifest = {
        "terrain_forge": __version__,
        "format": FORMAT,
        **site.stated,
        "versions": software(),
        "tiles": {
            "count": len(order.grid), "across": order.grid.across, "up": order.grid.up,
            "cells": order.grid.cells, "rocks": rocks,
            "bytes": size,
        },
        "exports": exports,
        "outputs": {name: sha256(out / name) for name in _outputs(order, exports)},
    }  # fmt: skip
    return {"manifest": manifest, "verification": verification}


def _near_paths(
    order: TileOrder, paths: tuple[Trajectory, ...], tiles: tuple[BuiltTile, ...], within: float
) -> Iterator[tuple[BuiltTile, Tile]]:
    """The tiles that lie no farther than `within` [m] from a path, with all paths."""
    if within <= 0.0:
        return
    site, grid = order.site, order.grid
    away = np.array([[-within, -within], [within, within]])
    cell = grid.cells * site.spacing
    found: set[int] = set()
    for path in paths:
        around = (path_points([path])[:, None] + away - (site.west, site.south)) / cell
        low, high = np.unique(np.floor(around).astype(np.int64), axis=0).transpose(1, 0, 2)
        for (west, south), (east, north) in zip(low.tolist(), high.tolist(), strict=True):
            rows = range(max(south, 0), min(north + 1, grid.up))
            columns = range(max(west, 0), min(east + 1, grid.across))
            found.update(row * grid.across + column for row in rows for column in columns)
    for number in sorted(found):
        tile = tile_of(order, number)
        world, whole = (part.replace(trajectories=paths) for part in (tile.world, tile.whole))
        yield tiles[number], Tile(number=number, world=world, whole=whole)


def _join_truth(order: TileOrder) -> None:
    """Write a VRT over each of the tiles' truth rasters, and the shares of all materials."""
    tiles = [
        (order.grid.window(n), order.grid.folder(n), told["statistics"]) for n, told in _each(order)
    ]
    truth = order.out / "truth"
    for one in sorted((order.folder(0) / "truth").glob("*.tif")):
        parts = [
            (window, f"../{folder}/truth/{one.name}", statistics[f"truth/{one.name}"])
            for window, folder, statistics in tiles
        ]
        with reading_of_tile(one, order.folder(0)):
            raster = open_dataset(one)
        with raster:
            path = truth / f"{one.stem}.vrt"
            write_vrt(path, parts, order.site, order.grid, like=raster)
    if (order.folder(0) / "truth" / MATERIALS).is_file():
        tables = [(truth / f"../{folder}/truth" / MATERIALS, window) for window, folder, _ in tiles]
        merge_materials(tables, order.grid, truth / MATERIALS)


def _outputs(order: TileOrder, exports: Iterable[str]) -> list[str]:
    """Files of the whole, without those that an earlier build of the same site did not write."""
    out = order.out
    added: set[str] = set()
    with suppress(OutputError):  # there was none, or it cannot be read
        added.update(added_files(order, read_site(out)))
    names = [
        path.relative_to(out).as_posix()
        for folder in (FOLDER, "paths", "truth", *exports)
        for path in sorted((out / folder).rglob("*"))
        if path.is_file()
    ]
    names += [f"validation/{path.name}" for path in sorted((out / "validation").glob("drive*"))]
    return [name for name in names if name not in added]


def added_files(order: TileOrder, manifest: dict[str, Any]) -> list[str]:
    """Files, links and empty folders outside of the tiles that are not the site's."""
    tiles = {order.grid.folder(number) for number in range(len(order.grid))}
    rows = {f"{place.rpartition('/')[0]}/" for place in tiles}  # empty where tiles are missing
    listed = {"outputs": {*manifest["outputs"], *_OWN, *rows}}
    found = foreign_files(order.out, listed)
    return [name for name in found if "/".join(name.split("/")[:3]) not in tiles]


def faults_of_files(folder: Path, listed: Mapping[str, str]) -> list[str]:
    """What is amiss with files of a folder, of which a list has the hashes."""
    found = []
    for name, wanted in listed.items():
        path = folder / name
        if not path.is_file():
            found.append(f"{name} is missing")
        elif hash_found(path) != wanted:
            found.append(f"{name} is damaged")
    return found


def write_manifest(order: TileOrder, manifest: dict[str, Any]) -> None:
    """Write the list of what the site is, after all else."""
    text = json.dumps(manifest, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    # A killed process leaves nothing but in the staging folder.
    write_whole(order.out / STAGING / MANIFEST, text).replace(order.out / MANIFEST)


def _each(order: TileOrder) -> Iterator[tuple[int, dict[str, Any]]]:
    for number in range(len(order.grid)):
        yield number, read_tile(order, number)


def _built(order: TileOrder, export: Export) -> Iterator[BuiltTile]:
    for number, told in _each(order):
        row, column = order.grid.place(number)
        yield BuiltTile(
            number=number,
            row=row,
            column=column,
            window=order.grid.window(number),
            folder=f"../{order.grid.folder(number)}/{export.folder}",
            height=tuple(told["height_m"]),
            rocks=told["rocks"],
            figures=told["figures"][export.folder],
            statistics={
                name.partition("/")[2]: bands
                for name, bands in told["statistics"].items()
                if name.startswith(f"{export.folder}/")
            },
        )


def _write_table(order: TileOrder) -> tuple[int, int]:
    """Write the list of tiles with the hashes of their own lists; returns rocks and bytes."""
    rocks = size = 0
    path = order.out / FOLDER / TABLE
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("row,column,rocks,lowest_m,highest_m,sha256\n")
        for number, told in _each(order):
            rocks, size = rocks + told["rocks"], size + told["bytes"]
            low, high = told["height_m"]
            digest = sha256(order.folder(number) / TILE)
            file.write(
                f"{told['row']},{told['column']},{told['rocks']},{low!r},{high!r},{digest}\n"
            )
    return rocks, size


def read_site(out: Path) -> dict[str, Any]:
    """The manifest of a built site in tiles.

    Raises:
        OutputError: if the folder holds none, or one whose build is not finished.
    """
    path = out / MANIFEST
    if not path.is_file():
        raise OutputError(f"{out} is not finished: the same build goes on with it")
    try:
        manifest: dict[str, Any] = read_json(path, MANIFEST, most=2**30)
    except DataError as error:
        raise OutputError(f"{path} is damaged: {error}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise OutputError(f"{path} is not one of this version of terrain-forge: move it away")
    if not lists_outputs(manifest):
        raise OutputError(f"{path} is damaged: it does not list the site's files")
    return manifest
