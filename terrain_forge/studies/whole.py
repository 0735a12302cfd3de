"""A study as a whole: file ─► cells ─► results ─► tables, plots, page."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from terrain_forge.base import Progress, silent, telling_interrupts
from terrain_forge.studies.cells import Study, study_of
from terrain_forge.studies.effects import Outcome, outcomes_of, write_tables
from terrain_forge.studies.page import write_study_page
from terrain_forge.studies.running import cells_left, run_cells
from terrain_forge.studies.spec import read_study


@dataclass(frozen=True, kw_only=True)
class StudyResult:
    """What a study found, and where it is written."""

    study: Study
    """The study."""
    outcomes: tuple[Outcome, ...]
    """What each system did in each cell."""
    files: tuple[Path, ...]
    """Tables, plots, page."""

    def __repr__(self) -> str:
        scored = sum(one.runs > 0 for one in self.outcomes)
        return f"<StudyResult {self.study.file.name!r}: {scored} of {len(self.outcomes)} scored>"


def run_study(
    path: Path | str,
    out: Path | str | None = None,
    *,
    jobs: int | None = None,
    trust: bool = False,
    progress: Progress = silent,
) -> StudyResult:
    """Build, record and evaluate over all levels of a study, and tell the effects.

    Killed or interrupted, the same call goes on where it was.

    Args:
        path: The study's file.
        out: Its folder; by default its name in the current folder.
        jobs: How many worlds at once; by default as many as there are cores and memory for.
        trust: Whether the programs that it names may run, as its own `trust: true` says.
        progress: Told of each cell.

    Raises:
        RecipeError: if the study or a recipe of it is wrong; `file:line: …`.
        OutputError: if the folder holds something else.
        StorageError: if the disk is too small.
    """
    study = study_of(read_study(path, trust=trust))
    folder = Path(out or study.file.name).absolute()
    results = run_cells(study, folder, jobs=jobs, progress=progress)
    with telling_interrupts(partial(cells_left, study, folder)):
        outcomes = outcomes_of(study, results)
        files = [*write_study_page(study, outcomes, folder), *write_tables(study, outcomes, folder)]
    return StudyResult(study=study, outcomes=tuple(outcomes), files=tuple(files))
