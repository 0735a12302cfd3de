"""Results of earlier evaluations: which of them stay in the tables beside new ones."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

import numpy as np

from terrain_forge.base import DataError, OutputError, read_json
from terrain_forge.evaluation.adapter import LOG, MAP, OutputFormat, Run
from terrain_forge.evaluation.loops import LoopScore
from terrain_forge.evaluation.results import Result
from terrain_forge.evaluation.score import Score, ScoreOptions, Spread
from terrain_forge.evaluation.stamped import ERRORS
from terrain_forge.evaluation.tables import TABLE

_SPREADS = {
    "ate": "ate_m", "drift": "drift", "rpe": "rpe_m", "rpe_angle": "rpe_rad",
    "yaw_drift": "yaw_drift_rad",
}  # fmt: skip
"""Fields of a score, and what `score_plain` calls them."""


def kept_results(
    folder: Path,
    *,
    recording: str,
    options: ScoreOptions,
    replaced: Collection[tuple[str, int]],
    force: bool = False,
) -> tuple[list[Result], list[Result]]:
    """Results of a folder's table that stay when others are added, and those that go.

    Of each pose they tell nothing.

    Args:
        folder: Where the table lies.
        recording: Digest of the recording that is evaluated now.
        options: How it is scored now.
        replaced: Systems and numbers of runs that are made anew.
        force: Whether those go that do not fit the new ones; else they are an error.

    Raises:
        OutputError: for results of another recording or scoring, or a table that cannot be read.
    """
    path = folder / f"{TABLE}.json"
    try:
        found = read_results(path) if os.path.lexists(path) else []
    except DataError as error:
        if not force:
            raise OutputError(f"{error}; --force begins it anew") from None
        found = []
    others = [one for one in found if (one.run.system, one.number) not in replaced]
    fitting = [one for one in others if _fits(one, recording, options)]
    if len(fitting) < len(others) and not force:
        rest = dict.fromkeys(one.run.system for one in others if one not in fitting)
        raise OutputError(
            f"{path} has results of {', '.join(rest)}, of another recording or otherwise scored: "
            "evaluate these too, or drop them by --force"
        )
    return fitting, [one for one in others if one not in fitting]


def kept_in(system: str, number: int) -> str:
    """Name of the folder, among the results, of what is kept of a run."""
    return f"{system}_{number}"


def forget_runs(folder: Path, results: Collection[Result]) -> None:
    """Remove what was kept of runs whose results went; what others put beside it stays."""
    places = {path.name: path for path in folder.iterdir() if path.is_dir()}
    for one in results:
        name = one.run.system
        place = places.get(kept_in(name, one.number))
        if place is None or place.is_symlink():
            continue
        ours = {LOG, ERRORS, *(f"{name}.{ending}" for ending in get_args(OutputFormat))}
        for path in place.iterdir():
            if (path.name in ours or path.stem == MAP) and not path.is_dir():
                path.unlink()
        with suppress(OSError):  # it holds something of others
            place.rmdir()


def _fits(result: Result, recording: str, options: ScoreOptions) -> bool:
    scored = result.score is None or dict(result.score.options) == vars(options)
    return result.recording == recording and scored


def read_results(path: Path) -> list[Result]:
    """What `write_results` wrote as JSON, without logs and without what is told of each pose.

    Raises:
        DataError: if it is not that.
    """
    rows = read_json(path, str(path))
    try:
        return [_result(row) for row in rows]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{path}: is no table of results: {error!r}") from None


def _result(row: Mapping[str, Any]) -> Result:
    run = Run(
        system=str(row["system"]), status=str(row["status"]), why=str(row["why"]),
        seconds=float(row["seconds"]), processor_s=float(row["processor_s"]),
        memory=float(row["memory_bytes"]), log="",
    )  # fmt: skip
    return Result(
        run=run,
        number=int(row["run"]),
        score=_score(row["score"]) if row["score"] else None,
        loops=LoopScore(**row["loops"]) if row["loops"] else None,
        frame=str(row["frame"]),
        world=str(row["world"]),
        recording=str(row["recording"]),
        frames=int(row.get("frames", 0)),
    )


def _score(row: Mapping[str, Any]) -> Score:
    spreads = {name: row[key] and Spread(**row[key]) for name, key in _SPREADS.items()}
    kitti = row["kitti"] and (
        float(row["kitti"]["translation"]),
        float(row["kitti"]["rotation_rad_m"]),
    )
    none = np.zeros(0)
    return Score(
        name=str(row["trajectory"]),
        options=tuple(dict(row["options"]).items()),
        poses=int(row["poses"]),
        tracked=float(row["tracked"]),
        length=float(row["length_m"]),
        scale=float(row["scale"]),
        alignment=np.array(row["alignment"], np.float64).reshape(4, 4),
        kitti=kitti,
        time=none,
        station=none,
        errors=none,
        aligned=np.zeros((0, 3)),
        **spreads,
    )
