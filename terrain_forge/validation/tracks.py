"""The world's paths as text: what plain readers of CSV and TUM make of the files."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Array, quaternion_from_rpy, read_lines
from terrain_forge.validation.consumer import Consumer
from terrain_forge.validation.measures import ASPECTS
from terrain_forge.validation.reading import Reading, Track
from terrain_forge.validation.sample import Sample


def read_paths(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """The paths of a built world from their CSV and TUM files, sample by sample.

    Each file is a track of its own; a CSV is two, by its quaternions and by its Euler angles.
    """
    del sample, options, scratch
    return Reading(
        consumer="CSV and TUM",
        tracks=tuple(_tracks(folder)),
        reasons=dict.fromkeys(set(ASPECTS) - {"path"}, "a path is poses alone"),
    )


def table_columns(path: Path) -> dict[str, Array]:
    """The columns of a CSV of numbers by their headings."""
    rows = list(csv.reader(read_lines(path, path.name)))
    values = np.array(rows[1:], np.float64).reshape(-1, len(rows[0]))
    return dict(zip(rows[0], values.T, strict=True))


def track_of(name: str, columns: dict[str, Array]) -> Track:
    """The track of a table with `time_s`, `x_m` … `qz`."""
    return Track(
        name=name,
        time=columns["time_s"],
        position=np.column_stack([columns[f"{axis}_m"] for axis in "xyz"]),
        quaternion=np.column_stack([columns[f"q{part}"] for part in "wxyz"]),
    )


def _tracks(folder: Path) -> Iterator[Track]:
    for path in sorted(folder.glob("*.csv")):
        columns = table_columns(path)
        track = track_of(path.stem, columns)
        yield track
        angles = [columns[f"{angle}_rad"] for angle in ("roll", "pitch", "yaw")]
        turned = quaternion_from_rpy(np.column_stack(angles))
        yield Track(name=track.name, time=track.time, position=track.position, quaternion=turned)
    for path in sorted(folder.glob("*.tum")):
        values = np.loadtxt(path, ndmin=2)
        yield Track(
            name=path.stem,
            time=values[:, 0],
            position=values[:, 1:4],
            quaternion=np.roll(values[:, 4:], 1, axis=1),
        )


PATHS = Consumer(name="CSV and TUM", read=read_paths)
"""Readers of text tables."""
