"""The pipeline: plan a Site from a recipe, realise a World of a window of it, build its folder.

recipe ─plan─► Site (+ Routes) ─realise(window)─► World: library ► ground ► rocks ► paths
└─build─► files ► validation ► page
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from terrain_forge import building, making, recording, report, tiling, validation, variation
from terrain_forge.base import (
    Coordinate,
    OutputError,
    Pair,
    PositivePair,
    Progress,
    RecipeError,
    Stopwatch,
    Workers,
    checked,
    compile_ahead,
    hint_at,
    require_scheduler,
    resolved,
    telling_interrupts,
)
from terrain_forge.model import Export, Site, Window, World
from terrain_forge.recipe import (
    DatasetSpec,
    ExportOrder,
    Recipe,
    RecipeFile,
    export_orders,
    given_recipe,
    input_paths,
    require_fits,
)
from terrain_forge.rovers import resolve_rover, rover_of
from terrain_forge.terminal import watched

MAKING = "plan", "rock library", "ground", "rocks", "paths"
"""Stages until there is a world."""
ASSESSING = "validation", "report page", "manifest"
PREVIEW_STAGES = ("plan", "compile", *MAKING[1:])
"""Stages of a preview."""
STAGES = (*PREVIEW_STAGES, "writing", *ASSESSING)
"""Stages of a build."""
VALIDATE_STAGES = ("load", *ASSESSING)
"""Stages of a validation of what is there."""


def record_stages() -> tuple[str, ...]:
    """Stages of a recording of a built world."""
    return (*recording.RECORDING, "report page")


def export_stages(only: tuple[str, ...]) -> tuple[str, ...]:
    """Stages of an export of so many folders."""
    return ("load", *(f"export {folder}" for folder in only), *ASSESSING)


@checked
def realise(
    site: Site,
    window: Window | None = None,
    *,
    settled: bool = True,
    horizon: bool = True,
    progress: Progress | bool = False,
) -> World:
    """Make the world of a window of a site; without a window, of the whole site.

    A window's ground, rocks and rasters equal the same cut of any larger window, bit for bit.
    Paths are laid where they lie wholly within the window; planned ones, which depend on all of the
    ground and its rocks, only in the world of the whole site.

    Args:
        site: The place.
        window: A part of it.
        settled: Whether dynamic rocks are settled by physics; else they are embedded as the static
            ones, which is quicker and enough for a look at a recipe.
        horizon: Whether what lies beyond its edge is made, where the recipe wants it.
        progress: Called with each stage as it begins; True shows them.

    Raises:
        RecipeError: if rocks cannot be packed so densely, a planned path cannot be found, or the
            driven one starts within a rock.
        DataError: if the window does not lie in the site.
    """
    if window is None:
        require_fits(site)
    with watched(progress, MAKING[1:]) as watch:
        part = window or site.window
        return making.make_world(site, part, settled=settled, horizon=horizon, progress=watch)


@checked
def build(
    recipe: Recipe | RecipeFile | Path | str,
    out: Path | str | None = None,
    *,
    folder: Path | str = ".",
    only: tuple[str, ...] | str | None = None,
    force: bool = False,
    workers: Workers | None = None,
    scheduler: str | None = None,
    exchange: str | None = None,
    progress: Progress | bool = False,
) -> building.BuildResult:
    """Make a recipe's world and write all of it.

    A site in `tiles`, or too large for memory, is built tile by tile, in place: what a killed build
    has left whole stays, and the next one goes on (docs/sites.md).

    Args:
        recipe: what to make, or its file.
        out: output folder; by default the recipe's name in the current folder. An older world
            of ours is replaced when the new one is whole.
        folder: what the recipe's paths are relative to; of a file, its own folder.
        only: folders of the exports to write; by default all of the recipe.
        force: whether files may be removed that lie in the older world and are not its own.
        workers: processes that make tiles, by default one for each core; no number changes a byte.
        scheduler: address of the Dask scheduler whose workers make tiles, or `local`.
        exchange: address of fsspec by which tiles come from workers that do not see `out`.
        progress: called with each stage as it begins, and how far it is; True shows them.

    Raises:
        RecipeError, DataError, ExportError: the recipe cannot be built; nothing is written.
        OutputError: `out` exists and is not ours, holds an input, or files that are not its own;
            or another process writes it.
        StorageError: the disk does not take the world; an older one stays.
    """
    recipe, folder = given_recipe(recipe, folder)
    out = resolved(out or recipe.name)
    with watched(progress, STAGES) as watch:
        watch("plan")
        inputs = input_paths(recipe, Path(folder))
        if out.exists():  # files that the rover's own file names
            inputs += resolve_rover(recipe.rover, Path(folder)).files
        building.require_apart(out, inputs)
        if scheduler is not None:
            require_scheduler(scheduler)
        elif exchange is not None:
            raise OutputError("--exchange is for the workers of a --scheduler")
        lost = () if tiling.is_site(out) else building.require_ours(out, force=force)
        removed = building.told_files(out, lost)
        orders = building.chosen_exports(recipe, only)
        draft = making.draft(recipe, folder=folder)
        recording.require_recordable(recipe, draft.rover)
        if draft.is_whole:
            tiling.require_whole(out, workers, scheduler, exchange)
        elif draft.named.tiles is not None:
            tiling.require_tiles(draft.named, orders)
        draft = making.with_fetched(draft, progress=watch)
        compile_ahead(watch)
        site = making.plan_draft(draft, progress=watch)
        if site.recipe.tiles is not None:
            order = tiling.order_tiles(site, out, orders)
            return tiling.build_tiles(
                order, watch=watch, workers=workers, scheduler=scheduler, exchange=exchange
            )
        tiling.require_whole(out, workers, scheduler, exchange)
        recording.require_long_enough(site, draft.rover.sensors)
        building.require_formats(orders, site)
        expected = building.stage_seconds(site, orders)
        watch.expect(expected)
        with building.replacing(out, force=force) as directory:
            world = realise(site, progress=watch)
            exports, passed = _write_whole(world, directory, orders=orders, watch=watch)
        driven = building.drive_seconds(site)
        building.learn(expected, watch.seconds, watch.work, driven=driven, passed=passed)
    return building.BuildResult(
        directory=out, world=world, passed=passed, exports=exports, removed=removed
    )


@checked
def write_world(
    world: World,
    out: Path | str,
    *,
    exports: tuple[str, ...] | dict[str, dict[str, Any]] | None = None,
    force: bool = False,
    progress: Progress | bool = False,
) -> building.BuildResult:
    """Write a world that was made or changed in Python as `build` writes a recipe's.

    The manifest names the recipe that the world began with; edits are in the saved world alone. Of
    a window's world what is written are its own rocks: no others reach into it, in no format.

    Args:
        world: The world.
        out: Output folder; an older world of ours is replaced when the new one is whole.
        exports: Formats to write, as a recipe's `exports`; by default those of the world's recipe.
        force: Whether files may be removed that lie in the older world and are not its own.
        progress: Called with each stage as it begins, and how far it is; True shows them.

    Raises:
        RecipeError, ExportError: for an unknown exporter or option, or a world that a format cannot
            hold; nothing is written.
        OutputError, StorageError: as `build`.
    """
    out, recipe = resolved(out), world.site.recipe
    building.require_folder(out)
    orders = export_orders(recipe if exports is None else replace(recipe, exports=exports))
    removed = building.told_files(out, building.require_ours(out, force=force))
    world = world.alone()
    with (
        watched(progress, ("writing", *ASSESSING)) as watch,
        building.replacing(out, force=force) as directory,
    ):
        written, passed = _write_whole(world, directory, orders=orders, watch=watch)
    return building.BuildResult(
        directory=out, world=world, passed=passed, exports=written, removed=removed
    )


def _write_whole(
    world: World, directory: Path, *, orders: tuple[ExportOrder, ...], watch: Stopwatch
) -> tuple[tuple[Export, ...], bool]:
    """Write all of a world into an empty folder; its exports, and whether all checks passed."""
    exports = building.write_files(world, directory, orders=orders, watch=watch)
    return exports, report.assess(world, directory, exports=exports, watch=watch)


@checked
def cut(
    site: Path | str,
    out: Path | str,
    *,
    centre: Pair,
    size: PositivePair,
    only: tuple[str, ...] | str | None = None,
    force: bool = False,
    progress: Progress | bool = False,
) -> building.BuildResult:
    """Write a part of a site in tiles as a world of its own.

    Args:
        site: The folder of the site; it need not be finished.
        out: Output folder; an older world of ours is replaced when the new one is whole.
        centre: The part's middle, east and north [m].
        size: Its size, east and north [m].
        only: Formats to write: folders of the site's recipe, with their options, or else exporters,
            with defaults; by default those of the recipe.
        force: Whether files may be removed that lie in the older world and are not its own.
        progress: Called with each stage as it begins, and how far it is; True shows them.

    Raises:
        OutputError: if there is no such site, or the part is not in it.
        RecipeError, ExportError, StorageError: as `write_world`.
    """
    out, place = resolved(out), resolved(site)
    if out.is_relative_to(place):
        raise OutputError(f"{out} lies in the site: choose another folder with -o")
    if only:
        building.chosen_exports(tiling.load_order(place).site.recipe, only)
    building.require_ours(out, force=force)
    with watched(progress, STAGES) as watch:
        world = tiling.cut_world(place, centre=centre, size=size, watch=watch)
        planned = building.planned_exports(world.site.recipe)
        names = planned if only is None else (only,) if isinstance(only, str) else only
        exports = {name: planned.get(name, {}) for name in names}
        return write_world(world, out, exports=exports, force=force, progress=watch)


@checked
def export(
    out: Path | str,
    only: tuple[str, ...] | str,
    *,
    force: bool = False,
    progress: Progress | bool = False,
) -> bool:
    """Write further formats from a built world, then validate; drives that still hold are kept.

    Args:
        out: The built folder.
        only: Folders of the recipe's exports, with their options, or else exporters, with defaults;
            one may stand alone.
        force: Whether files may be removed that lie in those folders and are not the world's, or
            that were edited since and would be written anew.
        progress: Called with what is being done; True shows it.

    Returns:
        Whether all checks of these exports passed, and all others that had not failed before.

    Raises:
        OutputError: if the folder is not a world of ours, another process writes it, or `only`
            names no exporter.
        StorageError: if the disk does not take the files.
    """
    only = (only,) if isinstance(only, str) else tuple(only)
    out = resolved(out)
    building.finish(out)
    older = {check.name for check in validation.failed_checks(out)}
    with watched(progress, export_stages(only)) as watch:
        manifest = building.read_manifest(out)
        watch("load")
        world = World.load(out)
        orders = building.re_export_orders(world, out, only)
        folders = [order.folder for order in orders]
        building.require_listed(out, manifest, folders, force=force)
        before = building.folder_state(out, manifest, *(f"{folder}/" for folder in folders))
        exports = {export.folder: export for export in building.exports_in(manifest)}
        with (
            building.updating(out, anew=folders, foreign=before.foreign) as fresh,
            building.blaming(out, before.altered),
        ):
            for order in orders:
                watch(f"export {order.folder}")
                exports[order.folder] = building.write_export(world, fresh, order)
            report.assess(
                world,
                fresh,
                exports=tuple(exports.values()),
                watch=watch,
                before=before,
                dataset=recording.dataset_folder(out),
                # No other format can change how a rover drives through the MJCF.
                keep_drives=before.intact and all(order.kind != "mjcf" for order in orders),
            )
    mine = tuple(f"{folder}: " for folder in folders)
    failed = (check.name for check in validation.failed_checks(out))
    return all(name in older and not name.startswith(mine) for name in failed)


@checked
def validate(
    out: Path | str,
    *,
    every_consumer: bool = True,
    drives: int | None = None,
    force: bool = False,
    progress: Progress | bool = False,
) -> bool:
    """Validate a built world again.

    Args:
        out: The built folder.
        every_consumer: Whether to open its exports in all consumers that are installed; else only
            what a build checks is checked.
        drives: From how many random starts to drive; by default what the recipe says.
        force: Whether a report or page that was edited since may be written anew.
        progress: Called with what is being done; True shows it.

    Returns:
        Whether all checks passed; a consumer that was not run neither passes nor fails.

    Raises:
        OutputError: if the folder is not a world of ours, what would be written anew was edited,
            or another process writes it.
        StorageError: if the disk does not take the files.
    """
    out = resolved(out)
    if tiling.is_site(out):
        if drives:
            raise OutputError(
                f"{out} is a site in tiles, and drives from random starts are for one world: drive "
                "in a part that `terrain-forge cut` takes"
            )
        with watched(progress, VALIDATE_STAGES) as watch:
            return tiling.validate_site(out, watch=watch)
    building.finish(out)
    with watched(progress, VALIDATE_STAGES) as watch:
        manifest = building.read_manifest(out)
        building.require_listed(out, manifest, force=force)
        watch("load")
        world = World.load(out)
        building.require_readable_recipe(world, out)
        before = building.folder_state(out, manifest)
        with (
            building.updating(out, foreign=before.foreign) as fresh,
            building.blaming(out, before.altered),
        ):
            return report.assess(
                world,
                fresh,
                exports=building.exports_in(manifest),
                watch=watch,
                before=before,
                dataset=recording.dataset_folder(out),
                every_consumer=every_consumer,
                drives=drives,
            )


@checked
def record(
    world: World | Path | str,
    out: Path | str | None = None,
    *,
    begin: Coordinate = 0.0,
    end: Coordinate | None = None,
    only: tuple[str, ...] | str = (),
    workers: int | None = None,
    force: bool = False,
    progress: Progress | bool = False,
    **changes: Any,
) -> recording.Recorded:
    """Record what a world's rover measures along a path, or what of it is missing.

    Args:
        world: The world, or the folder in which it was built.
        out: Folder in which `dataset` is made; by default that of the built world.
        begin: From when [s].
        end: Until when [s], which is not part of it; by default to the end.
        only: Names of the sensors; by default all; one may stand alone.
        workers: How many measurements are made at once; no number changes a byte.
        force: Whether another recording of ours in the folder is replaced, and a report page
            that was edited.
        progress: Called with what is being done; True shows it.
        changes: Fields of the recipe's `dataset` that differ, such as `path="short"`.

    Raises:
        RecipeError, DataError: if it cannot be recorded.
        OutputError: if the folder holds another recording, or another process writes there.
        StorageError: if the disk does not take it.
    """
    order = recording.Order(
        begin=begin,
        end=end,
        only=(only,) if isinstance(only, str) else only,
        workers=workers,
        force=force,
        all_formats=not only or "formats" in changes,
    )
    with watched(progress, record_stages()) as watch:
        place = None
        if not isinstance(world, World):
            place = resolved(world)
            out = out or place
            building.finish(place)
            building.read_manifest(place)
            watch("load")
            world = World.load(place)
            building.require_readable_recipe(world, place, exports=False)
        if out is None:
            raise OutputError("a world in memory is recorded into a folder: name one as `out`")
        spec = _changed(world.site.recipe.dataset or DatasetSpec(), changes)
        from terrain_forge.report import renew_report_page

        out = resolved(out)
        recorded = recording.record_dataset(world, out, spec, order, watch)
        if out == place:
            left = "the recording is complete, its report page is not renewed"
            with telling_interrupts(lambda: left):
                watch("report page")
                renew_report_page(world, out, force=force)
        return recorded


def _changed(spec: DatasetSpec, changes: dict[str, Any]) -> DatasetSpec:
    """What is recorded, with some fields that differ; raises RecipeError for one that is none."""
    known = {one.name for one in fields(spec)}
    for name in sorted(changes.keys() - known):
        allowed = ", ".join(sorted(known))
        raise RecipeError(f"record: unknown {name!r}{hint_at(name, known)}, allowed: {allowed}")
    return replace(spec, **changes)


@checked
def check(recipe: Recipe | RecipeFile | Path | str, *, folder: Path | str = ".") -> Iterator[str]:
    """Lines that say what a recipe or its file will make; the DTM first, even if it cannot serve.

    Nothing is fetched: where the DTM is not at hand, only what a build would fetch is told.

    Raises:
        RecipeError, DataError: if the recipe cannot be built.
    """
    recipe, folder = given_recipe(recipe, folder)
    missing = list(building.fetch_lines(recipe))
    yield from missing or building.dtm_lines(recipe, Path(folder))
    if missing:
        return
    orders = export_orders(recipe)
    if recipe.tiles is not None:
        tiling.require_tiles(recipe, orders)
    site = making.plan(recipe, folder=folder)
    if site.recipe.tiles is not None:
        tiling.require_tiles(site.recipe, orders)
        tiling.require_large_tiles(site)
    yield from building.site_lines(site, orders)
    if recipe.sensors is not None or recipe.dataset is not None:
        rover = rover_of(site)
        recording.require_recordable(recipe, rover)
        recording.require_long_enough(site, rover.sensors)
        if site.recipe.tiles is None:
            yield from recording.recording_lines(site, rover.sensors)
        else:
            yield "recording      of a part of the site, which `terrain-forge cut` makes a world"
    if recipe.worlds is not None:
        variation.require_drawable(recipe, folder)
        yield f"worlds         {variation.variation_line(recipe)}"
        yield f"  cost         {building.series_line(site, orders)}"
