"""The command `evaluate`: systems over a recording, or trajectories of files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from terrain_forge.base import OutputError
from terrain_forge.terminal import (
    FAILED_CHECK,
    SCORING,
    WRONG_INPUT,
    Command,
    Display,
    Number,
    Numbers,
    say,
)

if TYPE_CHECKING:
    from terrain_forge.evaluation import MapScore, Result, ScoreOptions


_FILES = {"truth", "estimates", "stamps", "changes", "out", "force"}
"""Options that serve where files are scored."""
_SYSTEMS = {"systems", "binaries", "runs", "timeout", "changes", "out", "force"}
_MAPS = {"maps", "area", "cell", "out", "force"}
_LACKING = {"stamps": "--estimate", "area": "--map", "cell": "--map"}
"""What others have no effect without."""


@click.command(cls=Command)
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "--systems",
    multiple=True,
    metavar="NAMES",
    help="Systems to run over the recording of OUT, such as kiss-icp,stereo-odometry, or .yaml "
    "files; by default all that are installed and find their sensors.",
)
@click.option(
    "--binary",
    "binaries",
    multiple=True,
    metavar="NAME=PATH",
    help="A program that you have, such as orb-slam2=/opt/ORB_SLAM2/Examples/Stereo/stereo_kitti.",
)
@click.option("--runs", type=click.IntRange(1, 100), default=1, help="How often each is run.")
@click.option(
    "--timeout", type=Number(1.0, 1e6), metavar="SECONDS",
    help="When each is ended [s], instead of its own limit, an hour for those that ship.",
)  # fmt: skip
@click.option("--list", "listed", is_flag=True, help="Only list the systems that are known.")
@click.option("--install", metavar="NAME", help="Make what a system needs.")
@click.option("--truth", type=click.Path(path_type=Path), help="A true trajectory.")
@click.option(
    "--estimate",
    "estimates",
    multiple=True,
    type=click.Path(path_type=Path),
    help="What a system told; more may follow.",
)
@click.option(
    "--stamps",
    type=click.Path(path_type=Path),
    help="Times of the poses of --estimate [s], a line each: it is in KITTI's format, as --truth "
    "may be.",
)
@click.option(
    "--map",
    "maps",
    multiple=True,
    metavar="[SYSTEM=]FILE",
    help="Score a map against the world: a cloud (PLY, PCD, LAZ) or a height grid (GeoTIFF, .npy, "
    "x y z rock as text), in the world's frame or in that of a system that was evaluated.",
)
@click.option(
    "--area", type=Numbers("-10,-10,10,10"), metavar="W,S,E,N",
    help="Part of the site that maps are scored on [m].",
)  # fmt: skip
@click.option(
    "--cell", type=Number(0.001, 1e3), default=0.15, metavar="M", help="Size of a map's cells [m]."
)
@SCORING
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Write JSON, CSV, LaTeX here.")
@click.option(
    "--force",
    is_flag=True,
    help="Write over such files that lie there; drop earlier results of OUT that are of another "
    "recording or were scored otherwise.",
)
def evaluate(
    paths: tuple[Path, ...],
    systems: tuple[str, ...],
    binaries: tuple[str, ...],
    runs: int,
    timeout: float | None,
    listed: bool,
    install: str | None,
    truth: Path | None,
    estimates: tuple[Path, ...],
    stamps: Path | None,
    maps: tuple[str, ...],
    area: tuple[float, float, float, float] | None,
    cell: float,
    changes: tuple[str, ...],
    out: Path | None,
    force: bool,
) -> int:
    """Run systems over the recording in OUT and score them, or score trajectories.

    OUT holds what `terrain-forge record` recorded. With --truth and --estimate files are scored:
    TUM (`time x y z qx qy qz qw`) or EuRoC's CSV, of the same frame. The defaults are the paper's:
    alignment on the first third, drift of the path's length over 10 m.
    """
    from terrain_forge import report
    from terrain_forge.evaluation import (
        chosen_systems,
        find_system,
        install_system,
        read_options,
        require_no_tables,
        require_place,
        system_lines,
    )

    options = read_options(changes)
    if listed:
        _require_effect({"listed"}, beside="--list")
        for line in system_lines():
            say(line)
        return 0
    if install:
        _require_effect({"install"}, beside="--install")
        say(f"{install}: installed in {install_system(find_system(install))}")
        return 0
    running = bool(systems or binaries or not maps)
    if truth or estimates:
        _require_effect(_FILES, beside="--truth and --estimate")
    else:
        _require_effect((_SYSTEMS if running else set()) | (_MAPS if maps else set()))
    if out:
        require_place(out)
    if out and not force:
        require_no_tables(out)
    if truth and estimates:
        return _tell_scores(truth, (*estimates, *paths), options=options, out=out, stamps=stamps)
    if truth or estimates or len(paths) != 1:
        raise OutputError("evaluate needs OUT, a recorded world, or --truth and --estimate")
    status = 0
    if running:
        chosen = chosen_systems(",".join(systems) if systems else None, paths[0], binaries)
        with Display(report.evaluate_stages(chosen, runs)) as display:
            results = report.evaluate(
                paths[0], chosen, runs=runs, options=options, force=force, timeout_s=timeout,
                progress=display,
            )  # fmt: skip
        status = _tell_systems(paths[0], results, out=out)
    if maps:
        with Display(report.MAP_STAGES) as display:
            scores = report.evaluate_maps(
                paths[0], maps, area=area, cell=cell, force=force, progress=display
            )
        _tell_maps(scores, out=out)
        if len(scores) < len(maps):
            status = WRONG_INPUT
    return status


def _tell_systems(world: Path, results: Sequence[Result], *, out: Path | None) -> int:
    """Say how well systems did on a world's recording; returns the status."""
    from terrain_forge import evaluation
    from terrain_forge.datasets import open_recording

    recording = open_recording(world)
    for line in evaluation.result_lines(results):
        say(line)
    for line in evaluation.log_lines(results, recording.folder):
        say(line)
    if out:
        for path in evaluation.write_results(results, out):
            say(str(path))
        for path in evaluation.write_paper_table(recording, results, out):
            say(str(path))
    if any(one.score for one in results):
        return 0
    say("terrain-forge: no run of any system could be scored", err=True)
    return FAILED_CHECK


def _tell_maps(scores: Sequence[MapScore], *, out: Path | None) -> None:
    """Say how well maps show a world."""
    from terrain_forge import evaluation

    for line in evaluation.table_lines(evaluation.map_rows(scores)):
        say(line)
    for path in evaluation.write_maps(scores, out) if out else ():
        say(str(path))


def _tell_scores(
    truth: Path,
    estimates: Sequence[Path],
    *,
    options: ScoreOptions,
    out: Path | None,
    stamps: Path | None = None,
) -> int:
    """Score trajectories of files and say how well they did; returns the command's status."""
    from terrain_forge import evaluation

    scores, failures = evaluation.score_files(truth, estimates, options, stamps=stamps)
    for line in evaluation.score_lines(scores) if scores else ():
        say(line)
    for path in evaluation.write_scores(scores, out, failures=failures) if out else ():
        say(str(path))
    for _, why in failures:
        say(f"terrain-forge: {why}", err=True)
    return WRONG_INPUT if failures else 0


def _require_effect(serving: set[str], *, beside: str = "") -> None:
    """Refuse options that have no effect beside others, or without them.

    Raises:
        click.UsageError: names the first.
    """
    context = click.get_current_context()
    for param in context.command.params:
        name = str(param.name)
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if given and isinstance(param, click.Option) and name not in serving:
            why = f"beside {beside}" if beside else f"without {_LACKING.get(name, '--systems')}"
            raise click.UsageError(f"{param.opts[-1]} has no effect {why}: leave it out")
