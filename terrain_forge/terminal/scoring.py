"""What the command `evaluate` does: lists and installs systems, runs them, scores trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from terrain_forge import evaluation
from terrain_forge.evaluation import ScoreOptions
from terrain_forge.terminal.display import Display
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


def tell_systems(
    world: Path,
    systems: str | None,
    *,
    binaries: Sequence[str],
    runs: int,
    options: ScoreOptions,
    out: Path | None,
) -> int:
    """Run systems over a world's recording and say how well they did; returns the status."""
    with Display(("systems",)) as display:
        results = evaluation.evaluate_recording(
            world,
            evaluation.chosen_systems(systems, world, binaries),
            runs=runs,
            options=options,
            progress=lambda name: display(f"systems: {name}"),
        )
    for line in evaluation.result_lines(results):
        say(line)
    for path in evaluation.write_results(results, out) if out else ():
        say(str(path))
    return 0 if any(one.score for one in results) else FAILED_CHECK


def tell_scores(
    truth: Path, estimates: Sequence[Path], *, options: ScoreOptions, out: Path | None
) -> int:
    """Score trajectories of files and say how well they did; returns the command's status."""
    scores, failures = evaluation.score_files(truth, estimates, options)
    for line in evaluation.score_lines(scores) if scores else ():
        say(line)
    for path in evaluation.write_scores(scores, out, failures=failures) if out else ():
        say(str(path))
    for _, why in failures:
        say(f"terrain-forge: {why}", err=True)
    return WRONG_INPUT if failures else 0
