"""Every export of a built world through its consumers: quickly in a build, in full later."""

from __future__ import annotations

import ctypes
import logging
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    FOREIGN_FAILURES,
    PluginError,
    RecipeError,
    failure_words,
    staying,
    worker_threads,
)
from terrain_forge.model import Check, Export, World
from terrain_forge.validation.consumer import Consumer, NotRun
from terrain_forge.validation.inspection import leaving, not_opened
from terrain_forge.validation.measures import (
    ASPECTS,
    BALL_LIMIT,
    Entry,
    Status,
    measure,
    replay_checks,
)
from terrain_forge.validation.reading import Reading
from terrain_forge.validation.sample import Sample, draw_sample
from terrain_forge.validation.tracks import PATHS

_log = logging.getLogger(__name__)
_QUICK = {
    "": "reading",
    "ground": "ground",
    "rock tops": "rocks",
    "masses": "dynamic rocks",
    "gravity": "gravity",
}
"""What a build compares, and what its checks are called."""


def quick_checks(
    world: World,
    directory: Path,
    exports: Sequence[Export],
    *,
    points: int,
    altered: Sequence[str] = (),
) -> list[Check]:
    """Compare each export with the world as its quick consumers read it, at random points.

    An export with an altered file is not opened, and fails.
    """
    sample = draw_sample(world, points=points, quick=True)
    quick = [(e, c, o) for e in exports for c, o in consumers(e) if c.quick]
    with staying("what reads an export back"), worker_threads(2) as pool:
        found = pool.map(lambda one: _quickly(sample, directory, *one, altered), quick)
        return [check for checks in found for check in checks]


def _quickly(
    sample: Sample,
    directory: Path,
    export: Export,
    consumer: Consumer,
    options: Any,
    altered: Sequence[str],
) -> list[Check]:
    name = Path(export.folder).name
    with tempfile.TemporaryDirectory() as scratch:
        entries, reading = read(
            sample, directory, export, consumer, options, Path(scratch), altered=altered
        )
    checks = [
        check.replace(name=f"{name}: {_QUICK[entry.aspect]}")
        for entry in entries
        if (check := entry.check)
    ]
    replays = reading.replays if reading else ()
    return [*checks, *replay_checks(f"{name}: paths between samples", replays)]


def conformance(
    world: World,
    directory: Path,
    exports: Sequence[Export],
    *,
    points: int,
    altered: Sequence[str] = (),
    progress: Callable[[float], None] | None = None,
) -> list[Entry]:
    """Measure each export in all of its consumers, at so many random points, and the world's paths.

    An export with an altered file is not opened, and fails.
    What a consumer has to say besides is kept in `directory`/validation/consumers; `progress` is
    told the share of the exports that are done, 0 to 1.
    """
    sample = draw_sample(world, points=points)
    readings = [(export, consumers(export)) for export in exports]
    if world.trajectories:
        paths = Export(folder="paths", kind="paths", options={})
        readings.append((paths, [(PATHS, None)]))
    entries: list[Entry] = []
    rests: list[NDArray[np.float64]] = []
    for number, (export, readers) in enumerate(readings):
        if progress:
            progress(number / len(readings))
        for consumer, options in readers:
            if consumer.full:
                scratch = directory / "validation" / "consumers" / export.folder
                scratch.mkdir(parents=True, exist_ok=True)
                found, reading = read(
                    sample, directory, export, consumer, options, scratch, altered=altered
                )
                entries += found
                if reading and reading.balls is not None and not reading.quantum:
                    rests.append(reading.balls)
                del reading
                _give_back()
    return [*entries, *_engines_apart(rests)]


def _give_back() -> None:
    """Give what is free of a consumer's memory to the next: glibc would keep most of it."""
    with suppress(OSError, AttributeError, TypeError):  # other systems have other libraries
        ctypes.CDLL(None).malloc_trim(0)


def consumers(export: Export) -> list[tuple[Consumer, Any]]:
    """What an export's exporter offers to read it back, with the export's options.

    None, with a warning, where the exporter is gone.
    """
    try:
        module, options = export.opened()
    except RecipeError as error:
        _warn_once(export.folder, str(error))
        return []
    return [(consumer, options) for consumer in getattr(module, "CONSUMERS", ())]


@cache
def _warn_once(folder: str, why: str) -> None:
    _log.warning("export %s is not read back: %s", folder, why)


def read(
    sample: Sample,
    directory: Path,
    export: Export,
    consumer: Consumer,
    options: Any,
    scratch: Path,
    *,
    altered: Sequence[str] = (),
) -> tuple[list[Entry], Reading | None]:
    """The entries of an export in a consumer, and what it made of it where it could be run."""
    status: Status = "fail"
    blank = Entry(
        export=export.folder, kind=export.kind, consumer=consumer.name, aspect="", status="pass"
    )
    if why := not_opened(export.folder, altered):
        return [replace(blank, status=status, note=why)], None
    module, folder = getattr(consumer.read, "__module__", ""), directory / export.folder
    try:
        with leaving(f"consumer {consumer.name!r} ({module})", module, folder, added=True):
            reading = consumer.read(sample, folder, options, scratch)
        aspects = tuple(filter(None, _QUICK)) if sample.quick else ASPECTS
        return measure(sample, blank, reading, aspects), reading
    except PluginError:
        raise
    except NotRun as reason:
        status, note = "not run", str(reason)
    except FOREIGN_FAILURES as error:  # of its own; an export that it cannot read fails
        _log.debug("%s in %s", export.folder, consumer.name, exc_info=True)
        note = f"cannot be read: {failure_words(error)}"
    return [replace(blank, status=status, note=note)], None


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
