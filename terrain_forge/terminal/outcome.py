"""What a command says at its end: verdict, failed checks, what was written, what comes next."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from terrain_forge import tiling
from terrain_forge.base import OutputError, StorageError, size_text
from terrain_forge.building import BuildResult, read_manifest
from terrain_forge.model import Export, World, write_plot
from terrain_forge.terminal.lines import say, time_text, word
from terrain_forge.terminal.running import FAILED_CHECK
from terrain_forge.terrain import slope_statistics
from terrain_forge.validation import checks_of, failed_checks, report_text

if TYPE_CHECKING:
    from terrain_forge.recording import Recorded

_MOST_TOLD = 10
"""Failed checks that the terminal shows."""
_PREVIEW = "terrain-forge preview"
"""What made a preview, as its PNG says near its beginning."""


def tell_build(result: BuildResult, out: Path, seconds: float) -> None:
    """Say what a build made and how it is looked at."""
    if isinstance(result, tiling.TiledResult):
        say(f"{out}: {tiling.progress_figures(result)}, in {time_text(seconds)}")
        say(f"  look at it: terrain-forge view {word(out)}")
        return
    world = result.world
    if result.removed:
        say(f"removed from {out}: {', '.join(result.removed)}")
    kinds = ", ".join(export.folder for export in result.exports if "/" not in export.folder)
    _tell_verdict(out)
    say(
        f"  {_count(len(world.field), 'rock')}, {_count(len(world.trajectories), 'path')}, "
        f"{kinds or 'no export'}: {size_text(_size(out))} in {time_text(seconds)}"
    )
    say(f"  look at it: terrain-forge view {word(out)}")
    tell_openings(out, result.exports)


def tell_exports(out: Path, folders: Sequence[str], seconds: float) -> None:
    """Say what an export wrote."""
    for folder in folders:
        files = [path for path in (out / folder).rglob("*") if path.is_file()]
        size = size_text(sum(path.stat().st_size for path in files))
        say(f"{out / folder}: {_count(len(files), 'file')}, {size}")
    say(f"  written and validated in {time_text(seconds)}, see {out / 'report.html'}")


def tell_validation(out: Path, seconds: float, *, table: bool) -> None:
    """Say what a validation found, with the table of what each program read, if asked."""
    for line in report_text(_report(out)).splitlines() if table else ():
        say(line)
    _tell_verdict(out)
    say(f"  validated in {time_text(seconds)}: {_report(out).as_posix()}")


def require_preview(picture: Path) -> None:
    """Refuse a place for a preview that holds anything but an earlier one.

    Raises:
        OutputError: says what is there.
        StorageError: if its folder cannot be written.
    """
    if picture.suffix.lower() != ".png":
        raise OutputError(f"{picture}: a preview is a .png")
    if not picture.parent.is_dir():
        raise OutputError(f"{picture}: there is no folder {picture.parent}")
    ours = not os.path.lexists(picture)
    if picture.is_file() and not picture.is_symlink():
        with picture.open("rb") as file:
            ours = b"tEXtSoftware\0" + _PREVIEW.encode() in file.read(256)
    if not ours:
        raise OutputError(f"{picture} is there and is no preview: it is not overwritten")
    if not os.access(picture.parent, os.W_OK):
        raise StorageError(f"{picture} cannot be written: its folder is read-only")


def tell_preview(world: World, picture: Path) -> None:
    """Draw a world, and say what it is and where the picture lies."""
    dynamic = int(world.field.dynamic.sum())
    unsettled = f", {dynamic:,} dynamic ones not settled" * bool(dynamic)
    note = f"preview: rocks as circles of their size{unsettled}"
    require_preview(picture)
    write_plot(world, picture, note=note, software=_PREVIEW)
    steepest = slope_statistics(world.ground).steepest_deg
    more = f", {dynamic:,} of them dynamic and not settled" * bool(dynamic)
    unplaced = sum(world.unplaced)
    more += f"; {unplaced:,} found no place" * bool(unplaced)
    unsupported = sum(world.unsupported_number)
    more += f"; {unsupported:,} left out: the ground falls away beneath them" * bool(unsupported)
    say(f"{world.site.name}: nothing was exported")
    say(f"  rocks     {len(world.field):,}{more}")
    say(f"  slope     {steepest:.1f}° at its steepest, rocks apart")
    say(f"  relief    {np.ptp(world.ground.elevation):.2f} m")
    for path in world.trajectories:
        say(f"  path      {path.name}: {path.length:.1f} m, {path.time[-1]:.0f} s")
    say(f"  picture   {picture}")


def tell_recording(result: Recorded, seconds: float) -> None:
    """Say what was recorded, and what of it is new."""
    streams = ", ".join(f"{name} {count:,}" for name, count in result.streams.items())
    say(f"{result.folder}: {streams}")
    made = f"{_count(result.made, 'new measurement')} in files of their own, tables anew,"
    say(f"  {size_text(result.size)}: {made} in {time_text(seconds)}")
    for name, sentences in result.losses.items():
        say(f"  {name}: {' '.join(sentences)}")
    for sentence in result.stale:
        say(f"  {sentence}")


def tell_openings(out: Path, exports: Sequence[Export]) -> None:
    """Say how exports are opened."""
    openings = [opening for export in exports if (opening := export.opening(out))]
    if openings:
        say(f"  open it, in {out}:")
    for opening in openings:
        command = opening.commands.splitlines()[0].partition("   #")[0]
        say(f"    {opening.title}: {command}")


def show_report(out: Path, *, opened: bool) -> None:
    """Say where a world's report page is, and open it, if asked.

    Raises:
        OutputError: if it has none.
    """
    if not tiling.is_site(out):
        read_manifest(out)
    page = (out / "report.html").absolute()
    if not page.is_file():
        command = f"terrain-forge validate {word(out)}"
        raise OutputError(f"{out} has no report page; `{command}` makes it")
    say(str(page))
    if opened and not _opened(page):
        say("no browser could be opened here: open that file in one")


def finish(passed: bool, out: Path) -> None:
    """Name the checks that failed; ends the command with its status where `passed` is false."""
    failed = failed_checks(out)
    for check in failed[:_MOST_TOLD]:
        say(f"{out}: {'fails as before' if passed else 'failed'}: {check.told()}", err=True)
    if not passed:
        count = "a validation check" if len(failed) == 1 else f"{len(failed)} validation checks"
        say(f"{out}: {count} failed, see {_report(out)}", err=True)
        raise click.exceptions.Exit(FAILED_CHECK)


def _opened(page: Path) -> bool:
    """Whether a browser with a window took the page."""
    import webbrowser

    display = "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    return (display or sys.platform != "linux") and webbrowser.open(page.as_uri())


def _report(out: Path) -> Path:
    return out / "validation" / "report.json"


def _tell_verdict(out: Path) -> None:
    judged, failed = len(checks_of(out)), len(failed_checks(out))
    verdict = f"{failed} of {judged} checks failed" if failed else f"all {judged} checks passed"
    say(f"{out}: {verdict}")


def _count(number: int, thing: str) -> str:
    return f"{number:,} {thing}{'s' * (number != 1)}"


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
