"""Work on a world that is built already: further exports, and validation anew."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.building import Stopwatch, assess
from terrain_forge.building import export as export_folder
from terrain_forge.errors import OutputError, RecipeError
from terrain_forge.manifest import altered_files, read_manifest
from terrain_forge.pipeline import Progress, silent
from terrain_forge.recipe import ExportOrder, export_orders
from terrain_forge.world import World

ASSESSED = ("validation/", "report.html")
"""What every assessment writes anew."""


def export(out: Path | str, only: tuple[str, ...], *, progress: Progress = silent) -> bool:
    """Write further formats from a built world, then validate; returns whether all checks passed.

    A name is a folder of the recipe's exports, with its options, or else an exporter, with
    defaults.

    Raises:
        OutputError: if the folder is not a world of ours.
        RecipeError: for an unknown exporter.
    """
    out = Path(out)
    watch = Stopwatch(progress)
    manifest = read_manifest(out)
    watch("load")
    world = World.load(out)
    orders = _orders(world, out, only)
    renewed = tuple(f"{order.folder}/" for order in orders)
    altered = altered_files(out, manifest, besides=(*ASSESSED, *renewed))
    losses = manifest["losses"]
    for order in orders:
        watch(f"export {order.folder}")
        losses[order.folder] = export_folder(world, out, order)
    return assess(world, out, losses=losses, altered=altered, watch=watch)


def validate(
    out: Path | str,
    *,
    every_consumer: bool = True,
    drives: int | None = None,
    progress: Progress = silent,
) -> bool:
    """Validate a built world again.

    Args:
        out: The built folder.
        every_consumer: Whether to open its exports in all consumers that are installed; else only
            what a build checks is checked.
        drives: From how many random starts to drive; by default what the recipe says.
        progress: Told what is being done.

    Returns:
        Whether all checks passed; a consumer that was not run neither passes nor fails.

    Raises:
        OutputError: if the folder is not a world of ours.
    """
    out = Path(out)
    watch = Stopwatch(progress)
    manifest = read_manifest(out)
    watch("load")
    world = World.load(out)
    _planned(world, out)
    altered = altered_files(out, manifest, besides=ASSESSED)
    return assess(
        world,
        out,
        losses=manifest["losses"],
        altered=altered,
        watch=watch,
        every_consumer=every_consumer,
        drives=drives,
    )


def _planned(world: World, out: Path) -> dict[str, ExportOrder]:
    """The exports of the recipe that a world was built with, by their folders.

    Raises:
        OutputError: if this version refuses one of them.
    """
    try:
        return {order.folder: order for order in export_orders(world.site.recipe)}
    except RecipeError as error:
        what = ": ".join(filter(None, [".".join(map(str, error.key)), str(error)]))
        raise OutputError(
            f"{out}: this version refuses the recipe of that world, {what}; build it anew"
        ) from None


def _orders(world: World, out: Path, only: tuple[str, ...]) -> tuple[ExportOrder, ...]:
    if not only:
        raise OutputError("--only names no format")
    planned = _planned(world, out)
    further = tuple(name for name in dict.fromkeys(only) if name not in planned)
    recipe = world.site.recipe.__class__(**{**vars(world.site.recipe), "exports": further})
    found = {**planned, **{order.folder: order for order in export_orders(recipe)}}
    return tuple(found[name] for name in dict.fromkeys(only))
