"""The command `study`: recipes with factors, recorded and evaluated over all levels."""

from __future__ import annotations

from pathlib import Path

import click

from terrain_forge.terminal import FAILED_CHECK, Command, Display, say


@click.command(cls=Command)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Output folder [default: ./FILE's name]."
)
@click.option("--jobs", type=click.IntRange(1, 256), metavar="N", help="Worlds at once.")
@click.option("--list", "listed", is_flag=True, help="Only list the worlds and what they cost.")
@click.option("--trust", is_flag=True, help="Run programs that FILE names, as its `trust: true`.")
def study(file: Path, out: Path | None, jobs: int | None, listed: bool, trust: bool) -> int:
    """Build, record and evaluate over all levels of the study in FILE.

    FILE is a YAML file, or one that ships: loam_on_short, sun_and_flare, suspension.

    Gives tables (text, CSV, LaTeX), plots of each factor's effect with its spread, and a page.
    Killed or interrupted, the same command goes on where it was.
    """
    from terrain_forge.evaluation import text_table
    from terrain_forge.studies import MAIN, effect_rows, effects_of, outcome_rows, run_study

    if listed:
        return _list(file, trust)
    with Display(("cells",)) as display:
        result = run_study(file, out, jobs=jobs, trust=trust, progress=display)
    effects = effects_of(result.study, result.outcomes)
    rows = effect_rows(effects, MAIN) if effects else outcome_rows(result.study, result.outcomes)
    for line in text_table(rows):
        say(line)
    for one in result.outcomes:
        if one.why:
            say(f"{one.cell.title}: {one.system}: {one.status}: {one.why}", err=True)
    say(str(result.files[0]))
    return 0 if all(one.runs for one in result.outcomes) else FAILED_CHECK


def _list(file: Path, trust: bool) -> int:
    """Say which worlds there are, and what they cost."""
    from terrain_forge.base import size_text
    from terrain_forge.studies import costs_of, read_study, require_served, study_of

    found = study_of(read_study(file, trust=trust))
    costs = costs_of(found.cells)
    require_served(costs)
    for cell, cost in zip(found.cells, costs, strict=True):
        told = cost.recording
        more = (
            f"{told.length:,.0f} s, {told.frames:,} measurements, about {told.seconds / 60:,.1f} "
            f"min and {size_text(int(told.size))}"
            if told
            else "its path is planned on the finished ground"
        )
        say(f"{cell.title}: {more}")
    count = len({cell.digest for cell in found.cells})
    minutes = sum(one.recording.seconds for one in costs if one.recording) / 60
    runs = count * len(found.file.systems) * found.file.spec.runs
    say(f"{count} worlds, {minutes:,.0f} min of recording, {runs} runs of systems beside")
    return 0
