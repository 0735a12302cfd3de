"""A rehearsal: one measurement of each sensor tells what all take, and if formats can be had."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from terrain_forge.base import ExportError, require_disk
from terrain_forge.datasets import (
    checked_options,
    dataset_kind,
    format_size,
    open_recording,
)
from terrain_forge.recording.cost import footprint, measurement_cost, truth_footprint
from terrain_forge.recording.index import write_index
from terrain_forge.recording.order import Spans, joined, within
from terrain_forge.recording.rig import Folder
from terrain_forge.recording.store import Store
from terrain_forge.recording.task import Task, Work
from terrain_forge.recording.truth import body_times
from terrain_forge.sensors import NANOSECONDS

_SPARE = 2**24
"""Bytes of a disk that are left free."""
_LENGTH = NANOSECONDS
"""Time of the tables of a rehearsal [ns]."""


def rehearse(work: Work, store: Store, formats: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Measure once with each sensor, and refuse what could not be finished.

    Args:
        work: What is to be recorded.
        store: The recording's folder.
        formats: The further formats and their options.

    Returns:
        The formats that are left out, and why.

    Raises:
        ExportError: says what a format lacks.
        StorageError: if the disk is too small; says what is needed.
    """
    firsts = _first_measurements(work) if work.tasks or formats else []
    lacking = _lacking(formats, firsts, work) if formats else {}
    kept = {name: options for name, options in formats.items() if name not in lacking}
    _require_disk_space(store, firsts, work, kept)
    return lacking


def _first_measurements(work: Work) -> list[tuple[Task, dict[str, bytes]]]:
    """The first measurement that each folder would have, with its files."""
    found = []
    for folder in work.folders:
        if not folder.is_table:
            number = int(np.argmax(within(folder.times, (work.order.span,))))
            task = Task(folder, number)
            found.append((task, task.measure()))
    return found


def _lacking(
    formats: Mapping[str, Mapping[str, Any]],
    firsts: Sequence[tuple[Task, dict[str, bytes]]],
    work: Work,
) -> dict[str, str]:
    """Formats that lack something in a recording, by one of the first measurements alone."""
    found = {}
    begin = work.order.span[0]
    with TemporaryDirectory() as place, Store(Path(place)) as store:
        for task, files in firsts:
            for stream, name in task.names.items():
                store.put(name, files[stream])
        spans = dict.fromkeys(work.spans, ((begin, begin + _LENGTH),))
        write_index(store, work.setting, work.rig, spec=work.spec, spans=spans)
        recording = open_recording(store.folder)
        for name, options in formats.items():
            try:
                dataset_kind(name)().check(recording, checked_options(name, options))
            except ExportError as error:
                if work.order.all_formats:
                    raise
                found[name] = str(error)
    return found


def _require_disk_space(
    store: Store,
    firsts: Sequence[tuple[Task, dict[str, bytes]]],
    work: Work,
    formats: Mapping[str, Mapping[str, Any]],
) -> None:
    """Refuse a disk that is too small for what is missing, and for all of the formats."""
    sizes = {
        task.folder.name: {stream: len(content) for stream, content in files.items()}
        for task, files in firsts
    }
    needed = float(sum(sum(sizes[task.folder.name].values()) for task in work.tasks))
    for one in work.chosen:
        if one.is_table:
            needed += _count(one, (work.order.span,)) * measurement_cost(one.sensor)[1]
    gained = store.size if work.anew else sum(_size(store.folder / name) for name in formats)
    if formats:
        taken = [
            footprint(
                one.name,
                one.sensor,
                _count(one, work.spans[one.sensor.name]),
                sizes.get(one.name, {"data": measurement_cost(one.sensor)[1]}),
            )
            for one in work.folders
        ]
        times = body_times(work.setting, work.rig)
        spans = joined(tuple(span for each in work.spans.values() for span in each))
        taken.append(truth_footprint(int(within(times, spans).sum())))
        needed += sum(format_size(name, options, taken) for name, options in formats.items())
    remedy = "; record less by --only, --from, --to or --quick"
    require_disk(store.folder, needed, spare=_SPARE, gained=gained, remedy=remedy)


def _size(folder: Path) -> int:
    """Bytes of a folder's files; 0 where there is none."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def _count(folder: Folder, spans: Spans) -> int:
    """How many measurements of a folder lie in spans."""
    return int(within(folder.times, spans).sum())
