"""Scoring files of trajectories, of which one that is wrong does not stop the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from terrain_forge.base import DataError, complaint
from terrain_forge.evaluation.poses import is_kitti, read_kitti_poses, read_poses
from terrain_forge.evaluation.score import Score, ScoreOptions, score_poses


def score_files(
    truth: Path,
    estimates: Iterable[Path],
    options: ScoreOptions | None = None,
    *,
    stamps: Path | None = None,
) -> tuple[list[Score], list[tuple[str, str]]]:
    """Score trajectories of files against one of the truth.

    Args:
        truth: File of the truth (`read_poses`), of the frame that the estimates are of; beside
            `stamps` it may be in KITTI's format as well.
        estimates: Files of the estimates.
        options: What is free in it.
        stamps: The estimates are in KITTI's format, and this file has the time of each pose [s].

    Returns:
        The scores, and for each file that could not be scored its name and why.

    Raises:
        DataError: if the truth cannot be read, or a file is given twice.
    """
    times = stamps if stamps and is_kitti(truth) else None
    true = read_kitti_poses(truth, stamps=times) if times else read_poses(truth)
    named = _named(tuple(estimates))
    scores: list[Score] = []
    failures: list[tuple[str, str]] = []
    for name, path in named.items():
        try:
            if stamps:
                told = read_kitti_poses(path, name=name, stamps=stamps)
            else:
                told = read_poses(path, name=name)
            scores.append(score_poses(true, told, options))
        except DataError as error:
            failures.append((name, str(error)))
    return scores, failures


def _named(paths: Sequence[Path]) -> dict[str, Path]:
    """Files by what tables call them: their stems, or all of the path where stems are alike.

    Raises:
        DataError: for a file that is given twice.
    """
    stems = [path.stem for path in paths]
    named: dict[str, Path] = {}
    for path in paths:
        name = path.stem if stems.count(path.stem) == 1 else str(path)
        if name in named:
            raise DataError(f"--estimate {path}: is given twice")
        named[name] = path
    return named


def read_options(changes: Iterable[str]) -> ScoreOptions:
    """Options of `key=value` texts.

    Raises:
        DataError: for an unknown key or a value that it cannot have.
    """
    from pydantic import TypeAdapter, ValidationError

    given = {}
    for change in changes:
        key, equals, value = change.partition("=")
        if not equals:
            raise DataError(f"--set {change}: must be key=value, such as align=all")
        if key.strip() in given:
            raise DataError(f"--set {change}: give {key.strip()} once")
        given[key.strip()] = value.strip()
    adapter = TypeAdapter(ScoreOptions)
    try:
        return adapter.validate_strings(given)
    except ValidationError as error:
        raise DataError(f"--set {complaint(error, adapter, given)}") from None
