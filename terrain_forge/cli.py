"""The command line: `terrain-forge build recipe.yaml` and its companions.

Exit status: 0 done; 1 built but a validation check failed; 2 the input is wrong; 3 the disk or
the system refused, or an internal error; 130 interrupted.
"""

from __future__ import annotations

import ctypes
import errno
import gc
import logging
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from terrain_forge import __version__
from terrain_forge.base import (
    OutputError,
    RecipeWarning,
    SimulationError,
    StorageError,
    TerrainForgeError,
)

if TYPE_CHECKING:
    from terrain_forge.recipe import RecipeFile

_M_ARENA_MAX = -8
_NO_PATH = {errno.ENAMETOOLONG, errno.EISDIR, errno.ENOTDIR, errno.ELOOP}
"""What the system says of paths that cannot be what they should."""
_LONGEST = 2000
"""Characters of a line that is shown."""
_MOST_TOLD = 10
"""Failed checks that the terminal shows."""
FAILED_CHECK, WRONG_INPUT, INTERNAL, INTERRUPTED = 1, 2, 3, 130
_STATUS = {
    SimulationError: FAILED_CHECK,
    StorageError: INTERNAL,
    TerrainForgeError: WRONG_INPUT,
    OSError: INTERNAL,
}

_OUT = click.argument("out", type=click.Path(path_type=Path))
_RECIPE = click.argument("recipe", type=click.Path(path_type=Path))
_SET = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a key of the recipe, such as terrain.spacing_m=0.25; may be given several times.",
)
_DRIVES = click.option(
    "--drives",
    type=click.IntRange(1, 10_000),
    metavar="N",
    help="Also drive straight on from N random starts, and tell how many arrive.",
)
_FORCE = click.option(
    "--force",
    is_flag=True,
    help="Also remove files in the older world that are not its own; says which.",
)
_SEED = click.option("--seed", type=int, help="Use this seed instead of the recipe's.")


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="terrain-forge")
@click.option("--debug", is_flag=True, help="Log more, and show tracebacks.")
def cli(debug: bool) -> None:
    """Make planetary worlds for rovers: ground, rocks, paths and truth, for Gazebo, MuJoCo and USD.

    Start with `terrain-forge init`, which writes a first recipe with comments, then
    `terrain-forge build hello.yaml`.
    """
    logging.basicConfig(
        level=logging.DEBUG if debug else logging.WARNING,
        format="%(levelname)s: %(message)s",
        stream=sys.stderr,
    )
    for handler in logging.getLogger().handlers:
        handler.addFilter(_plain_record)
    for noisy in ("numba", "rasterio", "matplotlib", "PIL", "trimesh"):
        logging.getLogger(noisy).setLevel(logging.WARNING if debug else logging.CRITICAL)
    os.environ.setdefault("CPL_LOG", os.devnull)  # GDAL's own lines about broken files
    warnings.showwarning = partial(_show_warning, others=debug)


@cli.command()
@_RECIPE
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Output folder [default: ./NAME]."
)
@_SEED
@_SET
@click.option("--only", metavar="FORMATS", help="Write only these exports, such as sdf,mjcf.")
@_DRIVES
@_FORCE
def build(
    recipe: Path,
    out: Path | None,
    seed: int | None,
    changes: tuple[str, ...],
    only: str | None,
    drives: int | None,
    force: bool,
) -> None:
    """Build a world from RECIPE, check it, and write it to a folder.

    The folder appears whole or not at all; an older world of ours in its place is replaced.
    """
    from terrain_forge import pipeline
    from terrain_forge.base import compile_ahead
    from terrain_forge.building import require_apart

    if drives:
        changes = (*changes, f"validate.drives={drives}")
    file = _load(recipe, seed, changes)
    out = out or Path(file.recipe.name)
    require_apart(out.resolve(), [file.path])
    compile_ahead(_say)
    with _Bar(len(pipeline.STAGES)) as progress, _located(file):
        result = pipeline.build(
            file.recipe,
            out,
            folder=file.folder,
            only=_names(only),
            force=force,
            progress=progress,
        )
    if result.removed:
        _say(f"removed from {out}: {', '.join(result.removed)}")
    _say(
        f"{out}: {len(result.world.field):,} rocks, "
        f"{len(result.world.trajectories)} paths, see {out / 'report.html'}"
    )
    _finish(result.passed, out)


@cli.command()
@_RECIPE
@_SEED
@_SET
def check(recipe: Path, seed: int | None, changes: tuple[str, ...]) -> None:
    """Check RECIPE and its inputs, say what its DTM is and what a build costs. Builds nothing.

    RECIPE may also be a raster file: then only that is described.
    """
    from terrain_forge import pipeline
    from terrain_forge.building import check_raster

    if recipe.suffix.lower() not in (".yaml", ".yml") and recipe.is_file():
        for line in check_raster(recipe):
            _say(line)
        return
    file = _load(recipe, seed, changes)
    with _located(file):
        for line in pipeline.check(file.recipe, folder=file.folder):
            _say(line)


@cli.command()
@_OUT
@click.option("--only", required=True, metavar="FORMATS", help="Formats to write, such as usd.")
@_FORCE
def export(out: Path, only: str, force: bool) -> None:
    """Write further formats from the world built in OUT."""
    from terrain_forge import pipeline

    with _Bar(5 + only.count(",") + 1) as progress:
        passed = pipeline.export(out, _names(only) or (), force=force, progress=progress)
    _finish(passed, out)


@cli.command()
@_OUT
@click.option("--quick", is_flag=True, help="Only what a build checks, no other programs.")
@_DRIVES
def validate(out: Path, quick: bool, drives: int | None) -> None:
    """Validate the world built in OUT again, in every program that reads its exports.

    Prints the largest error of each over its limit. Programs that are not installed are not run:
    Gazebo's libraries are found by pkg-config, Drake and Newton in this Python or in those that
    TERRAIN_FORGE_DRAKE_PYTHON and TERRAIN_FORGE_NEWTON_PYTHON name.
    """
    from terrain_forge import pipeline
    from terrain_forge.validation import report_text

    with _Bar(5) as progress:
        passed = pipeline.validate(out, every_consumer=not quick, drives=drives, progress=progress)
    if not quick:
        for line in report_text(out / "validation" / "report.json").splitlines():
            _say(line)
    _say((out / "validation" / "report.json").as_posix())
    _finish(passed, out)


@cli.command()
@_OUT
@click.option("--no-browser", is_flag=True, help="Only print where the page is.")
def view(out: Path, no_browser: bool) -> None:
    """Look at the world built in OUT: opens its report page in a browser."""
    from terrain_forge.building import read_manifest

    read_manifest(out)
    page = (out / "report.html").absolute()
    if not page.is_file():
        raise OutputError(f"{out} has no report page; `terrain-forge validate {out}` makes it")
    _say(str(page))
    if not no_browser and not _opened(page):
        _say("no browser could be opened here: open that file in one")


def _opened(page: Path) -> bool:
    """Whether a browser with a window took the page."""
    import webbrowser

    display = "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    return (display or sys.platform != "linux") and webbrowser.open(page.as_uri())


@cli.command()
@click.argument("directory", type=click.Path(path_type=Path), default=Path())
def init(directory: Path) -> None:
    """Write a first recipe with comments, and the DTM that it uses, into DIRECTORY."""
    from terrain_forge.recipe import write_starter

    recipe = write_starter(directory)
    _say(f"{recipe}: edit it, then run  terrain-forge build {recipe}")


def _load(path: Path, seed: int | None, changes: tuple[str, ...]) -> RecipeFile:
    from terrain_forge.recipe import load_recipe

    return load_recipe(path, changes=changes if seed is None else (*changes, f"seed={seed}"))


def _names(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(","))
    if not all(names):
        raise OutputError(f"--only {text!r}: names of exports, such as sdf,mjcf")
    return names


def _plain_record(record: logging.LogRecord) -> bool:
    """Escapes a log record's message, as `_say`."""
    record.msg, record.args = _plain(record.getMessage()), None
    return True


def _plain(text: str) -> str:
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def _say(text: str, *, err: bool = False) -> None:
    """Show one line; what a file's name or content would do to the terminal is escaped."""
    click.echo(_plain(text), err=err)


def _finish(passed: bool, out: Path) -> None:
    if passed:
        return
    from terrain_forge.validation import failed_checks

    report = out / "validation" / "report.json"
    for check in failed_checks(report)[:_MOST_TOLD]:
        _say(f"{out}: failed: {check}", err=True)
    _say(f"{out}: a validation check failed, see {report}", err=True)
    raise click.exceptions.Exit(FAILED_CHECK)


class Interrupt:
    """Ctrl-C and a polite kill, which clean up alike.

    Python drops what a callback or a finaliser raises, so a build asks again at each stage.
    """

    def __init__(self) -> None:
        self._came = False

    def listen(self) -> None:
        """Take the process's signals; those that it was told to ignore stay ignored."""
        self._came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._take)

    def ask(self) -> None:
        """Raise KeyboardInterrupt where one has come."""
        if self._came:
            raise KeyboardInterrupt

    def _take(self, number: int, frame: object) -> None:
        del number, frame
        self._came = True
        raise KeyboardInterrupt


_interrupt = Interrupt()


class _Bar:
    """The progress bar over the stages, shown only on a terminal."""

    def __init__(self, stages: int) -> None:
        self._stages = stages
        self._stage = ""
        self._begun = -1

    def __enter__(self) -> Callable[[str, float], None]:
        from tqdm import tqdm

        self._bar = tqdm(
            total=self._stages,
            disable=not sys.stderr.isatty(),
            bar_format="{desc:<14} {percentage:3.0f} % |{bar}| {elapsed}",
        )
        return self._advance

    def _advance(self, stage: str, share: float) -> None:
        _interrupt.ask()
        self._begun += stage != self._stage
        self._stage = stage
        self._bar.set_description_str(stage, refresh=False)
        self._bar.n = min(self._begun + share, self._stages)
        self._bar.refresh()

    def __exit__(self, *_: object) -> None:
        self._bar.close()


class _located:
    """Adds the recipe's file and line to errors that name a key of it."""

    def __init__(self, file: RecipeFile) -> None:
        self._file = file

    def __enter__(self) -> None:
        return None

    def __exit__(self, _: Any, error: BaseException | None, __: Any) -> None:
        if isinstance(error, TerrainForgeError) and error.key:
            raise type(error)(self._file.locate(error)) from None


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    *_: Any,
    others: bool = False,
) -> None:
    """Show a warning about a recipe as one line; those of other libraries are for developers."""
    if issubclass(category, RecipeWarning):
        _say(f"terrain-forge: {message}", err=True)
    elif others:
        _say(warnings.formatwarning(message, category, filename, lineno).strip(), err=True)


def _share_one_heap() -> None:
    """Let all threads take memory from one heap, where the C library is glibc (`mallopt`).

    It gives each thread a heap of its own, and what one frees the others cannot use: a tenth of a
    build's memory.
    """
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, 1)


def main(arguments: list[str]) -> int:
    """Run a command line; returns its exit status."""
    # A build makes many objects and few cycles, the kernels' compiler above all.
    gc.set_threshold(100_000, 50, 50)
    _share_one_heap()
    try:
        _interrupt.listen()
        return int(cli.main(arguments, prog_name="terrain-forge", standalone_mode=False) or 0)
    except click.ClickException as error:
        message = " ".join(error.format_message().split())
        _say(f"terrain-forge: {message} (see terrain-forge --help)", err=True)
        return WRONG_INPUT
    except (click.Abort, KeyboardInterrupt) as error:
        _say(f"interrupted, {str(error) or 'nothing was left behind'}", err=True)
        return INTERRUPTED
    except (TerrainForgeError, OSError) as error:
        if "--debug" in arguments:
            traceback.print_exc()
        _say(f"terrain-forge: {error}", err=True)
        if getattr(error, "errno", None) in _NO_PATH:
            return WRONG_INPUT
        return next((status for kind, status in _STATUS.items() if isinstance(error, kind)))
    except Exception:
        traceback.print_exc()
        click.echo("terrain-forge: internal error, please report it with the lines above", err=True)
        return INTERNAL


def _ignore_interrupt(unraisable: Any) -> None:
    """Tell of what Python drops, but not of an interrupt, which a build asks for again."""
    if not issubclass(unraisable.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)


def run() -> None:
    """The command `terrain-forge`: run the process's command line and end the process.

    It ends without taking the interpreter apart, which would take half a second after a build; and
    where an interrupt met an exec() (imports run some), CPython would end by the signal, although
    it was handled.
    """
    sys.unraisablehook = _ignore_interrupt
    status = main(sys.argv[1:])
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    with suppress(BrokenPipeError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)
