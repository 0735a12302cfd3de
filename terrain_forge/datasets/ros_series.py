"""ROS messages of tables: IMU, wheel odometry, Sun sensor, inclinometer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from terrain_forge.base import Array, DataError
from terrain_forge.datasets.ros_parts import Pair, RosParts
from terrain_forge.datasets.streams import RecordedSeries

ODOMETRY = "nav_msgs/msg/Odometry"
_UNKNOWN = 1e6
"""Variance of what wheels do not tell."""
_LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
_KINDS = {
    "imu": "sensor_msgs/msg/Imu",
    "odometry": ODOMETRY,
    "sun": "geometry_msgs/msg/Vector3Stamped",
    "inclinometer": "geometry_msgs/msg/Vector3Stamped",
}


def series_kind(table: RecordedSeries) -> str:
    """The type of a table's messages; empty where there is none."""
    return _KINDS.get(table.word_of_folder, "")


def series_messages(parts: RosParts, table: RecordedSeries, frame: str) -> Iterator[Pair]:
    """The rows of a table as messages of its kind, with their stamps."""
    make: Callable[[RosParts, RecordedSeries, str], Iterator[Pair]] = {
        "imu": _imu,
        "odometry": _odometry,
        "sun": _sun,
        "inclinometer": _inclinometer,
    }[table.word_of_folder]
    return make(parts, table, frame)


def _rows(table: RecordedSeries, *names: str) -> Iterator[tuple[int, Array]]:
    """Stamps and the values of some columns."""
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise DataError(f"{table.key}/data.csv has no column {missing[0]!r}")
    columns = [table.columns.index(name) for name in names]
    for stamps, values in table.blocks():
        yield from zip(stamps.tolist(), values[:, columns], strict=True)


def _imu(parts: RosParts, imu: RecordedSeries, frame: str) -> Iterator[Pair]:
    """Without orientation, which it does not measure: the covariance's first number is -1."""
    unknown, turning, pushing = np.zeros(9), np.zeros(9), np.zeros(9)
    unknown[0] = -1.0
    for matrix, name in ((turning, "gyroscope"), (pushing, "accelerometer")):
        density = float(imu.numbers(f"{name}_noise_density", (1,))[0])
        matrix[::4] = density * density * imu.rate
    names = [f"{what}_RS_S_{axis}" for what in "wa" for axis in "xyz"]
    for stamp, row in _rows(imu, *names):
        yield (
            stamp,
            parts.make(
                "sensor_msgs/msg/Imu",
                *(parts.header(stamp, frame), parts.turn(_LEVEL), unknown),
                *(parts.vector(row[:3]), turning, parts.vector(row[3:]), pushing),
            ),
        )


def _odometry(parts: RosParts, table: RecordedSeries, frame: str) -> Iterator[Pair]:
    """Where base_link would be in the plane, by the wheels alone."""
    del frame
    own = ("x", "y", "yaw", "v", "w")
    pairs = ("x_x", "x_y", "x_yaw", "y_y", "y_yaw", "yaw_yaw", "v_v", "w_w")
    for stamp, row in _rows(table, *own, *(f"cov_{pair}" for pair in pairs)):
        x, y, yaw, speed, turning = row[:5].tolist()
        turn = np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
        spread, twisted = np.zeros((6, 6)), np.zeros((6, 6))
        spread[np.ix_((0, 1, 5), (0, 1, 5))] = [
            [row[5], row[6], row[7]],
            [row[6], row[8], row[9]],
            [row[7], row[9], row[10]],
        ]
        twisted[0, 0], twisted[5, 5] = row[11], row[12]
        for matrix, blind in ((spread, (2, 3, 4)), (twisted, (1, 2, 3, 4))):
            matrix[blind, blind] = _UNKNOWN
        yield (
            stamp,
            odometry_message(
                parts,
                parts.header(stamp, "odom"),
                (np.array([x, y, 0.0]), turn, spread.ravel()),
                (np.array([speed, 0.0, 0.0]), np.array([0.0, 0.0, turning]), twisted.ravel()),
            ),
        )


def odometry_message(
    parts: RosParts,
    header: object,
    pose: tuple[Array, Array, Array],
    twist: tuple[Array, Array, Array],
) -> object:
    """Of base_link: place, quaternion and covariance; velocity, rate and covariance."""
    point = parts.make("geometry_msgs/msg/Point", *pose[0].tolist())
    placed = parts.make("geometry_msgs/msg/Pose", point, parts.turn(pose[1]))
    moving = parts.make("geometry_msgs/msg/Twist", parts.vector(twist[0]), parts.vector(twist[1]))
    return parts.make(
        ODOMETRY,
        *(header, "base_link"),
        parts.make("geometry_msgs/msg/PoseWithCovariance", placed, pose[2]),
        parts.make("geometry_msgs/msg/TwistWithCovariance", moving, twist[2]),
    )


def _sun(parts: RosParts, table: RecordedSeries, frame: str) -> Iterator[Pair]:
    """Directions to the Sun in the sensor's frame, where it is seen."""
    for stamp, row in _rows(table, "s_x", "s_y", "s_z", "seen"):
        if row[3]:
            yield stamp, _vector(parts, stamp, frame, row[:3])


def _inclinometer(parts: RosParts, table: RecordedSeries, frame: str) -> Iterator[Pair]:
    """Roll and pitch [rad] as x and y."""
    for stamp, row in _rows(table, "roll", "pitch"):
        yield stamp, _vector(parts, stamp, frame, np.array([row[0], row[1], 0.0]))


def _vector(parts: RosParts, stamp: int, frame: str, values: Array) -> object:
    kind = "geometry_msgs/msg/Vector3Stamped"
    return parts.make(kind, parts.header(stamp, frame), parts.vector(values))
