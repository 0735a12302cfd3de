"""Validating what lies in a world's folder, and saying so: checks, report page, manifest."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from terrain_forge.base import RecipeError, Stopwatch, worker_threads
from terrain_forge.building import FolderState, write_manifest
from terrain_forge.model import Export, World, prepare
from terrain_forge.recipe import ValidateSpec
from terrain_forge.report.page import write_report_page
from terrain_forge.report.section import take_map
from terrain_forge.validation import validate as validate_world


def assess(
    world: World,
    directory: Path,
    *,
    exports: tuple[Export, ...],
    watch: Stopwatch,
    before: FolderState | None = None,
    dataset: Path | None = None,
    every_consumer: bool = False,
    drives: int | None = None,
    keep_drives: bool = False,
) -> bool:
    """Validate what lies in the folder, write its report page, timings and manifest.

    Args:
        world: the world.
        directory: the output folder.
        exports: what was exported into the folder.
        watch: called with what is being done.
        before: what lay in the folder; nothing, if not given.
        dataset: the folder of the world's recording.
        every_consumer: whether to open the exports in all consumers, whatever the recipe says.
        drives: from how many random starts to drive, instead of what the recipe says.
        keep_drives: whether those of the earlier assessment hold.

    Returns:
        Whether every check passed.
    """
    watch("validation")
    before = before or FolderState()
    spec = world.site.recipe.validate or ValidateSpec()
    if every_consumer:
        spec = replace(spec, consumers="all")
    if drives:
        spec = replace(spec, drives=drives)
    for export in exports:
        with suppress(RecipeError):  # one whose exporter is gone is not read back
            prepare(*export.opened())
    with worker_threads(1) as pool:
        # The page's largest picture is all rays, which leave Python's lock to the checks.
        above = pool.submit(take_map, world)
        result = validate_world(
            world,
            directory,
            spec=spec,
            exports=exports,
            altered=tuple(before.altered),
            foreign=before.foreign,
            earlier=before.assessment,
            keep_drives=keep_drives,
            progress=lambda part, share: watch(f"validation: {part}", share),
        )
    watch.figures.update(result.timings)
    watch("report page")
    write_report_page(
        world, directory, exports=result.exports, above=above.result(), dataset=dataset
    )
    watch("manifest")
    watch.write(directory)
    write_manifest(
        world.site,
        directory,
        exports=result.exports,
        known=before.altered,
        foreign=before.foreign,
    )
    return result.passed
