"""The command line: `terrain-forge build recipe.yaml` and its companions.

What a command's exit status means stands in `terminal/running.py`.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from terrain_forge import __version__
from terrain_forge.base import OutputError, TerrainForgeError
from terrain_forge.terminal import (
    FAILED_CHECK,
    WRONG_INPUT,
    Display,
    complete_exporters,
    complete_keys,
    complete_recipes,
    complete_starters,
    complete_terrain_models,
    completion_script,
    refuse_raster,
    run_command,
    run_process,
    say,
    show_log,
)

if TYPE_CHECKING:
    from terrain_forge.recipe import RecipeFile

_OUT = click.argument("out", type=click.Path(path_type=Path))
_RECIPE = click.argument("recipe", type=click.Path(path_type=Path), shell_complete=complete_recipes)
_SET = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="KEY=VALUE",
    shell_complete=complete_keys,
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


class _InOrder(click.Group):
    """Lists its commands in the order of their use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The order in which they are defined."""
        del ctx
        return list(self.commands)


@click.group(
    cls=_InOrder, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(__version__, prog_name="terrain-forge")
@click.option("--debug", is_flag=True, help="Log more, and show tracebacks.")
def cli(debug: bool) -> None:
    """Make planetary worlds for rovers: ground, rocks, paths and truth, for Gazebo, MuJoCo and USD.

    Start with `terrain-forge init`, which writes a first recipe with comments, then
    `terrain-forge build hello.yaml`.
    """
    show_log(debug=debug)


@cli.command()
@click.argument("directory", type=click.Path(path_type=Path), default=Path())
@click.option("--list", "listed", is_flag=True, help="Only list the recipes that there are.")
@click.option(
    "--recipe",
    default="hello",
    metavar="NAME",
    show_default=True,
    shell_complete=complete_starters,
    help="Which one.",
)
def init(directory: Path, listed: bool, recipe: str) -> None:
    """Write a first recipe, and its DTM, into DIRECTORY."""
    from terrain_forge.recipe import starters, write_starter

    if listed:
        for name, about in starters().items():
            say(f"{name:<14} {about}")
        return
    path = write_starter(directory, recipe)
    say(f"{path}: edit it, then run  terrain-forge build {path}")


@cli.command()
@_RECIPE
@_SEED
@_SET
def check(recipe: Path, seed: int | None, changes: tuple[str, ...]) -> None:
    """Check RECIPE, say what it makes and what that costs.

    Its inputs are read, and its DTM is described; nothing is built. RECIPE may also be a raster
    file: then only that is described.
    """
    from terrain_forge import pipeline
    from terrain_forge.building import check_raster
    from terrain_forge.dtm import file_to_open

    if recipe.suffix.lower() not in (".yaml", ".yml") and recipe.is_file():
        for line in check_raster(file_to_open(recipe)):
            say(line)
        return
    file = _load(recipe, seed, changes)
    with _located(file):
        for line in pipeline.check(file.recipe, folder=file.folder):
            say(line)


@cli.command()
@_RECIPE
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Picture [default: ./NAME_preview.png]."
)
@_SEED
@_SET
def preview(recipe: Path, out: Path | None, seed: int | None, changes: tuple[str, ...]) -> None:
    """Show what RECIPE makes as one picture, quickly.

    It shows ground, rocks and paths from above; nothing is exported. Dynamic rocks are not settled:
    they are drawn where they would be dropped.
    """
    from terrain_forge import pipeline
    from terrain_forge.making import plan
    from terrain_forge.terminal import require_preview, tell_preview

    file = _load(recipe, seed, changes)
    out = out or Path(f"{file.recipe.name}_preview.png")
    require_preview(out)
    with _located(file), Display(pipeline.MAKING) as display:
        display("plan")
        site = plan(file.recipe, folder=file.folder, progress=display)
        world = pipeline.realise(site, settled=False, progress=display)
    tell_preview(world, out)


@cli.command()
@_RECIPE
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Output folder [default: ./NAME]."
)
@_SEED
@_SET
@click.option(
    "--only",
    metavar="FORMATS",
    shell_complete=complete_exporters,
    help="Write only these exports, such as sdf,glb: the recipe's, or others with their defaults.",
)
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
    """Make the world of RECIPE, check it, and write it to a folder.

    The folder appears whole or not at all; an older world of ours in its place is replaced.
    """
    from terrain_forge import pipeline
    from terrain_forge.building import require_apart
    from terrain_forge.terminal import finish, tell_build

    if drives:
        changes = (*changes, f"validate.drives={drives}")
    file = _load(recipe, seed, changes)
    out = out or Path(file.recipe.name)
    require_apart(out.resolve(), [file.path])
    with _located(file), Display(pipeline.STAGES) as display:
        result = pipeline.build(
            file.recipe,
            out,
            folder=file.folder,
            only=_names(only),
            force=force,
            progress=display,
        )
    tell_build(result, out, display.elapsed)
    finish(result.passed, out)


@cli.command()
@_OUT
@click.option(
    "--only",
    required=True,
    metavar="FORMATS",
    shell_complete=complete_exporters,
    help="Formats to write, such as usd.",
)
@_FORCE
def export(out: Path, only: str, force: bool) -> None:
    """Write further formats from the world built in OUT.

    A check that failed before and has nothing to do with them does not fail the command.
    """
    from terrain_forge import pipeline
    from terrain_forge.terminal import finish, tell_exports

    names = _names(only) or ()
    with Display(pipeline.export_stages(names)) as display:
        passed = pipeline.export(out, names, force=force, progress=display)
    tell_exports(out, names, display.elapsed)
    finish(passed, out)


@cli.command()
@_OUT
@click.option("--quick", is_flag=True, help="Only what a build checks, no other programs.")
@_DRIVES
def validate(out: Path, quick: bool, drives: int | None) -> None:
    """Validate the world in OUT in all programs that read it.

    Prints the largest error of each over its limit. Programs that are not installed are not run:
    Gazebo's libraries are found by pkg-config, Drake and Newton in this Python or in those that
    TERRAIN_FORGE_DRAKE_PYTHON and TERRAIN_FORGE_NEWTON_PYTHON name.
    """
    from terrain_forge import pipeline
    from terrain_forge.terminal import finish, tell_validation

    with Display(pipeline.VALIDATE_STAGES) as display:
        passed = pipeline.validate(out, every_consumer=not quick, drives=drives, progress=display)
    tell_validation(out, display.elapsed, table=not quick)
    finish(passed, out)


@cli.command()
@_OUT
@click.option("--path", metavar="NAME", help="The path [default: the recipe's, or the first].")
@click.option("--from", "begin", type=float, default=0.0, metavar="S", help="From when [s].")
@click.option("--to", "end", type=float, metavar="S", help="Until when [s], without it.")
@click.option("--only", metavar="SENSORS", help="Only these sensors, such as camera,imu.")
@click.option("--formats", metavar="FORMATS", help="Also write these, such as kitti,rosbag2.")
@click.option("--motion", type=click.Choice(["path", "drive"]), help="What moves the rover.")
@click.option("--quick", is_flag=True, help="Small pictures, few of them, for a first look.")
@click.option("--workers", type=int, metavar="N", help="Measurements at once [default: cores].")
@click.option("--force", is_flag=True, help="Replace another recording; files of others stay.")
def record(
    out: Path,
    begin: float,
    end: float | None,
    only: str | None,
    formats: str | None,
    workers: int | None,
    force: bool,
    **choice: Any,
) -> None:
    """Record what the sensors measure in the world built in OUT, into OUT/dataset.

    Killed or interrupted, the same command goes on where it was. Any part, as by --from and --to,
    has the bytes that it has in the whole.
    """
    from terrain_forge import pipeline
    from terrain_forge.recording import RECORDING
    from terrain_forge.terminal import tell_recording

    changes = {key: value for key, value in choice.items() if value}
    if changes.pop("quick", None):
        changes["profile"] = "quick"
    if formats is not None:
        changes["formats"] = _names(formats, "--formats", "kitti,rosbag2")
    with Display(RECORDING) as display:
        result = pipeline.record(
            out,
            begin=begin,
            end=end,
            only=_names(only, example="camera,imu") or (),
            workers=workers,
            force=force,
            progress=display,
            **changes,
        )
    tell_recording(result, display.elapsed)


@cli.command()
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "--systems",
    metavar="NAMES",
    help="Systems to run over the recording of OUT, such as kiss-icp,stereo-odometry, or .yaml "
    "files; by default all that are installed and find their sensors.",
)
@click.option("--runs", type=click.IntRange(1, 100), default=1, help="How often each is run.")
@click.option("--list", "listed", is_flag=True, help="Only list the systems that are known.")
@click.option("--install", metavar="NAME", help="Make the environment of a system that pip brings.")
@click.option("--truth", type=click.Path(path_type=Path), help="A true trajectory.")
@click.option(
    "--estimate", type=click.Path(path_type=Path), help="What a system told; more may follow."
)
@click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="KEY=VALUE",
    help="How it is scored, such as align=all, third_by=index or stations_m=0.",
)
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Write JSON, CSV, LaTeX here.")
def evaluate(
    paths: tuple[Path, ...],
    systems: str | None,
    runs: int,
    listed: bool,
    install: str | None,
    truth: Path | None,
    estimate: Path | None,
    changes: tuple[str, ...],
    out: Path | None,
) -> int:
    """Run systems over the recording in OUT and score them, or score trajectories.

    OUT holds what `terrain-forge record` recorded. With --truth and --estimate files are scored:
    TUM (`time x y z qx qy qz qw`) or EuRoC's CSV, of the same frame. The defaults are the paper's:
    alignment on the first third, drift of the path's length over 10 m.
    """
    from terrain_forge import evaluation

    options = evaluation.read_options(changes)
    if listed:
        for line in evaluation.system_lines():
            say(line)
        return 0
    if install:
        folder = evaluation.install_system(evaluation.find_system(install))
        say(f"{install}: installed in {folder}")
        return 0
    if truth and estimate:
        return _score(truth, (estimate, *paths), options, out)
    if truth or estimate or len(paths) != 1:
        raise OutputError("evaluate needs OUT, a recorded world, or --truth and --estimate")
    with Display(("systems",)) as display:
        results = evaluation.evaluate_recording(
            paths[0],
            evaluation.chosen_systems(systems, paths[0]),
            runs=runs,
            options=options,
            progress=lambda name: display(f"systems: {name}"),
        )
    for line in evaluation.result_lines(results):
        say(line)
    scores = [one.score for one in results if one.score]
    for path in evaluation.write_scores(scores, out) if out else ():
        say(str(path))
    return 0 if scores else FAILED_CHECK


def _score(truth: Path, estimates: tuple[Path, ...], options: Any, out: Path | None) -> int:
    from terrain_forge.evaluation import score_files, score_lines, write_scores

    scores, failures = score_files(truth, estimates, options)
    for line in score_lines(scores) if scores else ():
        say(line)
    for path in write_scores(scores, out, failures=failures) if out else ():
        say(str(path))
    for _, why in failures:
        say(f"terrain-forge: {why}", err=True)
    return WRONG_INPUT if failures else 0


@cli.command()
@_OUT
@click.option("--no-browser", is_flag=True, help="Only print where the page is.")
def view(out: Path, no_browser: bool) -> None:
    """Open the report page of the world built in OUT."""
    from terrain_forge.building import read_manifest

    read_manifest(out)
    page = (out / "report.html").absolute()
    if not page.is_file():
        raise OutputError(f"{out} has no report page; `terrain-forge validate {out}` makes it")
    say(str(page))
    if not no_browser and not _opened(page):
        say("no browser could be opened here: open that file in one")


def _opened(page: Path) -> bool:
    """Whether a browser with a window took the page."""
    import webbrowser

    display = "DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ
    return (display or sys.platform != "linux") and webbrowser.open(page.as_uri())


@cli.command()
def schema() -> None:
    """Print the JSON Schema of recipes, for editors."""
    import json

    from terrain_forge.recipe import json_schema

    click.echo(json.dumps(json_schema(), indent=1, ensure_ascii=False))


@cli.command()
def doctor() -> None:
    """Say what is installed here, and what was not found.

    Versions, cores, cache, engines, exporters, and the programs that open exports or check them.
    """
    from terrain_forge.terminal import doctor_lines

    for line in doctor_lines():
        say(line)


@cli.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print what makes SHELL complete commands and names.

    Recipes, exporters after --only, keys after --set, terrain models of fetch. For bash:

        terrain-forge completion bash >> ~/.bashrc
    """
    click.echo(completion_script(cli, shell))


@cli.command()
@click.argument("names", nargs=-1, required=True, shell_complete=complete_terrain_models)
def fetch(names: tuple[str, ...]) -> None:
    """Fetch the terrain models of NAMES into the cache: products, places, or recipes (.yaml)."""
    from terrain_forge.dtm import RasterDtm, at_hand, fetch_product
    from terrain_forge.model import BODIES

    for name in names:
        with Display(("download",)) as display:
            if not name.endswith((".yaml", ".yml")):
                found = str(fetch_product(name, progress=display))
            else:
                file = _load(Path(name), None, ())
                dtm, body = file.recipe.dtm, BODIES[file.recipe.body]
                found = "needs no file"
                if isinstance(dtm, RasterDtm):
                    with _located(file):
                        found = at_hand(dtm, body=body, progress=display).name
        say(f"{name}: {found}")


@cli.command()
def sites() -> None:
    """List places by name, for `dtm: {place: NAME}`, and the terrain models that show them."""
    from terrain_forge.dtm import place_lines

    for line in place_lines():
        say(line)


def _load(path: Path, seed: int | None, changes: tuple[str, ...]) -> RecipeFile:
    from terrain_forge.recipe import load_recipe

    refuse_raster(path)
    return load_recipe(path, changes=changes if seed is None else (*changes, f"seed={seed}"))


def _names(
    text: str | None, option: str = "--only", example: str = "sdf,mjcf"
) -> tuple[str, ...] | None:
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(","))
    if not all(names):
        raise OutputError(f"{option} {text!r}: names with commas between them, such as {example}")
    return names


class _located:
    """Adds the recipe's file and line to errors that name a key of it."""

    def __init__(self, file: RecipeFile) -> None:
        self._file = file

    def __enter__(self) -> None:
        return None

    def __exit__(self, _: Any, error: BaseException | None, __: Any) -> None:
        if isinstance(error, TerrainForgeError) and error.key:
            raise type(error)(self._file.locate(error)) from None


def main(arguments: list[str]) -> int:
    """Run a command line; returns its exit status."""
    return run_command(cli, arguments)


def run() -> None:
    """The command `terrain-forge`."""
    run_process(cli)
