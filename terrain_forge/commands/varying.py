"""The command that makes many worlds of one recipe."""

from __future__ import annotations

import re
from pathlib import Path

import click

from terrain_forge.terminal import (
    FAILED_CHECK,
    ONLY,
    RECIPE,
    SEED,
    SET,
    Command,
    Display,
    Number,
    names_of,
    say,
    side_by_side,
    time_text,
)

_MOST_TOLD = 5
"""Failures that the terminal shows."""


@click.command(name="worlds", cls=Command)
@RECIPE
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Folder of all [default: ./NAME-worlds]."
)
@click.option("--count", type=click.IntRange(1), metavar="N", help="How many worlds.")
@click.option(
    "--grid",
    metavar="ROWSxCOLUMNS",
    help="One scene of rows of rising difficulty and columns of variants, with flat borders.",
)
@click.option(
    "--border",
    type=Number(0.1, 1e3),
    metavar="METRES",
    help="Width of the borders of a grid [default: 4, or more where they would be steep].",
)
@SEED
@SET
@ONLY
@side_by_side
def make_worlds(
    recipe: Path,
    out: Path | None,
    count: int | None,
    grid: str | None,
    border: float | None,
    seed: int | None,
    changes: tuple[str, ...],
    only: tuple[str, ...],
    workers: int | None,
    scheduler: str | None,
) -> int:
    """Make many worlds of RECIPE, which differ as its part `worlds` says.

    Each has a folder with its world, truth and exports; worlds.csv tells what was drawn for each
    and how hard it is. Killed or interrupted, the same command goes on where it was. A world has
    the same bytes, however many there are and whoever makes them.
    """
    from terrain_forge.terminal import load_given, located
    from terrain_forge.variation import make_grid, read_summary, worlds

    file = load_given(recipe, seed=seed, changes=changes)
    names = names_of(only)
    if grid is not None:
        for option, value in (("count", count), ("workers", workers), ("scheduler", scheduler)):
            if value is not None:
                raise click.UsageError(f"--{option} has no effect beside --grid: leave one out")
        out = out or Path(f"{file.recipe.name}-grid")
        with located(file), Display(("worlds",)) as display:
            size = _shape(grid)
            made = make_grid(file, out, shape=size, only=names, border=border, progress=display)
        say(f"{made}: {grid} worlds as one scene in {time_text(display.elapsed)}")
        return 0
    if border is not None:
        raise click.UsageError("--border has no effect without --grid: leave it out")
    out = out or Path(f"{file.recipe.name}-worlds")
    with located(file), Display(("compile", "worlds")) as display:
        result = worlds(
            file,
            out,
            count=count,
            only=names,
            workers=workers,
            scheduler=scheduler,
            progress=display,
        )
    rate = result.made / max(display.elapsed, 1e-9)
    there = len(result.folders)
    more = f"; {result.more:,} more are there" if result.more else ""
    say(
        f"{out}: {there:,} world{'s' * (there != 1)}, {result.made:,} made now, "
        f"{rate:.1f} a second{more}"
    )
    measured = [read_summary(one)["measured"] for one in result.folders]
    lost = [one["unplaced"] for one in measured if one.get("unplaced")]
    if lost:
        say(f"  rocks        {sum(lost):,} found no free place, in {len(lost):,} of the worlds")
    arrive = [one.get("arrive") for one in measured]
    if known := [one for one in arrive if one is not None]:
        # Each has as many starts.
        mean, low, high = sum(known) / len(known), min(known), max(known)
        say(f"  arrive       {mean:.1%} of all starts, {low:.1%} to {high:.1%} by world")
    for number, why in result.failed[:_MOST_TOLD]:
        say(f"  not made     {number:05}: {why}")
    if len(result.failed) > _MOST_TOLD:
        say(f"  not made     {len(result.failed) - _MOST_TOLD} more")
    return FAILED_CHECK if result.failed else 0


def _shape(text: str) -> tuple[int, int]:
    """Rows and columns of a grid, such as 5x8."""
    found = re.fullmatch(r"([1-9][0-9]{0,8})[xX×]([1-9][0-9]{0,8})", text)
    if found is None:
        raise click.BadParameter(f"{text!r}: rows and columns, such as 5x8", param_hint="--grid")
    return int(found[1]), int(found[2])
