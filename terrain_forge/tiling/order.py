"""What a site in tiles is made from, as its folder keeps it: the planned site and the exports.

OUT/site/site.json, arrays.npz   the planned site
OUT/site/order.json              tiles, exports, versions
OUT/tiles/ROW/COLUMN/            the files of a tile, with tile.json; whole or not there
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    DataError,
    OutputError,
    RecipeError,
    from_plain,
    hold_interrupts,
    read_arrays,
    read_json,
    reading,
    refused_name,
    software,
    sync,
    to_plain,
    unchanging,
    write_arrays,
    write_through,
)
from terrain_forge.building import require_formats
from terrain_forge.model import (
    Export,
    RockLibrary,
    Site,
    TileGrid,
    lacking,
    plain_options,
    sensor_kinds,
)
from terrain_forge.recipe import ExportOrder, Recipe, tile_cells
from terrain_forge.rocks import bank_reach, find_library, rock_margin
from terrain_forge.terrain import stencil_reach

FOLDER, ORDER = "site", "order.json"
STAGING = ".terrain-forge"
"""Where tiles are made, in the site's folder."""
_SITE, _ARRAYS = "site.json", "arrays.npz"
PLANNED = _SITE, _ARRAYS, ORDER
"""Files of the planned site."""
TILE = "tile.json"
"""A tile's own list of its files."""
TILE_FORMAT = 2
MOST = 2**30
"""Bytes of a site's JSON."""
RESERVED = {FOLDER, STAGING, TILE, "tiles", "map.png", "border.npz"}
"""Names in a site's folder, or in a tile's, that no export may have, in any case."""
TILED = "geotiff", "usd", "glb", "sdf"
"""Exporters of ours that write tile by tile."""


@contextmanager
def reading_of_tile(path: Path, folder: Path) -> Iterator[None]:
    """Within it a file of a tile is read; tells what to do where that is damaged.

    Raises:
        OutputError: names the tile's folder, which may be moved away.
    """
    try:
        with reading(path.name):
            yield
    except DataError as error:
        raise OutputError(
            f"{path} is damaged ({error}): move {folder} away, and build again, which makes it anew"
        ) from None


@dataclass(frozen=True, kw_only=True)
class TileOrder:
    """A site in tiles that is to be built, or was."""

    out: Path
    """The folder of the site."""
    site: Site
    """The planned site."""
    grid: TileGrid
    """How it is cut."""
    exports: tuple[Export, ...]
    """What is exported of each tile."""

    def missing(self) -> list[int]:
        """Numbers of the tiles that are not there."""
        return [n for n in range(len(self.grid)) if not (self.folder(n) / TILE).is_file()]

    def folder(self, number: int) -> Path:
        """Where a tile's files lie."""
        return self.out / self.grid.folder(number)


def require_plain(out: Path) -> None:
    """Refuse links and pipes where a site's files are written in place, or its tiles moved to.

    Raises:
        OutputError: names the first.
    """
    above = [path for path in sorted(out.iterdir()) if path.name != STAGING]
    folders = [path for path in above if path.is_dir() and not path.is_symlink()]
    depth = {"tiles": "*"}  # whose rows are folders that tiles are moved to
    within = (one for path in folders for one in sorted(path.glob(depth.get(path.name, "**/*"))))
    for path in (*above, *within):
        if path.is_symlink() or not (path.is_dir() or path.is_file()):
            what = "a link" if path.is_symlink() else "no regular file"
            raise OutputError(f"{path} is {what}, and is in the way of the site's: move it away")


def is_site(out: Path) -> bool:
    """Whether a folder is that of a site in tiles, finished or not."""
    return (out / FOLDER / ORDER).is_file()


def require_whole(
    out: Path, workers: int | None, scheduler: str | None, exchange: str | None
) -> None:
    """Refuse what is for sites in tiles alone, where a world is built as one.

    Raises:
        OutputError: says what.
    """
    if is_site(out):
        raise OutputError(f"{out} holds a site in tiles: choose another folder with -o")
    if {workers, scheduler, exchange} != {None}:
        raise OutputError(
            "--workers, --scheduler and --exchange are for sites in tiles: add `tiles: {}` to the "
            "recipe"
        )


def require_tiles(recipe: Recipe, orders: Sequence[ExportOrder]) -> None:
    """Refuse what a recipe in tiles cannot have, before its heights are read.

    Raises:
        RecipeError: for tiles that are no whole number of cells, an export that is not made tile
            by tile, has the name of what a site has or options of whole worlds, or what needs the
            whole site.
    """
    for order in orders:
        if why := refused_name(order.folder, RESERVED, "site in tiles"):
            raise RecipeError(why, key=("exports", order.folder))
        with hold_interrupts():  # a door loads what is behind it when asked
            tiled = all(hasattr(order.exporter, name) for name in ("export_tile", "join_tiles"))
        if not tiled:
            raise RecipeError(
                f"{order.kind} is not written tile by tile, as {', '.join(TILED)} are: leave it "
                "out, and take a part of the built site with `terrain-forge cut`",
                key=("exports", order.folder),
            )
        _require_tiled_options(order)
    if recipe.validate is not None and recipe.validate.drives:
        raise RecipeError(
            "drives from random starts are for one world: leave it out, and drive in a part that "
            "`terrain-forge cut` takes",
            key=("validate", "drives"),
        )
    if recipe.tiles is not None and recipe.tiles.size_m is not None:
        size, spacing = recipe.tiles.size_m, recipe.terrain.spacing_m
        exact, cells = size / spacing, tile_cells(recipe)
        if cells < 2 or abs(exact - cells) > 1e-6 * cells:
            nearest = max(cells, 2) * spacing
            raise RecipeError(
                f"{size:g} m is not a whole number (2 or more) of cells of {spacing:g} m; "
                f"{nearest:g} m would be",
                key=("tiles", "size_m"),
            )


def _require_tiled_options(order: ExportOrder) -> None:
    """Refuse what an exporter can choose for a world alone, but for its default."""
    usual = {option.name: option.default for option in fields(order.options)}
    for name in getattr(order.options, "whole_only", ()):
        if getattr(order.options, name) != usual[name]:
            raise RecipeError(
                "has no effect on a site in tiles: leave it out",
                key=("exports", order.folder, name),
            )


def order_tiles(site: Site, out: Path, orders: Sequence[ExportOrder]) -> TileOrder:
    """Check that a site can be built in tiles.

    Raises:
        RecipeError: as `require_tiles`, or for tiles smaller than what lies in them.
        ExportError: for pebbles that the site cannot have.
    """
    require_tiles(site.recipe, orders)
    require_formats(orders, site)
    _require_large_tiles(site, find_library(site.recipe.rocks.library, custom=site.meshes))
    grid = TileGrid.of(site, tile_cells(site.recipe))
    exports = tuple(
        Export(folder=order.folder, kind=order.kind, options=plain_options(order.options))
        for order in orders
    )
    return TileOrder(out=out, site=site, grid=grid, exports=exports)


def require_large_tiles(site: Site) -> None:
    """Refuse tiles smaller than what lies in them, by as many shapes as are made in a moment.

    Raises:
        RecipeError: for tiles that are too small. A build, which has all shapes, may find one that
            reaches still farther.
    """
    library = site.recipe.rocks.library
    _require_large_tiles(site, find_library(library.sample(), custom=site.meshes))


def _require_large_tiles(site: Site, library: RockLibrary) -> None:
    rocks, layers = site.recipe.rocks, site.recipe.terrain.layers
    margin = rock_margin(
        site=site, populations=rocks.populations, lists=rocks.lists, library=library
    )
    reaches = {
        f"the ground that a rock of {site.largest_rock:.3g} m needs around it": margin
        + bank_reach(site, library),
        "the reach of the ground's layers": stencil_reach(site, layers),
    }
    what, reach = max(reaches.items(), key=lambda item: item[1])
    side = site.tile_side
    if side < reach:
        raise RecipeError(
            f"tiles of {side:g} m are smaller than {what}, {reach:.3g} m: choose larger ones, or "
            "smaller rocks",
            key=("tiles", "size_m"),
        )


def save_order(order: TileOrder) -> None:
    """Write the order into its site's folder, which must be held, at once.

    Raises:
        OutputError: if the folder holds anything but the same order.
    """
    if is_site(order.out):
        _require_same(order)
        return
    if any(path.name != STAGING for path in order.out.iterdir()):
        raise OutputError(
            f"{order.out} exists and is no site in tiles; remove it or choose another with -o"
        )
    fresh = order.out / STAGING / FOLDER
    fresh.mkdir()
    write_planned(order, fresh)
    write_through(fresh)
    fresh.rename(order.out / FOLDER)
    sync(order.out)


def write_planned(order: TileOrder, folder: Path) -> None:
    """Write the files of the planned site into a folder."""
    texts, arrays = _planned(order)
    for name, content in texts.items():
        (folder / name).write_bytes(content)
    write_arrays(folder / _ARRAYS, arrays)


def _planned(order: TileOrder) -> tuple[dict[str, bytes], dict[str, NDArray[Any]]]:
    """The texts of the planned site by the names of their files, and its arrays."""
    arrays: dict[str, NDArray[Any]] = {}
    site = to_plain(order.site, arrays, "site")
    told = {
        "format": 1,
        "cells": order.grid.cells,
        "exports": [{"folder": e.folder, "kind": e.kind, "options": e.options}
                    for e in order.exports],
        "made_by": software(),
    }  # fmt: skip
    return {_SITE: _json(site), ORDER: _json(told)}, arrays


def _json(plain: Any) -> bytes:
    return (json.dumps(plain, indent=1, allow_nan=False) + "\n").encode()


def _require_same(order: TileOrder) -> None:
    out, folder = order.out, order.out / FOLDER
    texts, arrays = _planned(order)
    mine, theirs = json.loads(texts[ORDER]), _read(folder / ORDER)
    for part, what in (
        ("made_by", "was begun by {theirs}, this is {mine}"),
        ("cells", "holds tiles of {theirs} cells, this recipe makes tiles of {mine}"),
        ("exports", "holds tiles with other exports: {theirs}, not {mine}"),
    ):
        if part == "made_by" and isinstance(theirs.get(part), dict):
            # A site that was begun when fewer were told goes on.
            known = {"terrain-forge", *theirs[part]}
            mine[part] = {name: one for name, one in mine[part].items() if name in known}
        if mine[part] != theirs.get(part):
            told = {"mine": _told(mine[part]), "theirs": _told(theirs.get(part))}
            raise OutputError(
                f"{out} {what.format(**told)}; nothing was changed: choose another folder with -o"
            )
    if not (_holds(folder / _SITE, texts[_SITE]) and _holds_arrays(folder / _ARRAYS, arrays)):
        raise OutputError(
            f"{out} holds tiles of another recipe{_difference(folder, texts[_SITE])}; nothing was "
            "changed: choose another folder with -o"
        )


def _holds(path: Path, content: bytes) -> bool:
    return path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content


def _holds_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> bool:
    try:
        there = read_arrays(path, mapped=True)
    except DataError:
        return False
    return there.keys() == arrays.keys() and all(
        there[name].dtype == array.dtype and np.array_equal(there[name], array)
        for name, array in arrays.items()
    )


def _difference(folder: Path, site: bytes) -> str:
    """Where two recipes differ first."""
    mine = json.loads(json.loads(site)["recipe_json"])
    try:
        theirs = dict(json.loads(_read(folder / _SITE)["recipe_json"]))
    except (OutputError, KeyError, TypeError, ValueError, RecursionError):
        return ", or is damaged"
    return next(
        (
            f" ({key}: {_told(theirs.get(key))}, not {_told(mine[key])})"
            for key in mine
            if mine[key] != theirs.get(key)
        ),
        "",
    )


def _told(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {some}" for name, some in value.items())
    if isinstance(value, list):
        folders = (one.get("folder", "?") if isinstance(one, dict) else one for one in value)
        return ", ".join(map(_told, folders)) or "none"
    return str(value)[:60]


def _read(path: Path) -> dict[str, Any]:
    try:
        found = read_json(path, path.name, most=MOST)
    except DataError as error:
        raise OutputError(f"{path} is damaged: {error}") from None
    if not isinstance(found, dict):
        raise OutputError(f"{path} is damaged: no mapping")
    return found


def load_order(out: Path) -> TileOrder:
    """The order of a site in tiles.

    Raises:
        OutputError: if the folder is none.
    """
    path = out / FOLDER / ORDER
    if not path.is_file():
        raise OutputError(f"{out} is no site in tiles (no {FOLDER}/{ORDER})")
    state = path.stat()
    return _load(str(out), state.st_mtime_ns, state.st_ino)


@lru_cache(maxsize=2)
def _load(out: str, *state: int) -> TileOrder:
    del state
    sensor_kinds()  # registers them among the records
    folder = Path(out) / FOLDER
    told = _read(folder / ORDER)
    try:
        with reading(FOLDER):
            plain, there = _read(folder / _SITE), read_arrays(folder / _ARRAYS, mapped=True)
            # They are written once: a tile looks at those around it alone.
            arrays = {name: unchanging(array) for name, array in there.items()}
            site = from_plain(plain, arrays, Site)
            _ = site.recipe  # read once, here
            return TileOrder(
                out=Path(out),
                site=site,
                grid=TileGrid.of(site, int(told["cells"])),
                exports=tuple(Export(**plain) for plain in told["exports"]),
            )
    except (DataError, RecipeError) as error:
        made_by = told.get("made_by")
        gone = lacking(made_by) if isinstance(made_by, dict) else ""
        hint = f"; install {gone}, with which it was built" if gone else ""
        raise OutputError(f"{folder} is damaged: {error}{hint}") from None
