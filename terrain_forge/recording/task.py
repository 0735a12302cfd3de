"""Measurements that are to be made, and how they are, side by side."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import Future
from typing import NamedTuple, cast

import numpy as np

from terrain_forge.base import in_turn, worker_threads
from terrain_forge.recording.index import file_name
from terrain_forge.recording.order import Order, within
from terrain_forge.recording.rig import Folder
from terrain_forge.recording.store import Store
from terrain_forge.sensors import Frames

_AHEAD = 2
"""Measurements that wait to be written, for each that is made."""


class Task(NamedTuple):
    """A measurement that is to be made."""

    folder: Folder
    """Where its files go."""
    number: int
    """Of the folder's measurements."""

    def measure(self) -> dict[str, bytes]:
        """Its files' contents by the names of their streams."""
        instrument = cast(Frames, self.folder.instrument)
        return instrument.measure(self.number * self.folder.every)

    @property
    def names(self) -> dict[str, str]:
        """Its files by the names of the instrument's streams."""
        at = int(self.folder.times[self.number])
        return {stream: file_name(self.folder, stream, at) for stream in self.folder.streams}


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
