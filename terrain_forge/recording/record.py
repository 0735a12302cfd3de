"""Recording: order ─► setting ─► instruments ─► measurements, side by side ─► files ─► index."""

from __future__ import annotations

import heapq
import os
import shutil
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from terrain_forge.base import Stopwatch, StorageError, size_text
from terrain_forge.building import holding
from terrain_forge.model import World
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.cost import measurement_cost, seconds_of
from terrain_forge.recording.formats import formats_of, write_formats
from terrain_forge.recording.index import (
    dataset_folder,
    file_name,
    recorded_spans,
    write_index,
)
from terrain_forge.recording.order import Order, Spans, joined, within
from terrain_forge.recording.plan import PLAN, differences, plan_of, plan_text, require_same
from terrain_forge.recording.rig import Folder, folders_of
from terrain_forge.recording.setting import (
    checked,
    open_setting,
    tell_unmeasured,
    with_path,
    with_rig,
)
from terrain_forge.recording.store import Store
from terrain_forge.sensors import Frames, check_mounts, instruments_of

RECORDING = ("load", "scene", "recording", "tables", "formats")
"""Stages of a recording."""
_SPARE = 2**24
"""Bytes of a disk that are left free."""
_AHEAD = 2
"""Measurements that wait to be written, for each that is made."""


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

    def __repr__(self) -> str:
        streams = ", ".join(f"{name} {count:,}" for name, count in self.streams.items())
        return f"<Recorded {str(self.folder)!r}: {streams}; {size_text(self.size)}>"


class Task(NamedTuple):
    """A measurement that is to be made."""

    folder: Folder
    """Where its files go."""
    number: int
    """Of the folder's measurements."""

    @property
    def instrument(self) -> Frames:
        """What makes it."""
        return cast(Frames, self.folder.instrument)

    def measure(self) -> dict[str, bytes]:
        """Its files' contents by the names of their streams."""
        return self.instrument.measure(self.number * self.folder.every)

    @property
    def names(self) -> dict[str, str]:
        """Its files by the names of their streams."""
        at = int(self.folder.times[self.number])
        return {stream: file_name(self.folder, stream, at) for stream in self.folder.streams}


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
        OutputError: if the folder holds another recording, or another process writes there.
        StorageError: if the disk does not take it.
        KeyboardInterrupt: with how far it came.
    """
    order.require()
    spec = with_path(world, checked(spec))
    formats = formats_of(spec)
    folder = dataset_folder(out)
    plan = plan_of(with_rig(world, spec), spec)
    differing = differences(folder, plan)
    if not order.force:
        require_same(folder, differing)
    with holding(out):
        watch("scene")
        with open_setting(world, spec) as setting, Store(folder) as store:
            tell_unmeasured(setting)
            folders = folders_of(instruments_of(setting), quick=spec.profile == "quick")
            chosen = order.chosen(folders, world.rover.sensors)
            check_mounts(setting, [one.sensor for one in chosen if not one.is_table])
            for one in chosen:
                one.instrument.check()
            order.require_some(chosen, setting.motion)
            if not (folder / PLAN).exists() and store.size:
                differing = [f"no {PLAN}"]
                require_same(folder, [] if order.force else differing)
            anew = bool(differing)
            tasks = _missing(chosen, order, None if anew else store)
            watch("recording: first measurements")
            _require_room(store, tasks, chosen, order, gained=store.size if anew else 0)
            if anew:
                store.clear()
            if not store.holds(PLAN):
                store.put(PLAN, plan_text(plan))
            _measure_all(store, tasks, order, watch)
            watch("tables")
            spans = recorded_spans(store)
            for one in chosen:
                spans[one.sensor.name] = _with(spans.get(one.sensor.name, ()), order)
            streams = write_index(store, setting, folders, spec=spec, spans=spans)
            losses = write_formats(store, formats, watch)
            store.settle()
            return Recorded(
                folder=folder, made=len(tasks), streams=streams, size=store.size, losses=losses
            )


def _with(spans: Spans, order: Order) -> Spans:
    return joined((*spans, order.span))


def _missing(folders: Sequence[Folder], order: Order, store: Store | None) -> list[Task]:
    """The measurements that are asked for and are not there, in the order of their times."""
    rows = [_tasks(one, order, store) for one in folders if not one.is_table]
    return [task for _, task in heapq.merge(*rows, key=lambda pair: pair[0])]


def _tasks(folder: Folder, order: Order, store: Store | None) -> Iterator[tuple[int, Task]]:
    """Of one instrument, with their times [ns]."""
    times = folder.times
    for number in np.flatnonzero(within(times, (order.span,))).tolist():
        task = Task(folder, number)
        if store is None or not all(map(store.holds, task.names.values())):
            yield int(times[number]), task


def _require_room(
    store: Store, tasks: Sequence[Task], chosen: Sequence[Folder], order: Order, *, gained: int
) -> None:
    """Refuse a disk that is too small, by a first measurement of each instrument.

    Args:
        store: The recording's folder.
        tasks: What is to be made.
        chosen: The folders of all that measure.
        order: When they do.
        gained: Bytes that go before.

    Raises:
        StorageError: says what is needed.
    """
    sizes: dict[str, int] = {}
    for task in tasks:
        if task.folder.name not in sizes:
            files = task.measure()
            sizes[task.folder.name] = sum(map(len, files.values()))
    needed = sum(sizes[task.folder.name] for task in tasks)
    for one in chosen:
        if one.is_table:
            rows = int(within(one.times, (order.span,)).sum())
            needed += round(rows * measurement_cost(one.sensor)[1])
    place = next(above for above in (store.folder, *store.folder.parents) if above.exists())
    free = shutil.disk_usage(place).free + gained
    if needed + _SPARE > free:
        raise StorageError(
            f"{store.folder} cannot be written: what is missing needs about {size_text(needed)}, "
            f"the disk has {size_text(free)} free; record less by --only, --from, --to or --quick"
        )


def _measure_all(store: Store, tasks: Sequence[Task], order: Order, watch: Stopwatch) -> None:
    """Make measurements side by side, and write each as a whole."""
    costs = [seconds_of(task.instrument.sensor) for task in tasks]
    whole, done = sum(costs), 0.0
    watch.expect({"recording": whole})
    watch("recording")
    workers = order.workers or os.cpu_count() or 1
    since = time.monotonic()
    count = 0
    try:
        with closing(_measured(tasks, workers)) as made:
            for task, files in made:
                for stream, name in task.names.items():
                    store.put(name, files[stream])
                done += costs[count]
                count += 1
                rate = count / max(time.monotonic() - since, 1e-9)
                text = f"recording: {count:,} of {len(tasks):,}, {rate:.3g} a second"
                watch(text, done / whole if whole else 1.0)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"{count:,} of {len(tasks):,} measurements are in {store.folder}: the same command "
            "goes on from there"
        ) from None


def _measured(tasks: Sequence[Task], workers: int) -> Generator[tuple[Task, dict[str, bytes]]]:
    """Tasks with their files, in order; only some wait at a time."""
    waiting: deque[tuple[Task, Future[dict[str, bytes]]]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        try:
            for task in tasks:
                waiting.append((task, pool.submit(task.measure)))
                if len(waiting) >= _AHEAD * workers:
                    first, future = waiting.popleft()
                    yield first, future.result()
            while waiting:
                first, future = waiting.popleft()
                yield first, future.result()
        finally:
            for _, future in waiting:
                future.cancel()
