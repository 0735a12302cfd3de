"""What is written of each pose, at the recording's own stamps to the nanosecond."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, read_text, write_whole
from terrain_forge.evaluation.alignment import SAME_TIME, nearest
from terrain_forge.evaluation.poses import TimedPoses
from terrain_forge.evaluation.score import Score

ERRORS = "errors.csv"
"""Where the estimate lies, and how far it is off, in the folder of a system's run."""
ERROR_COLUMNS = "time [s]", "path length [m]", "x [m]", "y [m]", "z [m]", "error [m]"


def write_errors(score: Score, path: Path, stamps: NDArray[np.int64]) -> None:
    """Write the estimate's places in the truth's frame, and their errors, as CSV.

    Args:
        score: The score.
        path: The file.
        stamps: The recording's, of the truth [ns].
    """
    table = np.column_stack([score.station, score.aligned, score.errors])
    lines = _lines(score.time, stamps, table, "%.6f", ",")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, "\n".join([",".join(ERROR_COLUMNS), *lines, ""]))


def read_errors(path: Path) -> Array:
    """The rows of `write_errors`: time, path length, x, y, z, error; shape [poses, 6].

    Raises:
        DataError: if it cannot be read.
    """
    text = read_text(path, str(path), most=2**30)
    try:
        table = np.loadtxt(text.splitlines(), delimiter=",", skiprows=1, ndmin=2)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from None
    if table.shape[1:] != (len(ERROR_COLUMNS),):
        raise DataError(f"{path}: must have the columns {', '.join(ERROR_COLUMNS)}")
    return table


def write_poses(poses: TimedPoses, path: Path, stamps: NDArray[np.int64]) -> None:
    """Write a trajectory as TUM has it, which `read_poses` reads.

    Args:
        poses: The trajectory, by the recording's clock.
        path: The file.
        stamps: The recording's, of the truth [ns].
    """
    table = np.column_stack([poses.position, np.roll(poses.quaternion, -1, axis=-1)])
    write_whole(path, "\n".join([*_lines(poses.time, stamps, table, "%.9g", " "), ""]))


def _lines(
    time: Array, stamps: NDArray[np.int64], table: Array, form: str, between: str
) -> Sequence[str]:
    """Rows as lines, a time before each."""
    text = StringIO()
    np.savetxt(text, table, fmt=form, delimiter=between, newline="\n")
    rows = text.getvalue().splitlines()
    return [between.join(row) for row in zip(_digits(time, stamps), rows, strict=True)]


def _digits(time: Array, stamps: NDArray[np.int64]) -> list[str]:
    """Times [s] as digits, those that are stamps [ns] exactly."""
    clock = stamps / 1e9
    rows = nearest(clock, time)
    same = np.abs(clock[rows] - time) <= SAME_TIME
    return [
        f"{stamp // 10**9}.{stamp % 10**9:09d}" if exact else f"{one:.9f}"
        for one, stamp, exact in zip(time.tolist(), stamps[rows].tolist(), same, strict=True)
    ]
