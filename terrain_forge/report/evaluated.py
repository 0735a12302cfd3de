"""Systems and maps evaluated on the recording of a built world, whose page then shows them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from terrain_forge.base import resolved
from terrain_forge.evaluation import (
    RESULTS,
    Adapter,
    MapScore,
    Result,
    ScoreOptions,
    evaluate_recording,
    score_maps,
    write_maps,
)
from terrain_forge.model import World
from terrain_forge.recording import dataset_folder
from terrain_forge.report.renewal import renew_report_page

EVALUATE_STAGES = ("systems", "report page")
"""Stages of an evaluation."""


def evaluate(
    out: Path | str,
    systems: Sequence[Adapter],
    *,
    runs: int = 1,
    options: ScoreOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[Result]:
    """Run systems over the recording of a built world, and show on its page how well they did.

    Args:
        out: The built folder, or that of a recording alone, which has no page.
        systems: The systems.
        runs: How often each is run.
        options: What is free in the scores.
        progress: Told of each run as it begins.

    Raises:
        DataError: if there is no recording, or it is broken.
    """
    out = resolved(out)

    def told(name: str) -> None:
        if progress:
            progress(f"systems: {name}")

    results = evaluate_recording(out, systems, runs=runs, options=options, progress=told)
    if (out / "world").is_dir() and dataset_folder(out).is_dir():
        if progress:
            progress("report page")
        renew_report_page(World.load(out), out)
    return results


def evaluate_maps(
    out: Path | str,
    maps: Sequence[str],
    *,
    area: tuple[float, float, float, float] | None = None,
    cell: float = 0.15,
) -> list[MapScore]:
    """Score maps against a built world; where it was recorded, the table lies with its results.

    Args:
        out: The built folder.
        maps: `FILE` in the world's frame, or `SYSTEM=FILE` in that of a system evaluated there.
        area: West, south, east, north of what is scored [m]; the whole site by default.
        cell: Size of a cell [m].

    Raises:
        DataError: for a map that cannot be read, or an area outside.
        OutputError: if the folder holds no world.
    """
    out = resolved(out)
    world, folder = World.load(out), dataset_folder(out)
    scores = score_maps(world, maps, evaluated=folder / RESULTS, area=area, cell=cell)
    if folder.is_dir():
        write_maps(scores, folder / RESULTS)
        renew_report_page(world, out)
    return scores
