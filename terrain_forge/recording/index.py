"""What tells of a recording's measurements: lists of files, calibration, truth, dataset.json."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge import __version__
from terrain_forge.base import read_text, reading, returning, to_plain
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.order import Spans, joined, within
from terrain_forge.recording.rig import Folder, body_of, from_body
from terrain_forge.recording.store import Store
from terrain_forge.recording.texts import files_text, matrix, table, written, yaml_text
from terrain_forge.recording.truth import (
    EPOCH,
    base_poses,
    body_table,
    body_times,
    sensor_poses,
)
from terrain_forge.sensors import Frames, Series, Setting

INDEX = "dataset.json"
VERSION = 1
"""Of the layout, as dataset.json says."""
MAV = "mav0"
_TRUTH = f"{MAV}/state_groundtruth_estimate0"
_TABLE = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,60}")
_MOST = 2**24


def file_name(folder: Folder, stream: str, time: int) -> str:
    """The file of a measurement at a time from 0 [ns]."""
    suffix = folder.streams[stream].suffix
    return f"{MAV}/{folder.name}/{stream}/{time + EPOCH}{suffix}"


def recorded_spans(store: Store) -> dict[str, Spans]:
    """What a recording that lies there holds of each sensor, by the sensors' names.

    Raises:
        DataError: if its index is damaged.
    """
    if not store.holds(INDEX):
        return {}
    with reading(INDEX):
        spans = json.loads(read_text(store.folder / INDEX, INDEX, most=_MOST))["spans_ns"]
        return {
            name: joined(tuple((int(first), int(end)) for first, end in parts))
            for name, parts in spans.items()
        }


def whole_times(folder: Folder, store: Store) -> NDArray[np.int64]:
    """When files of a sensor were measured that are there, from 0 [ns]."""
    times = folder.times
    there = [
        all(store.holds(file_name(folder, stream, time)) for stream in folder.streams)
        for time in times.tolist()
    ]
    return times[np.array(there, np.bool_)] if there else times


def write_index(
    store: Store,
    setting: Setting,
    folders: Sequence[Folder],
    *,
    spec: DatasetSpec,
    spans: Mapping[str, Spans],
) -> dict[str, int]:
    """Write all that tells of the measurements which are there; dataset.json last.

    Args:
        store: The recording's folder.
        setting: In what was measured.
        folders: Those of the whole rig.
        spec: How it was recorded.
        spans: What of each sensor was recorded, by the sensors' names.

    Returns:
        How many measurements there are, by the folders' names.
    """
    done = [one for one in folders if one.sensor.name in spans]
    told = []
    for folder in done:
        mine = spans[folder.sensor.name]
        write = _write_table if folder.is_table else _write_files
        times = write(store, folder, mine)
        store.put(f"{MAV}/{folder.name}/sensor.yaml", _calibration(folder, body_of(folders)))
        store.put(f"truth/{folder.name}.tum", written(sensor_poses(folder, times)))
        told.append(_stream(folder, times))
    times = body_times(setting, folders)
    union = joined(tuple(span for each in spans.values() for span in each))
    times = times[within(times, union)]
    store.put(f"{_TRUTH}/data.csv", written(body_table(setting, folders, times)))
    store.put(f"{_TRUTH}/sensor.yaml", _truth_yaml())
    store.put("truth/base_link.tum", written(base_poses(setting, times)))
    about = _about(setting, folders, spec, told) | {"spans_ns": spans}
    store.put(INDEX, (json.dumps(about, indent=1, ensure_ascii=False) + "\n").encode())
    return {folder.name: stream["count"] for folder, stream in zip(done, told, strict=True)}


def _write_table(store: Store, folder: Folder, spans: Spans) -> NDArray[np.int64]:
    """Write a table's rows within spans; returns their times."""
    instrument = folder.instrument
    assert isinstance(instrument, Series)
    times = folder.times
    chosen = within(times, spans)
    columns = {name: column[chosen] for name, column in _samples(folder, instrument).items()}
    name = f"{MAV}/{folder.name}/data.csv"
    store.put(name, written(table(columns, times[chosen] + EPOCH)))
    return np.asarray(times[chosen])


def _samples(folder: Folder, instrument: Series) -> dict[str, NDArray[Any]]:
    """All samples of an instrument, judged: another package's may be anything.

    Raises:
        PluginError: naming its module, and what is wrong.
    """
    what = f"instrument {instrument.kind!r}: samples"
    with returning(instrument, f"instrument {instrument.kind!r}: streams", "one called data"):
        figures = folder.streams["data"].figures
    with returning(instrument, what, "a finite number of each column at each of its times"):
        found = {name: np.asarray(column) for name, column in instrument.samples().items()}
        told = figures.get("columns", [*found])
        if [*found] != [*told]:
            raise ValueError(f"found columns {[*found]}, and its streams have {[*told]}")
        for name, column in found.items():
            _require_column(name, column, len(instrument.times))
    return found


def _require_column(name: str, column: NDArray[Any], count: int) -> None:
    """Refuse what cannot stand in a table of so many rows.

    Raises:
        TypeError, ValueError: says what was found.
    """
    if "," in name or len(name.splitlines()) != 1:
        raise ValueError(f"found a column called {name!r}")
    if column.dtype.kind not in "iuf":
        raise TypeError(f"found {column.dtype} in {name!r}")
    if column.shape != (count,):
        raise ValueError(f"found shape {column.shape} of {name!r}, not ({count},)")
    if not np.isfinite(column).all():
        raise ValueError(f"found what is not finite in {name!r}")


def _write_files(store: Store, folder: Folder, spans: Spans) -> NDArray[np.int64]:
    """List the files within spans that are there, whenever they were made, with their tables.

    What an interrupted recording left beyond them waits, unlisted: of a pair it may be one picture,
    and the truth ends before. Returns their times.
    """
    times = whole_times(folder, store)
    times = times[within(times, spans)]
    suffix = folder.streams.get("data", next(iter(folder.streams.values()))).suffix
    place = f"{MAV}/{folder.name}"
    store.put(f"{place}/data.csv", files_text((times + EPOCH).tolist(), suffix))
    instrument = folder.instrument
    assert isinstance(instrument, Frames)
    numbers = np.searchsorted(instrument.times, times).tolist()
    what = f"instrument {instrument.kind!r}: tables"
    with returning(instrument, what, "finite numbers of each measurement, by names of its tables"):
        tables = {name: {**columns} for name, columns in instrument.tables(numbers).items()}
        for name, columns in tables.items():
            if not _TABLE.fullmatch(name) or name == "data":
                raise ValueError(f"found a table called {name!r}")
            for column, values in columns.items():
                columns[column] = np.asarray(values)
                _require_column(column, columns[column], len(times))
    for name, columns in tables.items():
        store.put(f"{place}/{name}.csv", written(table(columns, times + EPOCH)))
    return times


def require_told(folder: Folder) -> None:
    """Refuse a sensor of which an index could not tell, before anything is measured.

    Raises:
        PluginError: if another package's instrument says of itself what it may not.
    """
    if folder.streams:
        _calibration(folder, None)


def _calibration(folder: Folder, body: Folder | None) -> bytes:
    """A sensor's sensor.yaml: EuRoC's keys first, then what its kind tells.

    Raises:
        PluginError: if another package's instrument tells what YAML cannot hold.
    """
    rate = folder.rate
    first = {
        "sensor_type": folder.sensor.kind,
        "comment": folder.sensor.name,
        "T_BS": matrix(from_body(folder, body)),
        "rate_hz": int(rate) if rate == int(rate) else rate,
    }
    what = f"instrument {folder.instrument.kind!r}: calibration"
    with returning(folder.instrument, what, "a dict of plain numbers, texts, lists and dicts"):
        told = first | folder.instrument.calibration()
        return yaml_text(told, "T_BS: from the sensor's frame to the body's; SI units")


def _truth_yaml() -> bytes:
    exact = {"sensor_type": "visual-inertial", "comment": "exact", "T_BS": matrix(np.eye(4))}
    return yaml_text(exact, "The body's own state: exact, not estimated")


def _stream(folder: Folder, times: NDArray[np.int64]) -> dict[str, Any]:
    stamps = (times + EPOCH).tolist()
    return {
        "folder": f"{MAV}/{folder.name}",
        "name": folder.sensor.name,
        "kind": folder.sensor.kind,
        "rate_hz": folder.rate,
        "table": folder.is_table,
        "count": len(stamps),
        "first_ns": stamps[0] if stamps else None,
        "last_ns": stamps[-1] if stamps else None,
        "channels": {
            name: {"suffix": stream.suffix, **stream.figures}
            for name, stream in folder.streams.items()
        },
    }


def _about(
    setting: Setting, folders: Sequence[Folder], spec: DatasetSpec, streams: list[dict[str, Any]]
) -> dict[str, Any]:
    world, body = setting.world, body_of(folders)
    return {
        "version": VERSION,
        "terrain_forge": __version__,
        "world": {
            "name": world.site.name,
            "seed": world.site.seed,
            "body": world.site.body.name,
            "rover": world.rover.name,
            "crs": world.site.crs,
        },
        "gravity_m_s2": setting.gravity,
        "motion": {
            "path": setting.motion.path,
            "source": setting.motion.source,
            "still_s": spec.still_s,
            "ramp_s": spec.ramp_s,
            "duration_s": setting.motion.end,
            "ended": setting.motion.ended,
            "tracks": spec.tracks,
        },
        "profile": spec.profile,
        "epoch_ns": EPOCH,
        "body": body.name if body else "base_link",
        "transforms": {one.name: one.at_rest.ravel().tolist() for one in folders},
        "links": {one.name: one.sensor.link for one in folders},
        "moving_links": [name for name, _ in setting.motion.links],
        "classes": _classes(streams),
        "sensors": [to_plain(sensor, {}) for sensor in world.rover.sensors],
        "streams": streams,
    }


def _classes(streams: list[dict[str, Any]]) -> dict[str, str]:
    """Names of the classes by their numbers, as the streams that have them say."""
    found: dict[str, str] = {}
    for figures in (one for stream in streams for one in stream["channels"].values()):
        found |= {str(number): name for number, name in figures.get("classes", {}).items()}
    return found


def dataset_folder(out: Path) -> Path:
    """Where a world's recording lies."""
    return out / "dataset"
