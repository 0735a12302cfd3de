"""Every export of a built world through every consumer of it that can be run here."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.model import World
from terrain_forge.recipe import export_orders
from terrain_forge.validation.conformance.consumer import Consumer, NotRun
from terrain_forge.validation.conformance.drake import DRAKE
from terrain_forge.validation.conformance.entry import Entry, Status
from terrain_forge.validation.conformance.gazebo import GAZEBO
from terrain_forge.validation.conformance.measures import BALL_LIMIT, Export, measure
from terrain_forge.validation.conformance.mesh_files import GLB, MESHES
from terrain_forge.validation.conformance.mujoco_reading import MUJOCO
from terrain_forge.validation.conformance.newton import NEWTON_MJCF, NEWTON_USD
from terrain_forge.validation.conformance.rasters import GDAL
from terrain_forge.validation.conformance.reading import Reading
from terrain_forge.validation.conformance.sample import Sample, draw_sample
from terrain_forge.validation.conformance.tracks import PATHS
from terrain_forge.validation.conformance.usd_reading import OPENUSD

CONSUMERS = (*(MUJOCO, NEWTON_MJCF, OPENUSD, NEWTON_USD, GAZEBO, DRAKE, GLB, MESHES, GDAL, PATHS),)
"""All consumers, those of a format one after another."""

_log = logging.getLogger(__name__)
_FILES = {
    "mjcf": ("world.xml",),
    "usd": ("world.usda", "world.usdc"),
    "drake": ("package.xml",),
    "sdf": ("world.sdf",),
    "glb": ("world.glb",),
    "mesh": ("*.obj", "*.stl", "*.ply"),
    "geotiff": ("*.tif",),
}
"""What tells a format's folder, the first that fits."""
_SCALE_ERRORS = {"mjcf": 0.01}
"""What formats round the sizes of rocks by, at the most."""
_DRAWN_LEVELS = {"mjcf": 1}
"""Levels of detail by which formats draw rocks, whatever their options."""


def conformance(
    world: World,
    directory: Path,
    *,
    points: int,
    progress: Callable[[float], None] | None = None,
) -> list[Entry]:
    """Measure every export in a built folder through its consumers.

    What a consumer has to say besides is kept in `directory`/validation/consumers.

    Args:
        world: The world.
        directory: Its built folder.
        points: Random points at which the ground is compared.
        progress: Told the share of the exports that are done, 0 to 1.
    """
    sample = draw_sample(world, points=points)
    scratch = directory / "validation" / "consumers"
    entries: list[Entry] = []
    rests: list[NDArray[np.float64]] = []
    exports = list(exports_in(world, directory))
    for number, export in enumerate(exports):
        if progress:
            progress(number / len(exports))
        for consumer in CONSUMERS:
            if export.kind in consumer.kinds:
                own = scratch / export.folder
                own.mkdir(parents=True, exist_ok=True)
                found, reading = measured(sample, export, consumer, directory, own)
                entries += found
                if reading and reading.balls is not None and not reading.quantum:
                    rests.append(reading.balls)
    return [*entries, *_engines_apart(rests)]


def exports_in(world: World, directory: Path) -> Iterator[Export]:
    """The exports that lie in a built folder, by name, and its paths where it has any."""
    orders = {order.folder: order for order in export_orders(world.site.recipe)}
    folders = [*sorted(directory.glob("*/")), *sorted(directory.glob("validation/mjcf/"))]
    for folder in folders:
        name = folder.relative_to(directory).as_posix()
        order = orders.get(name)
        kind = order.kind if order else _kind(folder)
        if kind:
            error = getattr(order.options, "outline_error", 0.0) if order else _default(kind)
            yield Export(
                folder=name,
                kind=kind,
                outline_error=float(error),
                scale_error=_SCALE_ERRORS.get(kind, 0.0),
                drawn_level=_DRAWN_LEVELS.get(kind, 0),
            )
    if world.trajectories:
        yield Export(folder="paths", kind="paths", outline_error=0.0)


def _kind(folder: Path) -> str:
    """The format of a folder that the recipe does not name."""
    if folder.name in ("world", "truth", "paths", "validation", "dataset"):
        return ""
    return next((kind for kind, files in _FILES.items() if _has(folder, files)), "")


def _has(folder: Path, patterns: tuple[str, ...]) -> bool:
    return any(next(folder.glob(pattern), None) for pattern in patterns)


def _default(kind: str) -> float:
    from terrain_forge.model import exporter

    return float(getattr(exporter(kind).Options(), "outline_error", 0.0))


def measured(
    sample: Sample, export: Export, consumer: Consumer, directory: Path, scratch: Path
) -> tuple[list[Entry], Reading | None]:
    """The entries of an export in a consumer, and what it made of it where it could be run."""
    status: Status = "fail"
    try:
        reading = consumer.read(sample, directory / export.folder, scratch)
        return measure(sample, export, reading), reading
    except NotRun as reason:
        status, note = "not run", str(reason)
    except Exception as error:  # each consumer has its own; an export that it cannot read fails
        _log.debug("%s in %s", export.folder, consumer.name, exc_info=True)
        note = f"cannot be read: {' '.join(str(error).split())}"
    only = Entry(
        export=export.folder, kind=export.kind, consumer=consumer.name, aspect="", status=status,
        note=note,
    )  # fmt: skip
    return [only], None


def _engines_apart(rests: list[NDArray[np.float64]]) -> list[Entry]:
    """How far apart the same balls rest in the engines that have physics."""
    if len(rests) < 2 or not len(rests[0]):
        return []
    apart = float(np.ptp(np.array(rests), axis=0).max())
    return [
        Entry(
            export="all", kind="", consumer=f"{len(rests)} engines", aspect="balls",
            status="pass" if apart <= BALL_LIMIT else "fail", figure=apart, unit="m",
            limit=BALL_LIMIT, note="largest difference of where a ball rests",
        )
    ]  # fmt: skip
