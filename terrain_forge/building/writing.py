"""Writing a world's files: its exports, truth, paths, picture, and the world itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from terrain_forge.base import (
    ExportError,
    PluginError,
    Stopwatch,
    first_odd,
    in_turn,
    is_ours,
    returning,
    staying,
    worker_threads,
)
from terrain_forge.model import (
    RESERVED,
    Export,
    Exporter,
    ExportReport,
    World,
    html_picture,
    plain_options,
    prepare,
)
from terrain_forge.recipe import ExportOrder


@dataclass(frozen=True, kw_only=True)
class BuildResult:
    """What a build left behind."""

    directory: Path
    """The output folder."""
    world: World
    """The world that is in it."""
    passed: bool
    """Whether every validation check passed."""
    removed: tuple[str, ...] = ()
    """Files of others that lay in the older world and went with it, a recording as one of them."""
    exports: tuple[Export, ...]
    """What was exported: folder, exporter, options, and what the export cannot say."""

    def __repr__(self) -> str:
        verdict = "all checks passed" if self.passed else "some checks failed, see report.html"
        exports = ", ".join(export.folder for export in self.exports) or "no export"
        return f"<BuildResult {str(self.directory)!r}: {verdict}; {exports}>"

    def _repr_html_(self) -> str:
        picture = self.directory / "preview.png"
        return html_picture(repr(self), picture.read_bytes() if picture.is_file() else b"")


def write_files(
    world: World, directory: Path, *, orders: tuple[ExportOrder, ...], watch: Stopwatch
) -> tuple[Export, ...]:
    """Write the world, its exports, truth, paths and picture; returns the exports.

    None of them needs another, so they go side by side: kernels and the file system leave Python's
    lock to the others.
    """
    from terrain_forge.paths import write_trajectories
    from terrain_forge.scene import write_preview
    from terrain_forge.truth import write_truth

    for order in orders:
        prepare(order.exporter, order.options)
    # The picture first: its rays leave Python's lock to the exports.
    tasks: dict[str, Callable[[], Any]] = {
        "preview": partial(write_preview, world, directory / "preview.png"),
        **{
            f"export {order.folder}": partial(write_export, world, directory, order)
            for order in orders
        },
        "truth": partial(write_truth, world, directory),
        "path files": partial(write_trajectories, world.trajectories, directory / "paths"),
        "world": partial(world.save, directory),
    }
    with staying(f"an exporter ({_theirs(orders)})"):
        results = _side_by_side(tasks, watch)
    _require_inside(directory, orders)
    return tuple(results[f"export {order.folder}"] for order in orders)


def _theirs(orders: tuple[ExportOrder, ...]) -> str:
    """The modules of exporters of other packages."""
    modules = [getattr(order.exporter, "__name__", order.kind) for order in orders]
    return ", ".join(module for module in modules if not is_ours(module))


def _require_inside(directory: Path, orders: tuple[ExportOrder, ...]) -> None:
    """Refuse what an exporter wrote beside its folder, which no list tells.

    Raises:
        PluginError: names the modules of other packages.
    """
    known = RESERVED | {order.folder for order in orders}
    if odd := sorted({path.name for path in directory.iterdir()} - known):
        raise PluginError(f"an exporter ({_theirs(orders)}) wrote {odd[0]} beside its folder")


def _side_by_side(tasks: dict[str, Callable[[], Any]], watch: Stopwatch) -> dict[str, Any]:
    """Results of tasks that run two at a time; the first that fails cancels those not begun."""
    with worker_threads(2) as pool:
        futures = {name: pool.submit(watch.timed, name, task) for name, task in tasks.items()}
        watch(f"writing: {', '.join([*tasks][:2])}")
        for done, future in enumerate(in_turn(futures.values()), 1):
            future.result()
            others = [name for name, other in futures.items() if not other.done()]
            watch(f"writing: {', '.join(others[:2])}", done / len(futures))
    return {name: future.result() for name, future in futures.items()}


def write_export(world: World, directory: Path, order: ExportOrder) -> Export:
    """Write one export into its folder of `directory`.

    Raises:
        ExportError: if the format cannot hold the world with these options.
        PluginError: if the exporter returns what it may not, or leaves a link in its folder.
    """
    folder = directory / order.folder
    folder.mkdir(parents=True)
    try:
        what = f"exporter {order.kind!r}: export"
        with returning(order.exporter, what, "an ExportReport of the files that it wrote"):
            report = order.exporter.export(world, folder, options=order.options)
            if not isinstance(report, ExportReport):
                raise TypeError(f"found {type(report).__name__}")
            if isinstance(report.losses, str):
                raise TypeError(f"found the text {report.losses[:40]!r} for its losses")
            losses = tuple(map(str, report.losses))
            if odd := [str(file) for file in report.files if not _is_within(folder, file)]:
                raise ValueError(f"found {odd[0]}, which is no file in its folder")
    except ExportError as error:
        raise ExportError(str(error), key=("exports", order.folder, *error.key)) from None
    require_plain(order.exporter, order.kind, folder)
    return Export(
        folder=order.folder,
        kind=order.kind,
        options=plain_options(order.options),
        losses=losses,
    )


def require_plain(exporter: Exporter, kind: str, folder: Path) -> None:
    """Refuse what an exporter has left in its folder that is no plain file or folder.

    Raises:
        PluginError: names it.
    """
    if odd := first_odd(folder):
        raise PluginError(f"{exporter_words(exporter, kind)} left {odd} in its folder")


def exporter_words(exporter: Exporter, kind: str) -> str:
    """An exporter and its module."""
    return f"exporter {kind!r} ({getattr(exporter, '__name__', kind)})"


def _is_within(folder: Path, file: Path) -> bool:
    """Whether a name in a folder is a file there, not a link to one elsewhere."""
    path = folder / file
    return path.is_file() and path.resolve() == folder.resolve() / file
