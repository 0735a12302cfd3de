"""What drivers read of a recording: NumPy is all that they need."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

_OWN = Path("own_s.txt")
"""In the folder that a system runs in: processor time that is not the system's [s]."""
_own = 0.0


@contextmanager
def own_work() -> Iterator[None]:
    """What is done within is ours: reading, and turning measurements into what a system takes."""
    global _own
    begin = time.thread_time()
    try:
        yield
    finally:
        _own += time.thread_time() - begin


def tell_own_work(more: float = 0.0) -> None:
    """Write how long it took and `more` [s], for the table to tell the system's time alone."""
    _OWN.write_text(f"{_own + more:.6f}\n", encoding="ascii")


def names(folder: Path) -> list[tuple[int, str]]:
    """Stamps [ns] and file names of a sensor."""
    rows = (folder / "data.csv").read_text(encoding="utf-8").splitlines()
    pairs = (row.split(",") for row in rows if row and not row.startswith("#"))
    return [(int(stamp), name) for stamp, name in pairs]


def sweeps(dataset: Path, lidar: str) -> Iterator[tuple[int, Any]]:
    """Stamps [ns] and points of a lidar: x, y, z, intensity, ring, time, instance."""
    folder = dataset / "mav0" / lidar
    for stamp, name in names(folder):
        with own_work():
            points = np.load(folder / "data" / name, allow_pickle=False)
        yield stamp, points


def places_and_times(points: Any) -> tuple[Any, Any]:
    """Of a sweep what the KISS systems take: places [m], shape [n, 3], and times [s], shape [n].

    They divide by how long a sweep lasts, so one that was taken at once has no times.
    """
    with own_work():
        places = np.column_stack([points[axis] for axis in "xyz"]).astype(np.float64)
        times = points["time"].astype(np.float64)
        return places, times if np.ptp(times) > 0.0 else times[:0]


def table(dataset: Path, sensor: str) -> tuple[Any, Any]:
    """Stamps [ns], and the other columns of a sensor's table."""
    path = dataset / "mav0" / sensor / "data.csv"
    rows = [row.split(",") for row in path.read_text(encoding="utf-8").splitlines()]
    rows = [row for row in rows if row[0] and not row[0].startswith("#")]
    stamps = np.array([int(row[0]) for row in rows])
    return stamps, np.array([[float(value) for value in row[1:]] for row in rows])


def figure(dataset: Path, sensor: str, key: str) -> float:
    """A number of a sensor's sensor.yaml."""
    text = (dataset / "mav0" / sensor / "sensor.yaml").read_text(encoding="utf-8")
    found = re.search(rf'^.*?\b{key}"?: *([-+.\deE]+)', text, re.M)
    if not found:
        raise SystemExit(f"{sensor}/sensor.yaml has no number {key!r}")
    return float(found[1])


def sweep_s(dataset: Path, lidar: str) -> float:
    """How long a sweep takes [s]; a look at a recording has but some of the sweeps."""
    text = (dataset / "mav0" / lidar / "sensor.yaml").read_text(encoding="utf-8")
    if "sweep_s" in text:
        return figure(dataset, lidar, "sweep_s")
    return 1.0 / figure(dataset, lidar, "rate_hz")  # of an earlier version


def about(dataset: Path) -> dict[str, Any]:
    """What dataset.json says."""
    told: dict[str, Any] = json.loads((dataset / "dataset.json").read_text(encoding="utf-8"))
    return told


def transform(dataset: Path, sensor: str) -> Any:
    """From a sensor's frame to base_link's, shape [4, 4]."""
    return np.array(about(dataset)["transforms"][sensor], float).reshape(4, 4)


def seconds(stamp: int) -> str:
    """A stamp [ns] in seconds, without loss."""
    return f"{stamp // 10**9}.{stamp % 10**9:09d}"


def write_pose(file: Any, stamp: int, place: Any, quaternion_xyzw: Any) -> None:
    """Write a pose as a line of the TUM format."""
    values = " ".join(f"{value:.9f}" for value in (*place, *quaternion_xyzw))
    file.write(f"{seconds(stamp)} {values}\n")


def quaternion_of(turn: Any) -> tuple[float, float, float, float]:
    """Rotation (x, y, z, w) of a matrix (Shepperd 1978)."""
    trace = turn[0, 0] + turn[1, 1] + turn[2, 2]
    pairs = np.array([turn[0, 0], turn[1, 1], turn[2, 2], trace])
    which = int(np.argmax(pairs))
    found = np.zeros(4)
    if which == 3:
        found[3] = 1.0 + trace
        found[:3] = (
            turn[2, 1] - turn[1, 2],
            turn[0, 2] - turn[2, 0],
            turn[1, 0] - turn[0, 1],
        )
    else:
        i, j, k = which, (which + 1) % 3, (which + 2) % 3
        found[i] = 1.0 - trace + 2.0 * turn[i, i]
        found[j] = turn[j, i] + turn[i, j]
        found[k] = turn[k, i] + turn[i, k]
        found[3] = turn[k, j] - turn[j, k]
    x, y, z, w = found / np.linalg.norm(found)
    return float(x), float(y), float(z), float(w)
