"""The command line: `terrain-forge build recipe.yaml` and its companions.

What a command's exit status means stands in `terminal/running.py`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from terrain_forge import __version__
from terrain_forge.commands import cut, evaluate, illumination, make_worlds, study
from terrain_forge.terminal import (
    DRIVES,
    FORCE,
    ONLY,
    OUT,
    RECIPE,
    SEED,
    SET,
    Display,
    InOrder,
    Number,
    complete_exporters,
    complete_starters,
    complete_terrain_models,
    completion_script,
    names_of,
    run_command,
    run_process,
    say,
    show_log,
    side_by_side,
    word,
)


@click.group(
    cls=InOrder, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
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
    say(f"{path}: edit it, then run  terrain-forge build {word(path)}")


@cli.command()
@RECIPE
@SEED
@SET
def check(recipe: Path, seed: int | None, changes: tuple[str, ...]) -> None:
    """Check RECIPE, say what it makes and what that costs.

    Its inputs are read, and its DTM is described; nothing is built. RECIPE may also be a raster
    file: then only that is described.
    """
    from terrain_forge import pipeline
    from terrain_forge.building import check_raster
    from terrain_forge.dtm import file_to_open
    from terrain_forge.terminal import load_given, located

    if recipe.suffix.lower() not in (".yaml", ".yml") and recipe.is_file():
        for line in check_raster(file_to_open(recipe)):
            say(line)
        return
    file = load_given(recipe, seed=seed, changes=changes)
    with located(file):
        for line in pipeline.check(file.recipe, folder=file.folder):
            say(line)


@cli.command()
@RECIPE
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Picture [default: ./NAME_preview.png]."
)
@SEED
@SET
def preview(recipe: Path, out: Path | None, seed: int | None, changes: tuple[str, ...]) -> None:
    """Show what RECIPE makes as one picture, quickly.

    It shows ground, rocks and paths from above; nothing is exported. Dynamic rocks are not settled:
    they are drawn where they would be dropped.
    """
    from terrain_forge import pipeline
    from terrain_forge.base import compile_ahead
    from terrain_forge.making import draft, plan_draft, with_fetched
    from terrain_forge.terminal import load_given, located, require_preview, tell_preview

    file = load_given(recipe, seed=seed, changes=changes)
    out = out or Path(f"{file.recipe.name}_preview.png")
    require_preview(out)
    with located(file), Display(pipeline.PREVIEW_STAGES) as display:
        drafted = with_fetched(draft(file.recipe, folder=file.folder), progress=display)
        compile_ahead(display)
        display("plan")
        site = plan_draft(drafted, progress=display)
        world = pipeline.realise(site, settled=False, horizon=False, progress=display)
    tell_preview(world, out)


@cli.command()
@RECIPE
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Output folder [default: ./NAME]."
)
@SEED
@SET
@ONLY
@DRIVES
@side_by_side
@click.option(
    "--exchange",
    metavar="URL",
    help="Where workers that do not see the folder leave tiles for it, such as s3://bucket/tiles.",
)
@FORCE
def build(
    recipe: Path,
    out: Path | None,
    seed: int | None,
    changes: tuple[str, ...],
    only: tuple[str, ...],
    drives: int | None,
    **how: Any,
) -> None:
    """Make the world of RECIPE, check it, and write it to a folder.

    The folder appears whole or not at all; an older world of ours in its place is replaced.
    """
    from terrain_forge import pipeline
    from terrain_forge.base import resolved
    from terrain_forge.building import require_apart
    from terrain_forge.terminal import finish, load_given, located, tell_build

    if drives:
        changes = (*changes, f"validate.drives={drives}")
    file = load_given(recipe, seed=seed, changes=changes)
    out = out or Path(file.recipe.name)
    require_apart(resolved(out), [file.path])
    with located(file), Display(pipeline.STAGES) as display:
        result = pipeline.build(
            file.recipe,
            out,
            folder=file.folder,
            only=names_of(only),
            progress=display,
            **how,
        )
    tell_build(result, out, display.elapsed)
    finish(result.passed, out)


@cli.command()
@OUT
@click.option(
    "--only",
    multiple=True,
    required=True,
    metavar="FORMATS",
    shell_complete=complete_exporters,
    help="Formats to write, such as usd.",
)
@FORCE
def export(out: Path, only: tuple[str, ...], force: bool) -> None:
    """Write further formats from the world built in OUT.

    A check that failed before and has nothing to do with them does not fail the command.
    """
    from terrain_forge import pipeline
    from terrain_forge.terminal import finish, tell_exports

    names = names_of(only) or ()
    with Display(pipeline.export_stages(names)) as display:
        passed = pipeline.export(out, names, force=force, progress=display)
    tell_exports(out, names, display.elapsed)
    finish(passed, out)


@cli.command()
@OUT
@click.option("--quick", is_flag=True, help="Only what a build checks, no other programs.")
@DRIVES
@FORCE
def validate(out: Path, quick: bool, **choice: Any) -> None:
    """Validate the world in OUT in all programs that read it.

    Prints the largest error of each over its limit. Programs that are not installed are not run:
    Gazebo's libraries are found by pkg-config, Drake and Newton in this Python or in those that
    TERRAIN_FORGE_DRAKE_PYTHON and TERRAIN_FORGE_NEWTON_PYTHON name.
    """
    from terrain_forge import pipeline
    from terrain_forge.terminal import finish, tell_validation

    with Display(pipeline.VALIDATE_STAGES) as display:
        passed = pipeline.validate(out, every_consumer=not quick, progress=display, **choice)
    tell_validation(out, display.elapsed, table=not quick)
    finish(passed, out)


@cli.command()
@OUT
@click.option("--path", metavar="NAME", help="The path [default: the recipe's, or the first].")
@click.option("--from", "begin", type=Number(), default=0.0, metavar="S", help="From when [s].")
@click.option("--to", "end", type=Number(), metavar="S", help="Until when [s], without it.")
@click.option(
    "--only", multiple=True, metavar="SENSORS", help="Only these sensors, such as camera,imu."
)
@click.option(
    "--formats", multiple=True, metavar="FORMATS", help="Also write these, such as kitti,rosbag2."
)
@click.option("--motion", type=click.Choice(["path", "drive"]), help="What moves the rover.")
@click.option("--quick", is_flag=True, help="Small pictures, few of them, for a first look.")
@click.option("--workers", type=int, metavar="N", help="Measurements at once [default: cores].")
@click.option("--force", is_flag=True, help="Replace another recording; files of others stay.")
def record(
    out: Path,
    begin: float,
    end: float | None,
    only: tuple[str, ...],
    formats: tuple[str, ...],
    workers: int | None,
    force: bool,
    **choice: Any,
) -> None:
    """Record what the sensors measure in the world built in OUT, into OUT/dataset.

    Killed or interrupted, the same command goes on where it was. Any part, as by --from and --to,
    has the bytes that it has in the whole.
    """
    from terrain_forge import pipeline
    from terrain_forge.terminal import tell_recording

    changes = {key: value for key, value in choice.items() if value}
    if changes.pop("quick", None):
        changes["profile"] = "quick"
    if formats:
        changes["formats"] = names_of(formats, "--formats", "kitti,rosbag2")
    with Display(pipeline.record_stages()) as display:
        result = pipeline.record(
            out,
            begin=begin,
            end=end,
            only=names_of(only, example="camera,imu") or (),
            workers=workers,
            force=force,
            progress=display,
            **changes,
        )
    tell_recording(result, display.elapsed)


cli.add_command(evaluate)
cli.add_command(study)


cli.add_command(illumination)


@cli.command()
@OUT
@click.option("--no-browser", is_flag=True, help="Only print where the page is.")
def view(out: Path, no_browser: bool) -> None:
    """Open the report page of the world built in OUT."""
    from terrain_forge.terminal import show_report

    show_report(out, opened=not no_browser)


@cli.command()
def schema() -> None:
    """Print the JSON Schema of recipes, for editors."""
    import json

    from terrain_forge.recipe import json_schema

    click.echo(json.dumps(json_schema(), indent=1, ensure_ascii=False))


@cli.command()
def doctor() -> None:
    """Say what is installed here, and what was not found.

    Versions, cores, cache, engines, exporters, parts of other packages, and the programs that open
    exports or check them.
    """
    from terrain_forge.report import section_types
    from terrain_forge.terminal import doctor_lines

    for line in doctor_lines((section_types,)):
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
    from terrain_forge.terminal import fetch_given

    for name in names:
        with Display(("download",)) as display:
            found = fetch_given(name, progress=display)
        say(f"{name}: {found}")


@cli.command()
def sites() -> None:
    """List places by name, for `dtm: {place: NAME}`, and the terrain models that show them."""
    from terrain_forge.dtm import place_lines

    for line in place_lines():
        say(line)


cli.add_command(make_worlds)
cli.add_command(cut)


def main(arguments: list[str]) -> int:
    """Run a command line; returns its exit status."""
    return run_command(cli, arguments)


def run() -> None:
    """The command `terrain-forge`."""
    run_process(cli)
