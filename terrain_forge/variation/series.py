"""Making many worlds: each a folder that appears whole, in any order, by any number of workers."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from terrain_forge import __version__
from terrain_forge.base import (
    DataError,
    OutputError,
    Progress,
    RecipeError,
    Spec,
    Stopwatch,
    TerrainForgeError,
    Workers,
    checked,
    compile_ahead,
    read_json,
    require_scheduler,
    require_unlinked,
    resolved,
    run_tasks,
    silent,
    sync,
    telling_interrupts,
    write_through,
    write_whole,
)
from terrain_forge.building import (
    STAGING,
    chosen_exports,
    holding,
    read_manifest,
    require_apart,
    write_export,
    write_manifest,
)
from terrain_forge.making import make_world
from terrain_forge.paths import write_trajectories
from terrain_forge.recipe import (
    MOST_WORLDS,
    ExportOrder,
    Recipe,
    RecipeFile,
    WorldsSpec,
    given_recipe,
    input_paths,
    recipe_json,
)
from terrain_forge.truth import rate_world, write_truth
from terrain_forge.variation.drawing import draw, require_drawable, require_untiled
from terrain_forge.variation.sharing import SharedArchive, drop_unshared, share
from terrain_forge.variation.summary import SUMMARY, read_summary, summary_of, write_table

ORDER, POOL = "worlds.json", "shared"
FORMAT = 1
_BEGUN = ".begun-"
_LEFT = re.compile(rf"{re.escape(_BEGUN)}[0-9]{{5,}}-[0-9]+")
"""A world that a killed process was making."""
_NUMBER = re.compile(r"[0-9]{5,}")
"""A world's folder."""
_SHOWN = 60
"""Characters of a value that a message shows."""
_PICTURE = 256
"""Pixels a side of the ground's pictures, where the recipe does not tell."""


@dataclass(frozen=True, kw_only=True)
class Worlds:
    """What was made of many worlds."""

    directory: Path
    """Folder of all."""
    folders: tuple[Path, ...]
    """Folders of the worlds, by their numbers; those that could not be made are left out."""
    made: int
    """How many of them were made now; the others were there."""
    failed: tuple[tuple[int, str], ...]
    """Numbers of those that could not be made, and why."""
    more: int = 0
    """How many lie in the folder besides, of higher numbers; the table lists them too."""

    def __repr__(self) -> str:
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return f"<Worlds {str(self.directory)!r}: {len(self.folders)} worlds{failed}>"


@checked
def worlds(
    recipe: Recipe | RecipeFile | Path | str,
    out: Path | str,
    *,
    count: int | None = None,
    folder: Path | str = ".",
    only: tuple[str, ...] | str | None = None,
    workers: Workers | None = None,
    scheduler: str | None = None,
    progress: Progress = silent,
) -> Worlds:
    """Make many worlds of one recipe, as its `worlds` part says, or what of them is missing.

    World n hangs on the recipe and n alone: killed and begun again, by any number of workers, among
    more worlds, its files have the same bytes.

    Args:
        recipe: What to make, or its file.
        out: Folder of all; a folder for each world is made in it.
        count: How many, instead of what the recipe says; where more are there, these stay.
        folder: What the recipe's paths are relative to; of a file, its own folder.
        only: Folders of the exports to write; by default all of the recipe.
        workers: Processes; by default one for each core, 0 for this one.
        scheduler: Address of a Dask scheduler, whose workers see the same files.
        progress: Called with each stage as it begins, and the share that is made.

    Raises:
        RecipeError, DataError: if the first world cannot be; nothing is written.
        OutputError: if the folder holds anything else, or another process writes it.
        StorageError: if the disk does not take it.
        KeyboardInterrupt: with how far it came.
    """
    recipe, folder = given_recipe(recipe, folder)
    folder, out = resolved(folder), resolved(out)
    count = (recipe.worlds or WorldsSpec()).count if count is None else count
    if not 1 <= count <= MOST_WORLDS:
        text = f"{count} worlds: 1 to {MOST_WORLDS:,}"
        raise RecipeError(text, key=("worlds", "count"))
    require_untiled(recipe)
    orders = orders_of(recipe, only)
    require_drawable(recipe, folder)
    if scheduler is not None:
        require_scheduler(scheduler)
    require_apart(out, input_paths(recipe, folder))
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out} is no folder: choose another name")
    told = partial(_told, out, count)
    with holding(out), telling_interrupts(told):
        _require_ours(out, recipe, orders)
        require_unlinked(out, POOL).mkdir(exist_ok=True)
        _write(out / ORDER, _order(recipe, orders))
        for left in out.iterdir():
            if _LEFT.fullmatch(left.name) and left.is_dir() and not left.is_symlink():
                shutil.rmtree(left)
        missing = [n for n in range(count) if not (out / name_of(n)).is_dir()]
        whole = sorted({*range(count)} - {*missing})
        for n in whole:
            _require_whole(out / name_of(n))
        if missing:
            _require_inputs(out, whole, recipe, folder)
        for world in worlds_in(out):  # the table lists them all in the end
            read_summary(world)
        if missing:
            compile_ahead(progress)
        task = partial(_make, recipe=recipe, folder=folder, out=out, only=only)
        failed: dict[int, str] = {}
        try:
            for share_done, (number, error) in enumerate(
                run_tasks(task, missing, workers=workers, scheduler=scheduler), 1
            ):
                if isinstance(error, Exception):
                    failed[number] = " ".join(str(error).split()) or type(error).__name__
                    if not isinstance(error, TerrainForgeError):
                        raise error
                progress("worlds", share_done / len(missing))
        except BaseException:  # an interrupt or a full disk, which may not take the table either
            with suppress(OSError, TerrainForgeError):
                write_table(out, worlds_in(out))
            raise
        drop_unshared(out / POOL)
        there = worlds_in(out)
        write_table(out, there)
        folders = tuple(out / name_of(n) for n in range(count) if n not in failed)
    return Worlds(
        directory=out,
        folders=folders,
        made=len(missing) - len(failed),
        failed=tuple(sorted(failed.items())),
        more=len({*there} - {*folders}),
    )


def _told(out: Path, count: int) -> str:
    """What an interrupt leaves."""
    there = sum((out / name_of(n)).is_dir() for n in range(count))
    return f"{there} of {count} worlds are in {out}: the same command goes on from there"


def name_of(number: int) -> str:
    """The folder of a world."""
    return f"{number:05}"


def worlds_in(out: Path) -> tuple[Path, ...]:
    """The folders of all worlds that lie whole in a folder of worlds, by their numbers."""
    found = (path.parent for path in out.glob(f"*/{SUMMARY}"))
    numbered = (path for path in found if _NUMBER.fullmatch(path.name))
    return tuple(sorted(numbered, key=lambda path: int(path.name)))


def orders_of(recipe: Recipe, only: tuple[str, ...] | str | None) -> tuple[ExportOrder, ...]:
    """The exports, with small pictures of the ground where the recipe does not tell their size."""
    told = recipe.exports if isinstance(recipe.exports, dict) else {}
    return tuple(
        replace(order, options=replace(order.options, texture_pixels=_PICTURE))
        if _has_pictures(order.options) and "texture_pixels" not in told.get(order.folder, {})
        else order
        for order in chosen_exports(recipe, only)
    )


def _has_pictures(options: Spec) -> bool:
    """Whether an export's options tell the size of pictures, and it has some."""
    named = {one.name for one in fields(options)} - {one.name for one in options.idle()}
    return "texture_pixels" in named


def _order(recipe: Recipe, orders: tuple[ExportOrder, ...]) -> dict[str, Any]:
    """What the worlds of a folder have in common."""
    plain = json.loads(recipe_json(recipe))
    if plain["worlds"]:
        del plain["worlds"]["count"]  # of which no world knows
    return {
        "terrain_forge": __version__,
        "format": FORMAT,
        "recipe": plain,
        "exports": sorted(order.folder for order in orders),
    }


def _require_ours(out: Path, recipe: Recipe, orders: tuple[ExportOrder, ...]) -> None:
    """Refuse a folder, which is ours to write now, that holds anything but worlds of this recipe.

    Raises:
        OutputError: says what it holds.
    """
    if all(path.name == STAGING for path in out.iterdir()):
        return
    try:
        found = read_json(out / ORDER, ORDER)
    except DataError:
        raise OutputError(
            f"{out} exists and holds no worlds of ours (no {ORDER}): choose another folder"
        ) from None
    wanted = _order(recipe, orders)
    for key in wanted:
        if not isinstance(found, dict) or found.get(key) != wanted[key]:
            what = {"exports": "other exports"}.get(key, f"another {key}")
            theirs = found.get(key) if isinstance(found, dict) else None
            if key == "recipe" and isinstance(theirs, dict):
                what += _difference(theirs, wanted[key])
            elif theirs is not None:
                what += f" ({_short(theirs)}, not {_short(wanted[key])})"
            raise OutputError(f"{out} holds worlds of {what}: choose another folder")


def _difference(theirs: dict[str, Any], mine: dict[str, Any]) -> str:
    """The first key in which two recipes differ."""
    for key in {**mine, **theirs}:
        value, other = mine.get(key, "nothing"), theirs.get(key, "nothing")
        if other != value:
            if isinstance(other, dict) and isinstance(value, dict):
                return f" ({key}{_difference(other, value).replace(' (', '.', 1)}"
            return f" ({key}: {_short(other)}, not {_short(value)})"
    return ""


def _short(value: Any) -> str:
    """A value of a recipe in a line."""
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


def _require_inputs(out: Path, whole: Sequence[int], recipe: Recipe, folder: Path) -> None:
    """Refuse worlds of which an input file was another when they were made.

    Of those with the same files the first is looked at.

    Raises:
        OutputError: names the file.
    """
    inputs = {n: read_manifest(out / name_of(n)).get("inputs", {}) for n in reversed(whole)}
    for n in {tuple(found): n for n, found in inputs.items()}.values():
        now = dict(draw(recipe, n, folder=folder).site.inputs)
        for name in {**inputs[n], **now}:
            if inputs[n].get(name) != now.get(name):
                raise OutputError(f"{out} holds worlds of another {name}: choose another folder")


def _require_whole(world: Path) -> None:
    """Refuse a world of which files are gone; whether they were changed, `validate` tells.

    Raises:
        OutputError: names the first, and how the world is made again.
    """
    gone = [name for name in read_manifest(world)["outputs"] if not (world / name).is_file()]
    if gone:
        raise OutputError(
            f"{world} is not whole, {gone[0]} is missing: remove {world.name}, and the same "
            "command makes it again"
        )


def _make(
    number: int, *, recipe: Recipe, folder: Path, out: Path, only: tuple[str, ...] | str | None
) -> None:
    """Make one world, in a folder beside its own that then takes its name."""
    orders = orders_of(recipe, only)
    drawn = draw(recipe, number, folder=folder)
    begun = out / f"{_BEGUN}{name_of(number)}-{os.getpid()}"
    shutil.rmtree(begun, ignore_errors=True)
    begun.mkdir()
    try:
        world = make_world(drawn.site, drawn.site.window, settled=True, progress=Stopwatch(silent))
        spec = (recipe.worlds or WorldsSpec()).arrival
        rated = rate_world(world) if world.rover.wheels else None
        summary = summary_of(drawn, world, spec, rated)
        exports = tuple(write_export(world, begun, order) for order in orders)
        write_truth(world, begun, figures=False, rated=rated)
        if world.trajectories:
            write_trajectories(world.trajectories, begun / "paths")
        archive = SharedArchive(out / POOL)
        world.save(begun, write=archive.write)
        _write(begun / SUMMARY, summary)
        write_manifest(world.site, begun, exports=exports, known=archive.known)
        hashes = read_manifest(begun)["outputs"]
        share(begun, hashes, out / POOL)
        archive.keep(hashes)
        write_through(begun)
        begun.rename(out / name_of(number))
        sync(out)
    except BaseException:
        shutil.rmtree(begun, ignore_errors=True)
        raise


def _write(path: Path, content: dict[str, Any]) -> None:
    write_whole(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
