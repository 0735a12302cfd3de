"""Running systems over a recording and scoring what they told."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import DataError, ExportError, RecipeError, Record, StorageError
from terrain_forge.datasets import Recording, open_recording, write_dataset
from terrain_forge.evaluation.adapter import Adapter, Run, run_system
from terrain_forge.evaluation.catalogue import DRIVERS, find_system, interpreter, known_systems
from terrain_forge.evaluation.poses import TimedPoses
from terrain_forge.evaluation.score import Score, ScoreOptions, score_poses
from terrain_forge.evaluation.tables import score_plain

FOLDER = "slam"
"""Where results lie, in the recording's folder."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Result(Record):
    """One run of a system, and how well it localised."""

    run: Run
    """The run."""
    number: int
    """Which of the system's runs, from 1."""
    score: Score | None = None
    """Its score; None where it failed."""
    frame: str
    """Whose motion was compared."""


def evaluate_recording(
    dataset: Path | str,
    adapters: Sequence[Adapter],
    *,
    runs: int = 1,
    options: ScoreOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[Result]:
    """Run systems over a recording, one after the other, and score them.

    What a system does wrong is a result, and the others go on. Trajectories and what the systems
    printed are kept in the recording's folder `slam`, with evaluation.json.

    Args:
        dataset: The recording's folder, or the world's.
        adapters: The systems.
        runs: How often each is run.
        options: What is free in the scores.
        progress: Told of each run as it begins.

    Raises:
        DataError: if there is no recording, or it is broken.
    """
    recording = open_recording(dataset)
    results = []
    inputs: dict[str, Path] = {}
    for adapter in adapters:
        for number in range(1, runs + 1):
            if progress:
                progress(f"{adapter.name}{f' {number}' if runs > 1 else ''}")
            results.append(_result(recording, adapter, number, inputs, options))
    folder = recording.folder / FOLDER
    folder.mkdir(exist_ok=True)
    told = json.dumps([result_plain(one) for one in results], indent=1) + "\n"
    (folder / "evaluation.json").write_text(told, encoding="utf-8")
    return results


def _result(
    recording: Recording,
    adapter: Adapter,
    number: int,
    inputs: dict[str, Path],
    options: ScoreOptions | None,
) -> Result:
    keep = recording.folder / FOLDER / f"{adapter.name}_{number}"
    shutil.rmtree(keep, ignore_errors=True)
    try:
        require_sensors(recording, adapter)
        places = {
            "input": str(_input(recording, adapter.input, inputs).resolve()),
            "calibration": str((recording.folder / "calibration").resolve()),
            "python": str(interpreter(adapter)),
            "driver": str(DRIVERS),
            "binary": adapter.binary,
        }
        run = run_system(adapter, places, keep=keep)
    except (DataError, ExportError, RecipeError) as error:
        run = Run(
            system=adapter.name, status="failed", why=str(error), seconds=0.0, processor_s=0.0,
            memory=0.0, log="",
        )  # fmt: skip
    score = None
    if run.estimate is not None:
        try:
            truth = truth_of(recording, adapter.frame)
            estimate = _timed(run.estimate, adapter, truth)
            score = score_poses(truth, estimate, options)
        except DataError as error:
            run = run.replace(status="lost", why=str(error))
    return Result(run=run, number=number, score=score, frame=adapter.frame)


def require_sensors(recording: Recording, adapter: Adapter) -> None:
    """Refuse a recording that lacks what a system needs.

    Raises:
        DataError: says what is missing.
    """
    there = {
        "mono": bool(recording.cameras),
        "stereo": bool(recording.pairs),
        "rgbd": any("depth" in camera.channels for camera in recording.cameras),
        "lidar": bool(recording.lidars),
        "imu": bool(recording.imus),
        "odometry": bool(recording.series("odometry")),
    }
    if missing := [need for need in adapter.needs if not there[need]]:
        raise DataError(f"{adapter.name} needs {' and '.join(missing)}, which was not recorded")


def truth_of(recording: Recording, frame: str) -> TimedPoses:
    """The true motion of a frame at its own stamps.

    Raises:
        DataError: if it was not recorded.
    """
    poses = recording.base_poses
    if frame == "body":
        poses = recording.body_poses
    elif frame != "base_link":
        poses = recording.truth_of(recording.sensor(frame))
    return TimedPoses(
        name=frame,
        time=np.asarray(poses.stamps * 1e-9, np.float64),
        position=poses.position,
        quaternion=poses.quaternion,
    )


def _timed(estimate: TimedPoses, adapter: Adapter, truth: TimedPoses) -> TimedPoses:
    """The estimate with times: KITTI's format has only the numbers of its frames."""
    if adapter.format != "kitti":
        return estimate
    rows = estimate.time.astype(np.intp)
    if rows[-1] >= len(truth.time):
        raise DataError(f"{adapter.name}: {len(rows)} poses of {len(truth.time)} frames")
    return estimate.replace(time=truth.time[rows])


def _input(recording: Recording, kind: str, inputs: dict[str, Path]) -> Path:
    """The recording in a format; what is not there yet is written beside it."""
    if kind == "euroc":
        return recording.folder
    if kind not in inputs:
        folder = recording.folder / kind
        if not folder.is_dir():
            folder = recording.folder / FOLDER / "inputs" / kind
        if not folder.is_dir():
            folder.parent.mkdir(parents=True, exist_ok=True)
            try:
                write_dataset(recording, kind, folder)
            except StorageError as error:
                raise DataError(str(error)) from None
        inputs[kind] = folder
    return inputs[kind]


def result_plain(result: Result) -> dict[str, Any]:
    """A result as JSON values in SI units."""
    run = result.run
    return {
        "system": run.system,
        "run": result.number,
        "status": run.status,
        "why": run.why,
        "frame": result.frame,
        "seconds": run.seconds,
        "processor_s": run.processor_s,
        "memory_bytes": run.memory,
        "score": score_plain(result.score) if result.score else None,
    }


def result_lines(results: Sequence[Result]) -> list[str]:
    """A table of results: of each system the median over its runs, and the range of ATE."""
    head = (
        "system", "runs", "tracked [%]", "ATE [m]", "of runs", "TDr median [%]", "TDr rms [%]",
        "s per frame",
    )  # fmt: skip
    rows = [list(head)]
    for name in dict.fromkeys(one.run.system for one in results):
        mine = [one for one in results if one.run.system == name]
        good = [one for one in mine if one.score is not None]
        if not good:
            rows.append([name, f"0 of {len(mine)}", f"{mine[0].run.status}: {mine[0].run.why}"])
            continue
        scores = [one.score for one in good if one.score is not None]
        ate = np.array([one.ate.rms for one in scores])
        drift = [(one.drift.median, one.drift.rms) for one in scores if one.drift]
        median, rms = np.median(np.array(drift), axis=0) if drift else (np.nan, np.nan)
        per = float(np.median([one.run.processor_s / max(one.score.poses, 1)  # type: ignore[union-attr]
                               for one in good]))  # fmt: skip
        rows.append(
            [
                name,
                f"{len(good)} of {len(mine)}",
                f"{100.0 * float(np.median([one.tracked for one in scores])):.3g}",
                f"{float(np.median(ate)):.4g}",
                f"{ate.min():.3g}–{ate.max():.3g}" if len(ate) > 1 else "",
                "" if np.isnan(median) else f"{100.0 * median:.3g}",
                "" if np.isnan(rms) else f"{100.0 * rms:.3g}",
                f"{per:.3g}",
            ]
        )
    widths = [max(len(row[n]) for row in rows if len(row) == len(head)) for n in range(len(head))]
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]
        lines.append("  ".join(cells).rstrip() if len(row) == len(head) else
                     f"{row[0].ljust(widths[0])}  {row[1].rjust(widths[1])}  {row[2]}")  # fmt: skip
    return lines


def chosen_systems(names: str | None, dataset: Path | str) -> list[Adapter]:
    """The systems of some names, or all that are installed and find their sensors.

    Raises:
        DataError: for an unknown name, or if there is no recording.
    """
    if names is not None:
        return [find_system(name.strip()) for name in names.split(",")]
    recording = open_recording(dataset)
    found = []
    for adapter in known_systems().values():
        try:
            require_sensors(recording, adapter)
            interpreter(adapter)
        except DataError:
            continue
        if not adapter.needs_binary:
            found.append(adapter)
    return found


def system_lines() -> list[str]:
    """A line for each known system: whether it can be run, and what it is."""
    lines = []
    for name, adapter in known_systems().items():
        try:
            interpreter(adapter)
            state = "your binary" if adapter.needs_binary else "ready"
        except DataError:
            state = "not installed"
        lines.append(f"{name:<18} {state:<14} {adapter.about}")
    return lines
