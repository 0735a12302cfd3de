"""A rehearsal: one measurement of each sensor tells what all take, and if formats can be had."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from terrain_forge.base import StorageError, size_text
from terrain_forge.datasets import checked_options, dataset_kind, open_recording
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.cost import measurement_cost
from terrain_forge.recording.index import write_index
from terrain_forge.recording.order import Order, Spans, within
from terrain_forge.recording.rig import Folder
from terrain_forge.recording.store import Store
from terrain_forge.recording.task import Task
from terrain_forge.sensors import NANOSECONDS, Setting

_SPARE = 2**24
"""Bytes of a disk that are left free."""
_LENGTH = NANOSECONDS
"""Time of the tables of a rehearsal [ns]."""


def first_measurements(
    folders: Iterable[Folder], order: Order
) -> list[tuple[Task, dict[str, bytes]]]:
    """The first measurement that each folder would have, with its files."""
    found = []
    for folder in folders:
        if not folder.is_table:
            number = int(np.argmax(within(folder.times, (order.span,))))
            task = Task(folder, number)
            found.append((task, task.measure()))
    return found


def require_formats(
    formats: Mapping[str, Mapping[str, Any]],
    firsts: Sequence[tuple[Task, dict[str, bytes]]],
    setting: Setting,
    folders: Sequence[Folder],
    *,
    spec: DatasetSpec,
    names: Iterable[str],
    begin: int,
) -> None:
    """Refuse formats that lack something in a recording, by one of the first measurements alone.

    Args:
        formats: The formats and their options.
        firsts: A measurement of each folder.
        setting: In what is measured.
        folders: Those of the whole rig.
        spec: How it is recorded.
        names: The sensors that are recorded.
        begin: From when [ns].

    Raises:
        ExportError: says what a format lacks.
    """
    if not formats:
        return
    with TemporaryDirectory() as place, Store(Path(place)) as store:
        for task, files in firsts:
            for stream, name in task.names.items():
                store.put(name, files[stream])
        spans: dict[str, Spans] = {name: ((begin, begin + _LENGTH),) for name in names}
        write_index(store, setting, folders, spec=spec, spans=spans)
        recording = open_recording(store.folder)
        for name, options in formats.items():
            dataset_kind(name)().check(recording, checked_options(name, options))


def require_room(
    store: Store,
    tasks: Sequence[Task],
    firsts: Sequence[tuple[Task, dict[str, bytes]]],
    tables: Iterable[Folder],
    order: Order,
    *,
    formats: int,
    gained: int,
) -> None:
    """Refuse a disk that is too small.

    Args:
        store: The recording's folder.
        tasks: What is to be made.
        firsts: A measurement of each folder.
        tables: The folders of tables.
        order: When is measured.
        formats: How many further formats there will be, each about as large as the recording.
        gained: Bytes that go before.

    Raises:
        StorageError: says what is needed.
    """
    sizes = {task.folder.name: sum(map(len, files.values())) for task, files in firsts}
    needed = sum(sizes[task.folder.name] for task in tasks)
    for one in tables:
        rows = int(within(one.times, (order.span,)).sum())
        needed += round(rows * measurement_cost(one.sensor)[1])
    needed += formats * (needed + store.size - gained)
    place = next(above for above in (store.folder, *store.folder.parents) if above.exists())
    free = shutil.disk_usage(place).free + gained
    if needed + _SPARE > free:
        raise StorageError(
            f"{store.folder} cannot be written: what is missing needs about {size_text(needed)}, "
            f"the disk has {size_text(free)} free; record less by --only, --from, --to or --quick"
        )
