"""Running systems over a recording and scoring what they told."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import (
    Array,
    DataError,
    ExportError,
    OutputError,
    Progress,
    RecipeError,
    StorageError,
    require_unlinked,
    silent,
    telling_interrupts,
)
from terrain_forge.building import holding
from terrain_forge.datasets import (
    Poses,
    Recording,
    holds_format,
    open_recording,
    state_of,
    write_dataset,
)
from terrain_forge.evaluation.adapter import LOG, Adapter, Run, run_system
from terrain_forge.evaluation.catalogue import (
    DRIVERS,
    interpreter,
    require_distinct,
    require_program,
    require_ready,
    vocabulary_of,
)
from terrain_forge.evaluation.kept import forget_runs, kept_in, kept_results
from terrain_forge.evaluation.loops import LoopScore, score_loops
from terrain_forge.evaluation.needs import (
    frames_given,
    require_sensors,
    sensor_places,
)
from terrain_forge.evaluation.paper_table import write_paper_table
from terrain_forge.evaluation.poses import TimedPoses
from terrain_forge.evaluation.results import Result, write_results
from terrain_forge.evaluation.score import ScoreOptions, score_poses
from terrain_forge.evaluation.stamped import ERRORS, write_errors, write_poses

RESULTS = "slam"
"""Where results lie, in the recording's folder."""
_INPUTS = f"{RESULTS}/inputs"
"""Where the recording lies in the formats that systems read."""
_DIGITS = 12
"""Of the hash of the recording's index, by which inputs lie there."""
_log = logging.getLogger(__name__)


def evaluate_recording(
    dataset: Path | str,
    adapters: Sequence[Adapter],
    *,
    runs: int = 1,
    options: ScoreOptions | None = None,
    force: bool = False,
    timeout_s: float | None = None,
    progress: Progress = silent,
) -> list[Result]:
    """Run systems over a recording, one after the other, and score them.

    What a system does wrong is a result, and the others go on. Trajectories and what the systems
    printed are kept in the recording's folder `slam`, with the tables, in which earlier results of
    other systems and runs stay.

    Args:
        dataset: The recording's folder, or the world's.
        adapters: The systems.
        runs: How often each is run.
        options: What is free in the scores.
        force: Whether earlier results go that are of another recording or were scored otherwise.
        timeout_s: When each is killed [s], instead of its own `timeout_s`.
        progress: Told of each run as it begins, and what is written for it.

    Returns:
        The new results.

    Raises:
        DataError: if there is no recording, or it is broken; if two systems have one name.
        OutputError: if earlier results would go, a link leads to where results lie, or another
            process writes there.
        KeyboardInterrupt: with how far it came.
    """
    require_distinct(adapters)
    if timeout_s is not None:
        adapters = [replace(adapter, timeout_s=timeout_s) for adapter in adapters]
    recording, options = open_recording(dataset), options or ScoreOptions()
    results: list[Result] = []
    inputs: dict[str, Path] = {}
    folder = recording.folder / RESULTS
    order = [(adapter, number) for adapter in adapters for number in range(1, runs + 1)]
    written = (f"{RESULTS}/{kept_in(adapter.name, number)}" for adapter, number in order)
    for place in (f"{_INPUTS}/{_digest(recording)}", *written):
        require_unlinked(recording.folder, place)

    def left() -> str:
        return f"{len(results)} of {len(adapters) * runs} runs are scored, in {folder}"

    with telling_interrupts(left), holding(_held(recording)):
        kept, gone = kept_results(
            folder,
            recording=_digest(recording),
            options=options,
            replaced={(adapter.name, number) for adapter, number in order},
            force=force,
        )
        for (adapter, number), stage in zip(order, run_stages(adapters, runs), strict=True):
            progress(stage, 0.0)
            told = partial(_tell, progress, stage)
            results.append(_result(recording, adapter, number, inputs, options, told))
            write_results([*kept, *results], folder)  # an interrupt loses one run only
            write_paper_table(recording, [*kept, *results], folder)
            forget_runs(folder, gone)
    return results


def run_stages(adapters: Sequence[Adapter], runs: int = 1) -> list[str]:
    """What `evaluate_recording` tells of as its stages, one for each run."""
    numbers = [f" {number}" if runs > 1 else "" for number in range(1, runs + 1)]
    return [f"run {adapter.name}{number}" for adapter in adapters for number in numbers]


def _held(recording: Recording) -> Path:
    """What must not be written meanwhile: the world of a recording, as `record` holds it, or it."""
    folder = recording.folder.resolve()
    return folder.parent if (folder.parent / "world").is_dir() else folder


def _tell(progress: Progress, stage: str, busy: str, _: float) -> None:
    progress(f"{stage}: {busy}", 0.0)


def _digest(recording: Recording) -> str:
    """Of the recording's state, which changes where it grows."""
    return state_of(recording.folder)[:_DIGITS]


def log_lines(results: Sequence[Result], folder: Path) -> list[str]:
    """Of the runs of now that have no score the file with all that they printed.

    Args:
        results: The results.
        folder: The recording's folder.
    """
    return [
        f"{run.system}: what it printed: {folder / RESULTS / kept_in(run.system, one.number) / LOG}"
        for one in results
        if (run := one.run).log and one.score is None
    ]


def _result(
    recording: Recording,
    adapter: Adapter,
    number: int,
    inputs: dict[str, Path],
    options: ScoreOptions,
    progress: Progress,
) -> Result:
    keep = recording.folder / RESULTS / kept_in(adapter.name, number)
    for name in (ERRORS, f"{adapter.name}.tum"):  # an earlier run's
        (keep / name).unlink(missing_ok=True)
    frame, frames = adapter.frame.strip("{}"), 0
    try:
        places = _places(recording, adapter, inputs, progress)
        frame = adapter.frame_of(sensor_places(recording))
        frames = frames_given(recording, adapter)
        before = _state(recording.folder)
        run = run_system(adapter, places, keep=keep)
        changed = {name for name, *_ in before ^ _state(recording.folder)}
        if own := sorted(name for name in changed if not name.startswith(f"{_INPUTS}/")):
            why = f"it changed the recording: {own[0]}; record it again"
            run = run.replace(status="failed", why=why, estimate=None)
        _renew(inputs, recording.folder, changed)
    except (DataError, ExportError, OutputError, RecipeError) as error:
        run = Run(
            system=adapter.name, status="failed", why=str(error), seconds=0.0, processor_s=0.0,
            memory=0.0, log="",
        )  # fmt: skip
    score, closures = None, None
    if run.estimate is not None:
        try:
            truth, stamps = truth_of(recording, frame), _true_poses(recording, frame).stamps
            estimate = _timed(run.estimate, adapter, truth)
            if adapter.format == "kitti":  # which has no times
                write_poses(estimate, keep / f"{adapter.name}.tum", stamps)
            score = score_poses(truth, estimate, options)
            write_errors(score, keep / ERRORS, stamps)
            closures, wrong = _closures(run, adapter, truth, options)
            run = run.replace(why=wrong or run.why)
        except DataError as error:
            run = run.replace(status="lost", why=str(error))
    return Result(
        run=run, number=number, score=score, loops=closures, frame=frame,
        world=recording.name, recording=_digest(recording), frames=frames,
    )  # fmt: skip


def _state(folder: Path) -> set[tuple[str, int, int]]:
    """Name, size and time of change of each file of a recording and of inputs, results apart."""
    paths = [*folder.iterdir(), folder / _INPUTS]
    return {
        (path.relative_to(folder).as_posix(), stat.st_size, stat.st_mtime_ns)
        for above in paths
        if above.name != RESULTS
        for path in (above, *above.rglob("*"))
        if os.path.lexists(path) and (stat := path.lstat()) and not path.is_dir()
    }


def _renew(inputs: dict[str, Path], folder: Path, changed: set[str]) -> None:
    """Give up inputs that a system changed, so that the next one gets them as they should be."""
    for name, place in list(inputs.items()):
        mine = f"{place.relative_to(folder.resolve()).as_posix()}/"
        if mine.startswith(_INPUTS) and (
            found := sorted(one for one in changed if one.startswith(mine))
        ):
            _log.warning("a system changed its input, which is made anew: %s", folder / found[0])
            shutil.rmtree(place)
            del inputs[name]


def _places(
    recording: Recording, adapter: Adapter, inputs: dict[str, Path], progress: Progress
) -> dict[str, str]:
    """What stands in the command of a system that is ready to be run."""
    require_sensors(recording, adapter)
    require_program(adapter)
    require_ready(adapter)
    sensors = sensor_places(recording)
    _true_poses(recording, adapter.frame_of(sensors))  # told before inputs are made
    places: dict[str, Any] = {
        "input": _input(recording, adapter.input, adapter.input_options, inputs, progress),
        "calibration": _input(recording, "calibration", {}, inputs, progress),
        "recording": recording.folder.resolve(),
        "python": interpreter(adapter),
        "driver": DRIVERS,
        "binary": adapter.binary,
        "vocabulary": vocabulary_of(adapter) if adapter.needs_vocabulary else "",
        **sensors,
    }
    return {name: str(place) for name, place in places.items()}


def truth_of(recording: Recording, frame: str) -> TimedPoses:
    """The true motion of a frame at its own stamps.

    Raises:
        DataError: if it was not recorded.
    """
    poses = _true_poses(recording, frame)
    return TimedPoses(
        name=frame,
        time=np.asarray(poses.stamps / 1e9, np.float64),
        position=poses.position,
        quaternion=poses.quaternion,
    )


def _true_poses(recording: Recording, frame: str) -> Poses:
    if frame == "body":
        return recording.body_poses
    if frame == "base_link":
        return recording.base_poses
    return recording.truth_of(recording.sensor(frame))


def _timed(estimate: TimedPoses, adapter: Adapter, truth: TimedPoses) -> TimedPoses:
    """The estimate with times: KITTI's format has only the numbers of its frames, or stamps."""
    if adapter.format != "kitti":
        return estimate
    told, frames = len(estimate.time), len(truth.time)
    if adapter.frames == "last" and not adapter.stamps and told <= frames:
        return _found_ones(estimate.replace(time=truth.time[frames - told :]), first=False)
    if not adapter.stamps:
        if told != frames:
            raise DataError(
                f"{adapter.name}: {told} poses of {frames} frames, and KITTI's format has no times "
                "to tell of which: name a file of them as `stamps` of the system"
            )
        each = estimate.replace(time=truth.time)
        return _found_ones(each) if adapter.frames == "found" else each
    time = _stamped(estimate.time, adapter.stamps_in, truth, adapter.name)
    return estimate.replace(time=time)


def _found_ones(estimate: TimedPoses, *, first: bool = True) -> TimedPoses:
    """The poses that do not repeat the one before, with or without the first of those alike."""
    rows = np.hstack([estimate.position, estimate.quaternion])
    moved = np.concatenate([[True], (np.diff(rows, axis=0) != 0.0).any(axis=1)])
    if not first:
        moved &= np.append(moved[1:], True)
    return estimate.replace(
        time=estimate.time[moved],
        position=estimate.position[moved],
        quaternion=estimate.quaternion[moved],
    )


def _closures(
    run: Run, adapter: Adapter, truth: TimedPoses, options: ScoreOptions | None
) -> tuple[LoopScore | None, str]:
    """How good a run's loop closures are, or what is wrong with them."""
    if run.loops is None:
        return None, ""
    try:
        time = _stamped(run.loops.time, adapter.loops_in, truth, adapter.name)
    except DataError as error:
        return None, f"loop closures: {error}"
    return score_loops(truth, run.loops.replace(time=time), options), ""


def _stamped(told: Array, kind: str, truth: TimedPoses, name: str) -> Array:
    """Times by the recording's clock, of seconds or numbers of frames."""
    if not told.size:
        return told
    if kind == "seconds":
        return told + (truth.time[0] if told.min() < 0.5 * truth.time[0] else 0.0)
    number, frames = np.round(told).astype(np.int64), len(truth.time)
    wrong = (number != told) | (number < 0) | (number >= frames)
    if wrong.any():
        first = told.ravel()[int(np.argmax(wrong))]
        raise DataError(f"{name}: stamp {first:g} is no frame of 0 to {frames - 1}")
    return np.asarray(truth.time[number])


def _input(
    recording: Recording,
    kind: str,
    options: Mapping[str, Any],
    inputs: dict[str, Path],
    progress: Progress,
) -> Path:
    """The recording in a format; what is not there, or of before it grew, is written beside it."""
    if kind == "euroc":
        return recording.folder.resolve()
    if not options and holds_format(recording.folder, kind):
        return (recording.folder / kind).resolve()
    name = "_".join([kind, *(f"{key}-{_word(value)}" for key, value in sorted(options.items()))])
    if name not in inputs:
        every = recording.folder.resolve() / _INPUTS
        folder = every / _digest(recording) / name
        if not folder.is_dir():
            for older in every.glob("[0-9a-f]" * _DIGITS):  # of the recording before it grew
                if older != folder.parent:
                    shutil.rmtree(older, ignore_errors=True)
            folder.parent.mkdir(parents=True, exist_ok=True)
            try:
                write_dataset(recording, kind, folder, options, progress=progress)
            except StorageError as error:
                raise DataError(str(error)) from None
        inputs[name] = folder
    return inputs[name]


def _word(value: Any) -> str:
    """An option's value as a part of a folder's name."""
    return "+".join(value) if isinstance(value, tuple) else str(value)
