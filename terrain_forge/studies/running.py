"""Carrying out the cells of a study, side by side; each one's result is a file, and stays."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from terrain_forge.base import (
    DataError,
    OutputError,
    Progress,
    RecipeError,
    StorageError,
    TerrainForgeError,
    ask_for_interrupt,
    python_words,
    read_json,
    require_unlinked,
    silent,
    size_text,
    telling_interrupts,
    write_whole,
)
from terrain_forge.building import holding
from terrain_forge.evaluation import Program
from terrain_forge.making import plan
from terrain_forge.recipe import expected_nodes, memory_needed, rocks_of
from terrain_forge.recording import Order, RecordingCost, dataset_folder, recording_cost
from terrain_forge.rovers import rover_of
from terrain_forge.studies.cells import Cell, Study
from terrain_forge.studies.spec import RecordSpec
from terrain_forge.studies.worker import JOB, KEPT, LOG, RESULT, lacking, sensors_for

CELLS = "cells"
INDEX = "study.json"
_TICK = 0.1
"""How often cells are looked at [s]."""
SPARE = 2**28
"""Bytes of the disk that are left free."""
_CELL = "from terrain_forge.studies.worker import main; main(sys.argv[1])"
_EVALUATED = 2.0
"""A recording and what its systems are given, in recordings."""


@dataclass(frozen=True, kw_only=True)
class CellCost:
    """What a cell takes on this machine."""

    memory: float
    """Largest memory [bytes]."""
    recording: RecordingCost | None
    """Its recording; None where its path is planned on the finished ground."""
    lacking: dict[str, list[str]]
    """Systems that its rover has no sensors for, and what they need."""


def cell_cost(cell: Cell) -> CellCost:
    """About what a cell takes, its systems' time aside.

    Raises:
        RecipeError, DataError: if its world cannot be planned.
    """
    file = cell.recipe
    try:
        site = plan(file.recipe, folder=file.folder)
    except TerrainForgeError as error:
        raise type(error)(f"{cell.title}: {file.locate(error)}") from None
    sensors = rover_of(site).sensors
    part = RecordSpec(**cell.job["record"])
    try:
        Order(only=tuple(part.only)).require_named(sensors)
    except OutputError as error:
        why = str(error).removeprefix("--only ")
        raise RecipeError(f"{cell.told}: record.only: {why}") from None
    names = sensors_for(cell.job, sensors)
    chosen = [one for one in sensors if not names or one.name in names]
    return CellCost(
        memory=memory_needed(expected_nodes(file.recipe), rocks_of(site)),
        recording=recording_cost(site, chosen, begin=part.from_s, end=part.to_s),
        lacking=lacking(cell.job, sensors),
    )


def folder_of(cell: Cell, out: Path) -> Path:
    """The folder of a cell."""
    return out / CELLS / cell.digest


def result_of(cell: Cell, out: Path) -> dict[str, Any] | None:
    """The result of a cell; None where there is none that can be read."""
    try:
        told = read_json(folder_of(cell, out) / RESULT, RESULT)
        return told if told["digest"] == cell.digest and "results" in told else None
    except (DataError, KeyError, TypeError):
        return None


def run_cells(
    study: Study, out: Path, *, jobs: int | None = None, progress: Progress = silent
) -> list[dict[str, Any]]:
    """Carry out the cells whose results are not there yet, and those that failed.

    A cell has failed too where a system did that has its sensors: all of it is done again.

    Args:
        study: The study.
        out: Its folder.
        jobs: How many cells at once; by default as many as there are cores and memory for.
        progress: Told of each cell as it is done.

    Returns:
        The result of each cell, in their order.

    Raises:
        OutputError: if the folder is not that of this study, or another process writes there.
        StorageError: if the disk is too small.
        KeyboardInterrupt: with how far it came.
    """
    require_folder(study, out)
    missing = _missing(study, out)
    missing += _failing(study, out)
    count = len({cell.digest for cell in study.cells})
    jobs = _jobs(missing, jobs, out, keep=study.file.spec.keep, whole=len(missing) == count)
    with telling_interrupts(partial(cells_left, study, out)), holding(out):
        for digest in sorted({cell.digest for cell in study.cells}):
            for folder in (KEPT, dataset_folder(Path()).name):
                require_unlinked(out, f"{CELLS}/{digest}/{folder}")
        (out / CELLS).mkdir(exist_ok=True)
        text = json.dumps(index_of(study), indent=1)
        write_whole(out / INDEX, text + "\n")
        _run(missing, out, jobs, progress, count=count)
        if not study.file.spec.keep:
            for cell in study.cells:
                _forget(cell, out)
    found = [result_of(cell, out) for cell in study.cells]
    nothing = {"status": "failed", "why": "its process ended", "results": []}
    return [one or nothing for one in found]


def cells_left(study: Study, out: Path) -> str:
    """What an interrupt leaves behind."""
    count = len({cell.digest for cell in study.cells})
    done = count - len(_missing(study, out))
    return f"{done} of {count} cells are in {out}: the same command goes on from there"


def require_folder(study: Study, out: Path) -> None:
    """Refuse a folder that holds something else.

    Raises:
        OutputError: says what.
    """
    if not out.exists() or (out.is_dir() and all(p.name.startswith(".") for p in out.iterdir())):
        return
    try:
        name = read_json(out / INDEX, INDEX)["study"]
    except (DataError, KeyError, TypeError):
        raise OutputError(f"{out} is there, and holds no study: name another by -o") from None
    if name != study.file.name:
        raise OutputError(f"{out} holds the study {name!r}, not {study.file.name!r}")


def index_of(study: Study) -> dict[str, Any]:
    """What a study is, as JSON values."""
    return {
        "study": study.file.name,
        "about": study.file.spec.about,
        "design": study.file.spec.design,
        "factors": {one.name: [level.name for level in one.levels] for one in study.factors},
        "cells": [
            {"levels": dict(cell.levels), "seed": cell.seed, "folder": f"{CELLS}/{cell.digest}"}
            for cell in study.cells
        ],
    }


def _missing(study: Study, out: Path) -> list[Cell]:
    """One cell for each result that is not there, or is that of a failure."""
    found: dict[str, Cell] = {}
    for cell in study.cells:
        there = result_of(cell, out)
        if there is None or there["status"] != "done":
            found.setdefault(cell.digest, cell)
    return list(found.values())


def _failing(study: Study, out: Path) -> list[Cell]:
    """One cell for each result with a system that failed, though it has the sensors it needs."""
    found: dict[str, tuple[Cell, set[str]]] = {}
    for cell in study.cells:
        there = result_of(cell, out)
        if there is not None and there["status"] == "done":
            rows = there["results"]
            if failed := {row["system"] for row in rows if row["status"] == "failed"}:
                found.setdefault(cell.digest, (cell, failed))
    costs = costs_of([cell for cell, _ in found.values()])
    return [
        cell
        for (cell, failed), cost in zip(found.values(), costs, strict=True)
        if failed - cost.lacking.keys()
    ]


def _jobs(missing: Sequence[Cell], asked: int | None, out: Path, *, keep: bool, whole: bool) -> int:
    """How many cells at once; what the disk cannot hold is refused."""
    if not missing:
        return 1
    costs = costs_of(missing)
    if whole:
        require_served(costs)
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    fitting = int(0.8 * there / max(cost.memory for cost in costs))
    jobs = min(asked or max(1, min(os.cpu_count() or 1, fitting)), len(missing))
    sizes = sorted((one.recording.size for one in costs if one.recording), reverse=True)
    needed = _EVALUATED * sum(sizes if keep else sizes[:jobs])
    place = next(above for above in (out, *out.absolute().parents) if above.exists())
    free = shutil.disk_usage(place).free
    if needed + SPARE > free:
        what = f"{len(missing)} recordings that are kept" if keep else f"{jobs} recordings at once"
        raise StorageError(
            f"{out} cannot be written: {what} need about {size_text(int(needed))} and "
            f"{size_text(SPARE)} to spare, the disk has {size_text(free)} free; record less by "
            f"`record: {{to_s: …}}`{', or leave out `keep`' if keep else ', or give fewer --jobs'}"
        )
    return jobs


def costs_of(cells: Sequence[Cell]) -> list[CellCost]:
    """What some cells take; worlds that differ by the seed alone are alike."""
    known: dict[str, CellCost] = {}
    found = []
    for cell in cells:
        key = json.dumps([cell.job["recipe"] | {"seed": 0}, cell.job["record"]], sort_keys=True)
        if key not in known:
            known[key] = cell_cost(cell)
        found.append(known[key])
    return found


def require_served(costs: Sequence[CellCost]) -> None:
    """Refuse a system that has its sensors in none of a study's worlds.

    Raises:
        DataError: says what it needs.
    """
    for system, needs in costs[0].lacking.items():
        if all(system in cost.lacking for cost in costs):
            raise DataError(
                f"{system} needs {' and '.join(needs)}, which no rover of the study carries: add a "
                "sensor to its recipe, or leave the system out"
            )


def _run(cells: Sequence[Cell], out: Path, jobs: int, progress: Progress, *, count: int) -> None:
    """Keep so many cells going until all are done."""
    waiting, running = list(cells), dict[str, tuple[Cell, Program]]()
    workers = max(1, (os.cpu_count() or 1) // jobs)
    before, done = count - len(cells), 0
    with ExitStack() as programs:
        while waiting or running:
            while waiting and len(running) < jobs:
                cell = waiting.pop(0)
                running[cell.digest] = cell, programs.enter_context(_start(cell, out, workers))
            names = "; ".join(cell.title for cell, _ in running.values())
            progress(f"cells: {before + done} of {count}, now {names}", done / len(cells))
            time.sleep(_TICK)
            ask_for_interrupt()
            for digest, (cell, program) in list(running.items()):
                if program.ended(0.0):
                    del running[digest]
                    _settle(cell, out, program.ending)
                    done += 1


def _start(cell: Cell, out: Path, workers: int) -> Program:
    folder = folder_of(cell, out)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / RESULT).unlink(missing_ok=True)  # of a failure
    job = {**cell.job, "workers": workers, "digest": cell.digest}
    write_whole(folder / JOB, json.dumps(job, indent=1) + "\n")
    words = [*python_words(_CELL), str(folder.absolute())]
    return Program(words, folder=folder, log=folder / LOG, environment={"MPLBACKEND": "Agg"})


def _settle(cell: Cell, out: Path, ending: str) -> None:
    """Write that a cell failed whose process ended without a result, and why."""
    folder = folder_of(cell, out)
    if result_of(cell, out) is None:
        why = f"its process {ending}"
        told = {"digest": cell.digest, "status": "failed", "why": why, "results": []}
        write_whole(folder / RESULT, json.dumps(told, indent=1) + "\n")
    if not cell.job["keep"]:
        _forget(cell, out)


def _forget(cell: Cell, out: Path) -> None:
    """Remove the recording of a cell that is done."""
    there = result_of(cell, out)
    if there is not None and there["status"] == "done":
        with suppress(FileNotFoundError):
            shutil.rmtree(dataset_folder(folder_of(cell, out)))
