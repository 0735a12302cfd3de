"""Systems and maps evaluated on the recording of a built world, whose page then shows them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from terrain_forge.base import Progress, checked, require_unlinked, resolved, silent
from terrain_forge.evaluation import (
    RESULTS,
    Adapter,
    MapScore,
    Result,
    ScoreOptions,
    evaluate_recording,
    kept_maps,
    run_stages,
    score_maps,
    write_maps,
)
from terrain_forge.model import World
from terrain_forge.recording import dataset_folder
from terrain_forge.report.renewal import renew_report_page


def evaluate_stages(systems: Sequence[Adapter], runs: int = 1) -> list[str]:
    """Stages of an evaluation."""
    return ["load", *run_stages(systems, runs), "report page"]


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
    progress: Progress = silent,
) -> list[Result]:
    """Run systems over the recording of a built world, and show on its page how well they did.

    Args:
        out: The built folder, or that of a recording alone, which has no page.
        systems: The systems.
        runs: How often each is run.
        options: What is free in the scores.
        force: Whether earlier results go that are of another recording or were scored otherwise.
        progress: Called with each stage as it begins.

    Raises:
        DataError: if there is no recording, or it is broken.
        OutputError: if earlier results would go.
    """
    out = resolved(out)
    require_unlinked(out, dataset_folder(out).name)
    progress("load", 0.0)
    results = evaluate_recording(
        out, systems, runs=runs, options=options, force=force, progress=progress
    )
    if (out / "world").is_dir() and dataset_folder(out).is_dir():
        progress("report page", 0.0)
        renew_report_page(World.load(out), out)
    return results


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

    Scores of other maps, areas and cells stay in that table.

    Args:
        out: The built folder.
        maps: `FILE` in the world's frame, or `SYSTEM=FILE` in that of a system evaluated there.
        area: West, south, east, north of what is scored [m]; the whole site by default.
        cell: Size of a cell [m].
        force: Whether a table there that cannot be read goes.
        progress: Called with each stage as it begins.

    Raises:
        DataError: for a map that cannot be read, or an area outside.
        OutputError: if the folder holds no world, or the table there cannot be read.
    """
    out = resolved(out)
    require_unlinked(out, f"{dataset_folder(out).name}/{RESULTS}")
    progress("load", 0.0)
    world, folder = World.load(out), dataset_folder(out)
    scores = score_maps(
        world, maps, evaluated=folder / RESULTS, area=area, cell=cell, progress=progress
    )
    if folder.is_dir():
        kept = kept_maps(folder / RESULTS, scores, force=force)
        write_maps([*kept, *scores], folder / RESULTS)
        progress("report page", 0.0)
        renew_report_page(world, out)
    return scores
