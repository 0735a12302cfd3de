"""Systems and maps evaluated on the recording of a built world, whose page then shows them."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from terrain_forge.base import (
    DataError,
    OutputError,
    Progress,
    checked,
    require_unlinked,
    resolved,
    silent,
    telling_interrupts,
)
from terrain_forge.building import holding
from terrain_forge.evaluation import (
    RESULTS,
    Adapter,
    MapScore,
    Result,
    ScoreOptions,
    evaluate_recording,
    kept_maps,
    read_map,
    run_stages,
    score_map,
    score_maps,
    site_grid,
    write_maps,
)
from terrain_forge.model import World
from terrain_forge.recording import dataset_folder
from terrain_forge.report.renewal import renew_report_page

_log = logging.getLogger(__name__)


def evaluate_stages(systems: Sequence[Adapter], runs: int = 1) -> list[str]:
    """Stages of an evaluation."""
    maps = ["maps"] if any(system.map for system in systems) else []
    return ["load", *run_stages(systems, runs), *maps, "report page"]


MAP_STAGES = ("load", "maps", "site", "report page")
"""Stages of an evaluation of maps."""


@checked
def evaluate(
    out: Path | str,
    systems: Sequence[Adapter],
    *,
    runs: int = 1,
    options: ScoreOptions | None = None,
    force: bool = False,
    timeout_s: float | None = None,
    progress: Progress = silent,
) -> list[Result]:
    """Run systems over the recording of a built world, and show on its page how well they did.

    Args:
        out: The built folder, or that of a recording alone, which has no page.
        systems: The systems.
        runs: How often each is run.
        options: What is free in the scores.
        force: Whether earlier results go that are of another recording or were scored otherwise.
        timeout_s: When each is killed [s], instead of its own `timeout_s`.
        progress: Called with each stage as it begins.

    Raises:
        DataError: if there is no recording, or it is broken.
        OutputError: if earlier results would go, or another process writes there.
    """
    out = resolved(out)
    require_unlinked(out, dataset_folder(out).name)
    progress("load", 0.0)
    results = evaluate_recording(
        out, systems, runs=runs, options=options, force=force, timeout_s=timeout_s,
        progress=progress,
    )  # fmt: skip
    if (out / "world").is_dir() and dataset_folder(out).is_dir():
        with telling_interrupts(lambda: "all runs are scored, the report page is not renewed"):
            try:
                world = World.load(out)
            except OutputError as error:  # no reason to lose what took hours: a recording tells all
                _log.warning("evaluated, but the report page is not written anew: %s", error)
                return results
            _score_own_maps(world, results, out, progress, force=force)
            progress("report page", 0.0)
            renew_report_page(world, out)
    return results


def _score_own_maps(
    world: World, results: Sequence[Result], out: Path, progress: Progress, *, force: bool
) -> None:
    """Score the maps that systems made, each laid on the world as the trajectory of its run."""
    found = []
    for one in results:
        if one.run.map is None or one.score is None:
            continue
        try:
            made = read_map(one.run.map, name=f"{one.run.system} {one.number}")
        except DataError as error:
            _log.warning("a map is not scored: %s", error)
        else:
            found.append(made.moved(one.score.alignment))
    if not found:
        return
    progress("maps", 0.0)
    try:
        grid = site_grid(world)
        scores = [score_map(world, one, grid) for one in found]
        with holding(out):
            _keep_maps(scores, out, force=force)
    except (DataError, OutputError) as error:
        _log.warning("maps are not scored: %s", error)


def _keep_maps(scores: Sequence[MapScore], out: Path, *, force: bool) -> None:
    """Write scores of maps beside those that are there."""
    folder = dataset_folder(out) / RESULTS
    write_maps([*kept_maps(folder, scores, force=force), *scores], folder)


@checked
def evaluate_maps(
    out: Path | str,
    maps: Sequence[str],
    *,
    area: tuple[float, float, float, float] | None = None,
    cell: float = 0.15,
    force: bool = False,
    progress: Progress = silent,
) -> list[MapScore]:
    """Score maps against a built world; where it was recorded, the table lies with its results.

    Scores of other maps, areas and cells stay in that table. Of a map that cannot be read a warning
    says why, and the others are scored.

    Args:
        out: The built folder.
        maps: `FILE` in the world's frame, or `SYSTEM=FILE` in that of a system evaluated there.
        area: West, south, east, north of what is scored [m]; the whole site by default.
        cell: Size of a cell [m].
        force: Whether a table there that cannot be read goes.
        progress: Called with each stage as it begins.

    Raises:
        DataError: if none of the maps can be read, or for an area outside.
        OutputError: if the folder holds no world, the table there cannot be read, or another
            process writes there.
    """
    out = resolved(out)
    require_unlinked(out, f"{dataset_folder(out).name}/{RESULTS}")
    progress("load", 0.0)
    world, folder = World.load(out), dataset_folder(out)
    with holding(out) if folder.is_dir() else nullcontext():
        scores = score_maps(
            world, maps, evaluated=folder / RESULTS, area=area, cell=cell, progress=progress
        )
        if folder.is_dir():
            _keep_maps(scores, out, force=force)
    if folder.is_dir():
        with telling_interrupts(lambda: "the maps are scored, the report page is not renewed"):
            progress("report page", 0.0)
            renew_report_page(world, out)
    return scores
