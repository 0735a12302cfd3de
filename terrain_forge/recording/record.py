"""Recording: order ─► setting ─► instruments ─► measurements, side by side ─► files ─► index."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from terrain_forge.base import (
    Stopwatch,
    compile_ahead,
    processors,
    require_unlinked,
    size_text,
    telling_interrupts,
)
from terrain_forge.building import holding, learn
from terrain_forge.model import World
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.cost import measurement_cost, seconds_of
from terrain_forge.recording.early import require_formats, require_rig
from terrain_forge.recording.formats import formats_of, stale_formats, write_formats
from terrain_forge.recording.index import dataset_folder, write_index
from terrain_forge.recording.order import Order
from terrain_forge.recording.plan import PLAN, differences, plan_of, plan_text, require_same
from terrain_forge.recording.rehearsal import rehearse
from terrain_forge.recording.setting import (
    open_setting,
    tell_unmeasured,
    with_path,
    with_rig,
)
from terrain_forge.recording.store import Store
from terrain_forge.recording.task import Work, measured, work_of

RECORDING = ("load", "compile", "scene", "rehearsal", "recording", "tables", "formats")
"""Stages of a recording."""
_TELLING = 5.0
"""What a recording must take to teach the next estimate [s]: the first measurements are slow."""


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """What a recording left behind."""

    folder: Path
    """The dataset's folder."""
    made: int
    """Measurements with files of their own that were made now."""
    streams: dict[str, int]
    """Measurements that are there, by the sensors' folders."""
    size: int
    """Bytes of it all."""
    losses: dict[str, tuple[str, ...]]
    """What further formats that were written now cannot say."""
    stale: tuple[str, ...]
    """A sentence on each format that is of an earlier state of the recording."""

    def __repr__(self) -> str:
        streams = ", ".join(f"{name} {count:,}" for name, count in self.streams.items())
        return f"<Recorded {str(self.folder)!r}: {streams}; {size_text(self.size)}>"


def record_dataset(
    world: World, out: Path, spec: DatasetSpec, order: Order, watch: Stopwatch
) -> Recorded:
    """Record what a world's rover measures into `out`/dataset, or what of it is missing there.

    Args:
        world: The world.
        out: The world's folder, or any.
        spec: How it is recorded.
        order: Which part.
        watch: Told of stages and of the share that is done.

    Raises:
        RecipeError, DataError: if it cannot be recorded.
        OutputError: if the folder holds another recording or is a link, or another process writes
            there.
        StorageError: if the disk does not take it.
        KeyboardInterrupt: with how far it came.
    """
    order.require()
    spec = with_path(world, spec.sound())
    formats = formats_of(spec)
    folder = dataset_folder(out)
    require_unlinked(out, folder.name)
    rigged = with_rig(world, spec)
    order.require_named(rigged.rover.sensors)
    if order.all_formats:
        require_formats(spec, rigged.rover)
    require_rig(spec, rigged.rover)
    plan = plan_of(rigged, spec)
    differing = differences(folder, plan)
    if not order.force:
        require_same(folder, differing)
    with holding(out):
        compile_ahead(watch, purpose="record")
        watch("scene")
        with open_setting(world, spec, progress=watch) as setting, Store(folder) as store:
            tell_unmeasured(setting)
            if not (folder / PLAN).exists() and store.size:
                differing = [f"no {PLAN}"]
                require_same(folder, [] if order.force else differing)
            work = work_of(setting, store, spec=spec, order=order, anew=bool(differing))
            watch("rehearsal")
            lacking = rehearse(work, store, formats)
            formats = {name: how for name, how in formats.items() if name not in lacking}
            if work.anew:
                store.clear()
            if not store.holds(PLAN):
                store.put(PLAN, plan_text(plan))
            _measure_all(store, work, watch)
            with telling_interrupts(lambda: _left(store, len(work.tasks), len(work.tasks))):
                streams = write_index(store, setting, work.rig, spec=spec, spans=work.spans)
                losses = write_formats(store, formats, watch)
                losses |= {name: (f"not made: {why}",) for name, why in lacking.items()}
                store.settle()
            return Recorded(
                folder=folder,
                made=len(work.tasks),
                streams=streams,
                size=store.size,
                losses=losses,
                stale=stale_formats(store),
            )


def _left(store: Store, count: int, whole: int) -> str:
    """What an interrupt leaves behind."""
    told = f"{count:,} of {whole:,} missing measurements are in {store.folder} now"
    return f"{told}: the same command goes on from there"


def _measure_all(store: Store, work: Work, watch: Stopwatch) -> None:
    """Make measurements side by side, write each as a whole, and note how long it took."""
    tasks, workers = work.tasks, work.order.workers or processors()
    costs = [measurement_cost(task.folder.sensor)[0] for task in tasks]
    whole, done = sum(costs), 0.0
    expected = {"recording": seconds_of(((one.folder.sensor, 1) for one in tasks), workers)}
    watch.expect(expected)
    watch("recording")
    since = time.monotonic()
    count = 0

    with (
        telling_interrupts(lambda: _left(store, count, len(tasks))),
        closing(measured(tasks, workers)) as made,
    ):
        for task, files in made:
            for stream, name in task.names.items():
                store.put(name, files[stream])
            done += costs[count]
            count += 1
            rate = count / max(time.monotonic() - since, 1e-9)
            text = f"recording: {count:,} of {len(tasks):,}, {rate:.3g} a second"
            watch(text, done / whole if whole else 1.0)
        watch("tables")
        if expected["recording"] > _TELLING:
            learn(expected, watch.seconds, watch.work)
