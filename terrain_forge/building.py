"""Writing a world: everything in the output folder, which appears whole or not at all."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from glob import escape
from pathlib import Path
from typing import Any

from terrain_forge.errors import ExportError, OutputError
from terrain_forge.limits import require_exports
from terrain_forge.manifest import NAME, read_manifest, write_manifest
from terrain_forge.pipeline import Progress, plan, realise, silent
from terrain_forge.recipe import ExportOrder, Recipe, export_orders
from terrain_forge.world import World


@dataclass(frozen=True, kw_only=True)
class BuildResult:
    """What a build left behind."""

    directory: Path
    """The output folder."""
    world: World
    """The world that is in it."""
    passed: bool
    """Whether every validation check passed."""
    losses: dict[str, tuple[str, ...]]
    """What each export cannot say, by its folder."""


STAGES = (
    *("plan", "rock library", "ground", "rocks", "paths", "writing"),
    *("validation", "report page", "manifest"),
)
"""Stages of a build."""


class Stopwatch:
    """Wall times of the stages, for timings.json and the progress bar."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._name = ""
        self._begin = self._since = time.perf_counter()
        self.seconds: dict[str, float] = {}
        self.figures: dict[str, float] = {}

    def __call__(self, stage: str, share: float = 0.0) -> None:
        """Begin a stage, and end the one before; or tell the share of it that is done."""
        self._progress(stage, share)
        if stage == self._name:
            return
        now = time.perf_counter()
        if self._name:
            self.seconds[self._name] = self.seconds.get(self._name, 0.0) + now - self._since
        self._name, self._since = stage, now

    def timed(self, name: str, task: Callable[[], Any]) -> Any:
        """Carry out a task that others may run beside, and note its wall time."""
        since = time.perf_counter()
        result = task()
        self.seconds[name] = time.perf_counter() - since
        return result

    def write(self, directory: Path) -> None:
        """Write timings.json; the times of tasks that ran side by side overlap."""
        now = time.perf_counter()
        self.seconds[self._name] = now - self._since
        timings = {
            "wall_time_s": {name: round(value, 4) for name, value in self.seconds.items()},
            "total_s": round(now - self._begin, 4),
            **self.figures,
        }
        (directory / "timings.json").write_text(json.dumps(timings, indent=1) + "\n")


def build(
    recipe: Recipe,
    out: Path | str | None = None,
    *,
    folder: Path | str = ".",
    only: tuple[str, ...] | None = None,
    progress: Progress = silent,
) -> BuildResult:
    """Make a recipe's world and write all of it.

    Args:
        recipe: what to make.
        out: output folder; by default the recipe's name in the current folder. An older world
            of ours is replaced when the new one is whole.
        folder: what the recipe's paths are relative to.
        only: folders of the exports to write; by default all of the recipe.
        progress: told each stage as it begins, and how far it is.

    Raises:
        RecipeError, DataError, ExportError: the recipe cannot be built; nothing is written.
        OutputError: `out` exists and is not ours.
    """
    watch = Stopwatch(progress)
    watch("plan")
    out = Path(out or recipe.name)
    require_ours(out)
    orders = chosen(export_orders(recipe), only)
    site = plan(recipe, folder=folder)
    require_exports(orders, site)
    world = realise(site, progress=watch)
    return _write_whole(world, out, orders=orders, watch=watch)


def write_world(
    world: World,
    out: Path | str,
    *,
    exports: tuple[str, ...] | dict[str, dict[str, Any]] | None = None,
    progress: Progress = silent,
) -> BuildResult:
    """Write a world that was made or changed in Python as `build` writes a recipe's.

    The manifest names the recipe that the world began with; edits are in the saved world alone.

    Args:
        world: The world.
        out: Output folder; an older world of ours is replaced when the new one is whole.
        exports: Formats to write, as a recipe's `exports`; by default those of the world's recipe.
        progress: Told each stage as it begins, and how far it is.

    Raises:
        RecipeError, ExportError: for an unknown exporter or option, or a world that a format cannot
            hold; nothing is written.
        OutputError: `out` exists and is not ours.
    """
    recipe = world.site.recipe
    orders = export_orders(recipe if exports is None else replace(recipe, exports=exports))
    require_ours(Path(out))
    return _write_whole(world, Path(out), orders=orders, watch=Stopwatch(progress))


def _write_whole(
    world: World, out: Path, *, orders: tuple[ExportOrder, ...], watch: Stopwatch
) -> BuildResult:
    with replacing(out) as directory:
        losses = write(world, directory, orders=orders, watch=watch)
        passed = assess(world, directory, losses=losses, altered={}, watch=watch)
    return BuildResult(directory=out, world=world, passed=passed, losses=losses)


def write(
    world: World, directory: Path, *, orders: tuple[ExportOrder, ...], watch: Stopwatch
) -> dict[str, tuple[str, ...]]:
    """Write the world, its exports, truth, paths and picture; returns the exports' losses.

    None of them needs another, so they go side by side: kernels and the file system leave Python's
    lock to the others.
    """
    from terrain_forge.paths.files import write_trajectories
    from terrain_forge.preview import write_preview
    from terrain_forge.truth.bundle import write_truth

    # The picture first: its rays leave Python's lock to the exports.
    tasks: dict[str, Callable[[], Any]] = {
        "preview": partial(write_preview, world, directory / "preview.png"),
        **{f"export {order.folder}": partial(export, world, directory, order) for order in orders},
        "truth": partial(write_truth, world, directory),
        "path files": partial(write_trajectories, world.trajectories, directory / "paths"),
        "world": partial(world.save, directory),
    }
    results = _side_by_side(tasks, watch)
    return {order.folder: results[f"export {order.folder}"] for order in orders}


def _side_by_side(tasks: dict[str, Callable[[], Any]], watch: Stopwatch) -> dict[str, Any]:
    """Results of tasks that run two at a time; the first that fails cancels those not begun."""
    watch("writing")
    with ThreadPoolExecutor(2) as pool:
        futures = {name: pool.submit(watch.timed, name, task) for name, task in tasks.items()}
        try:
            for done, future in enumerate(as_completed(futures.values()), 1):
                future.result()
                watch("writing", done / len(futures))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return {name: future.result() for name, future in futures.items()}


def export(world: World, directory: Path, order: ExportOrder) -> tuple[str, ...]:
    """Write one export into its folder of `directory`, whole or not at all; returns its losses."""
    with replacing(directory / order.folder) as folder:
        try:
            report = order.exporter.export(world, folder, options=order.options)
        except ExportError as error:
            raise ExportError(str(error), key=("exports", order.folder, *error.key)) from None
    return report.losses


def assess(
    world: World,
    directory: Path,
    *,
    losses: dict[str, tuple[str, ...]],
    altered: dict[str, str],
    watch: Stopwatch,
    every_consumer: bool = False,
    drives: int | None = None,
) -> bool:
    """Validate what lies in the folder, write its report page, timings and manifest.

    Args:
        world: the world.
        directory: the output folder.
        losses: what each export cannot say, by its folder.
        altered: files that are not as they were built, with the hash that they should have.
        watch: told what is being done.
        every_consumer: whether to open the exports in all consumers, whatever the recipe says.
        drives: from how many random starts to drive, instead of what the recipe says.

    Returns:
        Whether every check passed.
    """
    from terrain_forge.report.page import write_report_page
    from terrain_forge.report.section import take_map
    from terrain_forge.validation.checks import validate
    from terrain_forge.validation.spec import ValidateSpec

    watch("validation")
    spec = world.site.recipe.validate or ValidateSpec()
    if every_consumer:
        spec = replace(spec, consumers="all")
    if drives:
        spec = replace(spec, drives=drives)
    with ThreadPoolExecutor(1) as pool:
        # The page's largest picture is all rays, which leave Python's lock to the checks.
        above = pool.submit(take_map, world)
        result = validate(
            world,
            directory,
            spec=spec,
            altered=tuple(altered),
            progress=partial(watch, "validation"),
        )
    watch.figures.update(result.timings)
    watch("report page")
    write_report_page(world, directory, above=above.result())
    watch("manifest")
    write_manifest(world.site, directory, losses=losses, altered=altered)
    watch.write(directory)
    return result.passed


def chosen(
    orders: tuple[ExportOrder, ...], only: tuple[str, ...] | None
) -> tuple[ExportOrder, ...]:
    """The exports that `only` names, by folder.

    Raises:
        OutputError: for a name that the recipe does not export.
    """
    folders = [order.folder for order in orders]
    for name in only or ():
        if name not in folders:
            raise OutputError(
                f"--only {name}: the recipe exports {', '.join(folders) or 'nothing'}"
            )
    return orders if only is None else tuple(order for order in orders if order.folder in only)


def require_ours(out: Path) -> None:
    """Refuse an output folder that exists and was not made by us."""
    if not out.exists() and not out.is_symlink():
        parent = next(p for p in out.absolute().parents if p.exists())
        if not parent.is_dir() or not os.access(parent, os.W_OK):
            raise OutputError(f"{out} cannot be made: {parent} is no folder that can be written")
        return
    if not out.is_dir() or (any(out.iterdir()) and not (out / NAME).is_file()):
        raise OutputError(
            f"{out} exists and is not a terrain-forge world; remove it or choose another with -o"
        )
    if (out / NAME).is_file():
        read_manifest(out)


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A temporary folder of the same name that takes the target's place when the block ends well.

    It lies in a sibling folder. An older target is set aside until then. Leftovers of builds that
    were killed are cleared away.
    """
    target = target.absolute()
    around = target.with_name(f".{target.name}.new-{os.getpid()}")
    fresh = around / target.name
    aside = target.with_name(f".{target.name}.old-{os.getpid()}")
    _clear_leftovers(target)
    try:
        _make(around)
        fresh.mkdir()
        yield fresh
        if target.exists():
            target.rename(aside)
        fresh.rename(target)
    except BaseException:
        shutil.rmtree(around, ignore_errors=True)
        if aside.exists() and not target.exists():
            aside.rename(target)
        raise
    around.rmdir()
    shutil.rmtree(aside, ignore_errors=True)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise OutputError(f"{folder.parent} cannot be written: {error.strerror}") from None


def _clear_leftovers(target: Path) -> None:
    """Remove what killed builds of this target left; bring back a world that one had set aside."""
    for kind in ("new", "old"):
        for left in sorted(target.parent.glob(f".{escape(target.name)}.{kind}-*")):
            process = left.name.rpartition("-")[2]
            if process.isdigit() and Path(f"/proc/{process}").exists():
                continue
            if kind == "old" and not target.exists():
                left.rename(target)
            else:
                shutil.rmtree(left, ignore_errors=True)
