"""What is to be measured, and how it is, side by side."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np

from terrain_forge.base import in_turn, returning, worker_threads
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.index import file_name, recorded_spans, require_told
from terrain_forge.recording.order import Order, Spans, joined, within
from terrain_forge.recording.rig import Folder, folders_of
from terrain_forge.recording.store import Store
from terrain_forge.sensors import (
    Frames,
    Series,
    Setting,
    check_mounts,
    instruments_of,
    require_carried,
)

_MEASURED = "the bytes of a file for each of its streams"
_AHEAD = 2
"""Measurements that wait to be written, for each that is made."""


class Task(NamedTuple):
    """A measurement that is to be made."""

    folder: Folder
    """Where its files go."""
    number: int
    """Of the folder's measurements."""

    def measure(self) -> dict[str, bytes]:
        """Its files' contents by the names of their streams, judged.

        Raises:
            PluginError: if another package's instrument returns anything else.
        """
        instrument, wanted = cast(Frames, self.folder.instrument), {*self.folder.streams}
        with returning(instrument, f"instrument {instrument.kind!r}: measure", _MEASURED):
            made = instrument.measure(self.number * self.folder.every)
            if {*made} != wanted:
                raise ValueError(f"found {sorted(map(str, made))}, and its streams are {wanted}")
            for name, content in made.items():
                if not isinstance(content, bytes | bytearray | memoryview):
                    raise TypeError(f"found {type(content).__name__} for {name!r}")
        return made

    @property
    def names(self) -> dict[str, str]:
        """Its files by the names of the instrument's streams."""
        at = int(self.folder.times[self.number])
        return {stream: file_name(self.folder, stream, at) for stream in self.folder.streams}


@dataclass(frozen=True, kw_only=True)
class Work:
    """What a recording has to do."""

    spec: DatasetSpec
    """How it is recorded."""
    order: Order
    """Which part of it is asked for."""
    setting: Setting
    """In what is measured."""
    rig: Sequence[Folder]
    """The folders of the whole rig."""
    anew: bool
    """Whether what is there goes."""
    tasks: Sequence[Task]
    """What is to be measured."""
    chosen: Sequence[Folder]
    """The folders that are asked for."""
    spans: Mapping[str, Spans]
    """What will be there in the end, by the sensors' names."""

    @property
    def folders(self) -> list[Folder]:
        """The folders that will be there in the end."""
        return [one for one in self.rig if one.sensor.name in self.spans]


def work_of(setting: Setting, store: Store, *, spec: DatasetSpec, order: Order, anew: bool) -> Work:
    """What is asked for and not there.

    Raises:
        OutputError: for a sensor that does not exist, or measures nothing in the time.
        RecipeError: if one cannot measure where it is.
    """
    rig = folders_of(instruments_of(setting), quick=spec.profile == "quick")
    chosen = order.chosen(rig, setting.world.rover.sensors)
    for one in chosen:
        require_carried(one.sensor, setting.world.rover)
    check_mounts(setting, [one.sensor for one in chosen if not one.is_table])
    for one in chosen:
        if isinstance(one.instrument, Series) and setting.motion.source == "drive":
            one.instrument.require_logged(one.sensor, setting.motion.base.step)
        one.instrument.check()
        require_told(one)
    order.require_some(chosen, setting.motion)
    spans = {} if anew else recorded_spans(store)
    for name in (one.sensor.name for one in chosen):
        spans[name] = joined((*spans.get(name, ()), order.span))
    names = [one.sensor.name for one in rig]
    spans = {name: spans[name] for name in names if name in spans}  # whoever was recorded first
    tasks = missing(chosen, order, None if anew else store)
    return Work(
        spec=spec, order=order, setting=setting, rig=rig, anew=anew, tasks=tasks, chosen=chosen,
        spans=spans,
    )  # fmt: skip


def missing(folders: Sequence[Folder], order: Order, store: Store | None) -> list[Task]:
    """The measurements that are asked for and are not there, in the order of their times.

    Args:
        folders: Where they go.
        order: Which times.
        store: What is there; None for nothing.
    """
    rows = [_missing_of(one, order, store) for one in folders if not one.is_table]
    return [task for _, task in heapq.merge(*rows, key=lambda pair: pair[0])]


def _missing_of(folder: Folder, order: Order, store: Store | None) -> Iterator[tuple[int, Task]]:
    """Of one folder, with their times [ns]."""
    times = folder.times
    for number in np.flatnonzero(within(times, (order.span,))).tolist():
        task = Task(folder, number)
        if store is None or not all(map(store.holds, task.names.values())):
            yield int(times[number]), task


def measured(tasks: Sequence[Task], workers: int) -> Generator[tuple[Task, dict[str, bytes]]]:
    """Tasks with their files, in order; `workers` are made at once, and only some wait.

    They are threads: all measure in one scene, which compiled code does without Python's lock.
    """
    waiting: deque[tuple[Task, Future[dict[str, bytes]]]] = deque()
    with worker_threads(workers) as pool:
        for task in tasks:
            waiting.append((task, pool.submit(task.measure)))
            if len(waiting) >= _AHEAD * workers:
                yield _done(*waiting.popleft())
        while waiting:
            yield _done(*waiting.popleft())


def _done(task: Task, future: Future[dict[str, bytes]]) -> tuple[Task, dict[str, bytes]]:
    for done in in_turn([future]):
        return task, done.result()
    raise AssertionError("a task that is waited for ends")
