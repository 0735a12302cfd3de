"""What the command `evaluate` does: lists and installs systems, runs them, scores trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from terrain_forge import evaluation
from terrain_forge.datasets import open_recording
from terrain_forge.evaluation import MapScore, Result, ScoreOptions
from terrain_forge.terminal.lines import say
from terrain_forge.terminal.running import FAILED_CHECK, WRONG_INPUT


def list_systems() -> int:
    """Say which systems are known; returns the command's status."""
    for line in evaluation.system_lines():
        say(line)
    return 0


def install_named(name: str) -> int:
    """Make the environment of a system; returns the command's status."""
    folder = evaluation.install_system(evaluation.find_system(name))
    say(f"{name}: installed in {folder}")
    return 0


def tell_systems(world: Path, results: Sequence[Result], *, out: Path | None) -> int:
    """Say how well systems did on a world's recording; returns the status."""
    for line in evaluation.result_lines(results):
        say(line)
    if out:
        recording = open_recording(world)
        for path in evaluation.write_results(results, out):
            say(str(path))
        for path in evaluation.write_paper_table(recording, results, out):
            say(str(path))
    if any(one.score for one in results):
        return 0
    say("terrain-forge: no run of any system could be scored", err=True)
    return FAILED_CHECK


def tell_maps(scores: Sequence[MapScore], *, out: Path | None) -> None:
    """Say how well maps show a world."""
    for line in evaluation.table_lines(evaluation.map_rows(scores)):
        say(line)
    for path in evaluation.write_maps(scores, out) if out else ():
        say(str(path))


def tell_scores(
    truth: Path,
    estimates: Sequence[Path],
    *,
    options: ScoreOptions,
    out: Path | None,
    stamps: Path | None = None,
) -> int:
    """Score trajectories of files and say how well they did; returns the command's status."""
    scores, failures = evaluation.score_files(truth, estimates, options, stamps=stamps)
    for line in evaluation.score_lines(scores) if scores else ():
        say(line)
    for path in evaluation.write_scores(scores, out, failures=failures) if out else ():
        say(str(path))
    for _, why in failures:
        say(f"terrain-forge: {why}", err=True)
    return WRONG_INPUT if failures else 0
