"""Building a site in tiles: what is missing is made, then all is brought together."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from terrain_forge.base import (
    OutputError,
    PluginError,
    Stopwatch,
    StorageError,
    TerrainForgeError,
    processors,
    run_tasks,
    size_text,
    storing,
    telling_interrupts,
    warn_user,
)
from terrain_forge.building import BuildResult, holding
from terrain_forge.recipe import sha256
from terrain_forge.tiling.checking import judge_again
from terrain_forge.tiling.driving import drive_far
from terrain_forge.tiling.exchange import Exchange, exchanging, make_tile_away, take_tile
from terrain_forge.tiling.joining import begin_site, join, sample_world, write_manifest
from terrain_forge.tiling.making import make_tile
from terrain_forge.tiling.order import TileOrder, is_site, require_plain, save_order
from terrain_forge.tiling.page import PAGE, write_page
from terrain_forge.tiling.picture import PICTURE
from terrain_forge.tiling.routing import lay_paths, require_paths_begin
from terrain_forge.truth import require_parquet
from terrain_forge.validation import UNPLACED_LIMIT

_log = logging.getLogger(__name__)
_MOST_FAILURES = 16
"""Tiles that fail until no further one is begun."""
_NAMED = 5
_KINDS = RuntimeError, OutputError, PluginError, StorageError
"""What tiles that failed are told as, the first that one of them is."""
STAGES = (
    "plan",
    "compile",
    "tiles",
    "verification",
    "paths",
    "drive",
    "joining",
    "report page",
    "manifest",
)
"""Stages of a build in tiles."""


@dataclass(frozen=True, kw_only=True)
class TiledResult(BuildResult):
    """What a build in tiles left behind; its world is that of the site's south-western corner."""

    tiles: int
    """Tiles of the site."""
    made: int
    """Those of them that were not there before."""

    def __repr__(self) -> str:
        return f"<TiledResult {str(self.directory)!r}: {self.tiles} tiles, {self.made} new>"


@dataclass
class _Pace:
    """What was made so far, and what that took."""

    made: int = 0
    processor: float = 0.0
    peak: int = 0
    failed: dict[int, Exception] = field(default_factory=dict)
    begin: float = field(default_factory=time.perf_counter)
    link: str = ""

    def count(self, number: int, result: dict[str, Any] | Exception) -> None:
        """Take note of a tile."""
        if isinstance(result, Exception):
            self.failed[number] = result
            _log.debug("tile %s", number, exc_info=result)
        else:
            self.made += 1
            self.processor += result["processor_s"]
            self.peak = max(self.peak, result["peak_bytes"])

    def told(self, missing: int) -> str:
        """How far it is."""
        gone = time.perf_counter() - self.begin
        rate = self.made / gone if gone else 0.0
        text = f"tiles: {self.made} of {missing}"
        if self.made:
            text += f", {rate:.2g} a second" if rate >= 1.0 else f", {1.0 / rate:.2g} s each"
        text += f", {len(self.failed)} failed" if self.failed else ""
        return text + (f", {self.link}" if self.link else "")


def build_tiles(
    order: TileOrder,
    *,
    watch: Stopwatch,
    workers: int | None = None,
    scheduler: str | None = None,
    exchange: str | None = None,
) -> TiledResult:
    """Make the tiles that are missing, and bring all together.

    Raises:
        OutputError: if the folder holds anything else, or the scheduler or the exchange cannot be
            used.
        StorageError: if the disk does not take the site.
        OutputError, PluginError, StorageError: names the tiles that failed; the others are whole.
        RuntimeError: the same, for a fault of ours.
        KeyboardInterrupt: with how far it came.
    """
    out = order.out
    tiles = order.site.recipe.tiles
    if tiles is not None and tiles.parquet:
        require_parquet()
    require_plain(out) if is_site(out) else require_paths_begin(order)

    def left() -> str:
        count = len(order.grid)
        there = f"{count - len(order.missing())} of {count} tiles are in {out}"
        return f"{there}: the same command goes on from there"

    with telling_interrupts(left), holding(out):
        pace = _Pace()
        _make_missing(order, pace, watch, exchange, workers=workers, scheduler=scheduler)
        if pace.failed:
            raise _failure(order, pace.failed)
        with storing(out, out):
            paths = lay_paths(order, watch)
            driven = order.site.recipe.validate and order.site.recipe.validate.drive_spec
            passed = not driven or drive_far(order, paths, driven, watch)
            joined = join(order, paths, watch)
            _warn_of_unplaced(joined["verification"], joined["manifest"]["tiles"]["rocks"])
            watch("report page")
            write_page(order, joined["verification"], joined["manifest"], paths)
            joined["manifest"]["outputs"] |= {name: sha256(out / name) for name in (PICTURE, PAGE)}
            write_manifest(order, joined["manifest"])
            passed = judge_again(order, joined["manifest"]) and passed
    watch.figures.update(
        tiles=len(order.grid), tiles_made=pace.made,
        workers=processors() if workers is None else workers,
        processor_s=round(pace.processor, 3), peak_worker_bytes=pace.peak,
    )  # fmt: skip
    watch.write(out)
    return TiledResult(
        directory=out,
        world=sample_world(order),
        passed=passed,
        exports=order.exports,
        tiles=len(order.grid),
        made=pace.made,
    )


def _warn_of_unplaced(verification: dict[str, Any], placed: int) -> None:
    """Tell of rocks without a free place, where a single world would fail its check of them."""
    unplaced = sum(one["unplaced"] for one in verification["populations"])
    if unplaced > max(UNPLACED_LIMIT * (unplaced + placed), 1.0):
        warn_user(
            f"up to {unplaced:,} rocks found no free place, beside {placed:,} that did (those at "
            "borders of tiles count more than once): truth/size_frequency.json has them by "
            "population; fewer, smaller or otherwise arranged ones do"
        )


def _make_missing(
    order: TileOrder, pace: _Pace, watch: Stopwatch, exchange: str | None, **given: Any
) -> None:
    """Write what is planned, then the tiles that are missing; their pace tells how that went."""
    away = exchange and order.missing()
    with exchanging(order, str(exchange)) if away else nullcontext() as there:
        with storing(order.out, order.out):
            world = sample_world(order)  # what no tile can be made of leaves nothing behind
            save_order(order)
            begin_site(order, world)
        missing = order.missing()
        watch.follow(STAGES)
        watch(f"tiles: 0 of {len(missing)}")
        given["told"] = partial(setattr, pace, "link")
        for number, result in _made(order, missing, there, given):
            pace.count(number, result)
            if len(pace.failed) >= _MOST_FAILURES:
                break
            share = (pace.made + len(pace.failed)) / len(missing)
            watch(pace.told(len(missing)), share)


def _made(
    order: TileOrder, missing: list[int], there: Exchange | None, given: dict[str, Any]
) -> Iterator[tuple[int, dict[str, Any] | Exception]]:
    """Each tile once it is in its place, with what it took, or why it is not."""
    if there is None:
        yield from run_tasks(partial(make_tile, str(order.out)), missing, **given)
        return
    for number, result in run_tasks(partial(make_tile_away, there), missing, **given):
        if not isinstance(result, Exception):
            try:
                take_tile(order, there, number, result["sha256"])
            except TerrainForgeError as error:
                yield number, error
                continue
        yield number, result


def _failure(order: TileOrder, failed: dict[int, Exception]) -> Exception:
    """The error that names tiles which failed, and says why one of the first of `_KINDS` did."""
    named = ", ".join(order.grid.folder(number) for number in sorted(failed)[:_NAMED])
    more = f" and {len(failed) - _NAMED} more" if len(failed) > _NAMED else ""
    number = min(failed, key=lambda number: (_KINDS.index(_kind_of(failed[number])), number))
    first = failed[number]
    why = " ".join(str(first).split()) or type(first).__name__
    failure = _kind_of(first)(
        f"{order.out}: {len(failed)} tile{'s' * (len(failed) > 1)} failed twice, {named}{more}: "
        f"{why}; what is whole stays, and the same build goes on"
    )
    failure.__cause__ = first
    return failure


def _kind_of(error: Exception) -> type[Exception]:
    """What an error of a tile is told as; one that is nobody's else is ours."""
    if isinstance(error, PluginError):
        return PluginError
    if isinstance(error, StorageError | OSError | MemoryError):
        return StorageError
    return OutputError if isinstance(error, TerrainForgeError) else RuntimeError


def progress_figures(result: TiledResult) -> str:
    """A line about what a build in tiles took."""
    told: dict[str, Any] = json.loads((result.directory / "timings.json").read_text())
    peak = size_text(told["peak_worker_bytes"])
    each = told["processor_s"] / max(result.made, 1)
    return f"{result.made} of {result.tiles} tiles made, {each:.2g} s of a core and {peak} each"
