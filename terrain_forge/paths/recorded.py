"""Paths from files: tables with named columns, plain lists of x and y, and TUM trajectories."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from terrain_forge.base import (
    MAX_TABLE,
    Array,
    DataError,
    Key,
    RecipeError,
    plain_number,
    portable,
    read_text,
    reading,
    rpy_from_quaternion,
)
from terrain_forge.paths.curves import STEP, Curve, require_length, trace_spline
from terrain_forge.paths.spec import Recorded

MAX_POSES = 2_000_000
"""Rows of one file."""
_TUM = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
_ALIASES = {
    "time": ("time", "time_s", "t", "t_s", "timestamp"),
    "x": ("x", "x_m", "east", "east_m"),
    "y": ("y", "y_m", "north", "north_m"),
    "z": ("z", "z_m"),
    "yaw": ("yaw", "yaw_rad"),
    "yaw_deg": ("yaw_deg",),
    **{name: (name,) for name in ("qw", "qx", "qy", "qz")},
}
_LEAST_NORM = 0.9
"""Length of a quaternion that is no rotation below it."""
_STILL = 1e-3
"""Speed [m/s] below which a recorded path has no direction of its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedPoses:
    """What a file tells of a path."""

    position: Array
    """East and north of the site's centre [m], shape [poses, 2]."""
    time: Array | None
    """Times from the first pose on [s], shape [poses]."""
    yaw: Array | None
    """Heading [rad], continuous, shape [poses]."""
    attitude: Array | None
    """Height [m], roll and pitch [rad], continuous, shape [poses, 3]."""


def read_recorded(spec: Recorded, folder: Path, *, key: Key) -> RecordedPoses:
    """The poses of a recipe's file, moved and turned to where the recipe wants them.

    The file is relative to the folder; the key is where in the recipe it is named.

    Raises:
        DataError: if the file is missing, or no such path; says in which line.
    """
    text = read_text(folder / spec.file, spec.file, most=MAX_TABLE, lines=2 * MAX_POSES, key=key)
    with reading(spec.file, key=key):
        columns = _columns(spec.file, text, key)
    angle = math.radians(spec.turn_deg)
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    position = portable.product(np.stack([columns["x"], columns["y"]], -1), turn) + np.asarray(
        spec.origin_m
    )
    time, (yaw, attitude) = columns.get("time"), _attitude(spec.file, columns, key)
    if time is not None and np.diff(time).min() <= 0.0:
        row = int(np.argmax(np.diff(time) <= 0.0)) + 2
        raise DataError(f"{spec.file}: time of pose {row} is not after the one before", key=key)
    return RecordedPoses(
        position=position,
        time=None if time is None else time - time[0],
        yaw=None if yaw is None else yaw + angle,
        attitude=attitude,
    )


def follow(spec: Recorded, poses: RecordedPoses, *, key: Key) -> tuple[Curve, Array | None]:
    """The curve through a file's poses, and its times where the recipe wants the recorded ones.

    Raises:
        DataError: if the recorded timing or attitude is wanted and there is none, or nothing moves.
        RecipeError: if the curve turns back on itself, or an attitude is wanted without its times.
    """
    stands = spec.attitude == "recorded"
    if stands and spec.timing != "recorded":
        raise RecipeError(
            "`attitude: recorded` needs `timing: recorded`", key=(*key[:-1], "attitude")
        )
    if stands and poses.attitude is None:
        raise DataError(
            f"{spec.file} needs columns z and qw, qx, qy, qz for `attitude: recorded`", key=key
        )
    if spec.timing == "speed":
        points = _thinned(poses.position, spec.spacing_m, closed=spec.closed)
        if len(points) < 2:
            raise DataError(f"{spec.file} does not move by {spec.spacing_m:g} m", key=key)
        return trace_spline(points, closed=spec.closed, key=key), None
    if poses.time is None:
        raise DataError(f"{spec.file} has no times for `timing: recorded`", key=key)
    return _replay(poses.time, poses, stands=stands)


def _replay(time: Array, poses: RecordedPoses, *, stands: bool) -> tuple[Curve, Array]:
    """The C² curve through the poses over time, each pose among its points."""
    from scipy.interpolate import CubicSpline

    steps = np.linalg.norm(np.diff(poses.position, axis=0), axis=1)
    require_length(float(steps.sum()))
    parts = np.maximum(np.ceil(steps / STEP), 1).astype(np.int64)
    first = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[first]
    fine = np.append(time[first] + share * np.diff(time)[first], time[-1])
    track = CubicSpline(time, poses.position)
    if poses.yaw is not None:
        heading = CubicSpline(time, poses.yaw)(fine)
    else:
        velocity = track(fine, 1)
        moving = np.linalg.norm(velocity, axis=1) > _STILL
        latest = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
        latest[latest < 0] = int(np.argmax(moving))
        heading = np.unwrap(portable.arctan2(velocity[:, 1], velocity[:, 0])[latest])
    attitude = CubicSpline(time, poses.attitude)(fine) if stands else None
    return Curve(position=track(fine), heading=heading, attitude=attitude), fine


def _thinned(points: Array, spacing: float, *, closed: bool) -> Array:
    """Points at least so far apart, the last one among them unless it closes a curve."""
    kept = [points[0]]
    for point in points[1:]:
        if math.dist(point, kept[-1]) >= spacing:
            kept.append(point)
    if closed:
        while len(kept) > 2 and math.dist(kept[-1], kept[0]) < spacing:
            kept.pop()
    elif len(kept) > 1:
        kept[-1] = points[-1]
    return np.array(kept)


def _columns(file: str, text: str, key: Key) -> dict[str, Array]:
    """The columns by their plain names, in a table that may have no line of names."""
    lines = [
        (number, [f.strip() for f in next(csv.reader([line]))] if "," in line else line.split())
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise DataError(f"{file} is empty", key=key)
    names = _names(file, lines[0][1], key)
    if "x" not in names or "y" not in names:
        raise DataError(
            f"{file} needs columns x and y (or x_m, y_m), with commas or blanks between them, "
            f"found {', '.join(lines[0][1])}",
            key=key,
        )
    rows = lines if _is_numeric(lines[0][1]) else lines[1:]
    if not 2 <= len(rows) <= MAX_POSES:
        raise DataError(f"{file} has {len(rows):,} poses, allowed: 2 to {MAX_POSES:,}", key=key)
    values = np.array([_numbers(file, number, row, names, key) for number, row in rows])
    return {name: values[:, n] for n, name in enumerate(names) if name}


def _names(file: str, first: list[str], key: Key) -> list[str]:
    """For each column its plain name; empty for one that is not needed."""
    if not _is_numeric(first):
        plain = {alias: name for name, aliases in _ALIASES.items() for alias in aliases}
        names = [plain.get(field.lower(), "") for field in first]
        twice = next((name for name in names if name and names.count(name) > 1), None)
        if twice:
            raise DataError(f"{file} has two columns for {twice}", key=key)
        return names
    names = {2: ["x", "y"], 8: list(_TUM)}.get(len(first), [])
    if not names:
        raise DataError(
            f"{file}: {len(first)} columns without names; 2 (x y) or 8 (TUM) need none", key=key
        )
    return names


def _numbers(file: str, line: int, row: list[str], names: list[str], key: Key) -> list[float]:
    if len(row) != len(names):
        raise DataError(f"{file}, line {line}: {len(row)} fields, expected {len(names)}", key=key)
    numbers = []
    for name, field in zip(names, row, strict=True):
        try:
            number = plain_number(field) if name else 0.0
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise DataError(
                f"{file}, line {line}: {name} must be a number, found {field!r}", key=key
            )
        numbers.append(number)
    return numbers


def _is_numeric(row: list[str]) -> bool:
    try:
        [float(field) for field in row]
    except ValueError:
        return False
    return True


def _attitude(file: str, columns: dict[str, Array], key: Key) -> tuple[Array | None, Array | None]:
    """Yaw [rad], and height [m], roll and pitch [rad], as far as the columns tell them."""
    yaw = attitude = None
    parts = ("qw", "qx", "qy", "qz")
    if columns.keys() >= set(parts):
        quaternion = np.stack([columns[name] for name in parts], -1)
        norm = np.linalg.norm(quaternion, axis=1, keepdims=True)
        if norm.min() < _LEAST_NORM:
            raise DataError(
                f"{file}: the quaternion of pose {int(np.argmin(norm)) + 1} has the length "
                f"{norm.min():.3g}, must be 1",
                key=key,
            )
        rpy = np.unwrap(rpy_from_quaternion(quaternion / norm), axis=0)
        yaw = rpy[:, 2]
        if "z" in columns:
            attitude = np.column_stack([columns["z"], rpy[:, :2]])
    if "yaw" in columns:
        yaw = np.unwrap(columns["yaw"])
    elif "yaw_deg" in columns:
        yaw = np.unwrap(np.radians(columns["yaw_deg"]))
    return yaw, attitude
