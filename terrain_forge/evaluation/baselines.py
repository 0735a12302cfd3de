"""Baselines of our own, run as other systems are: `python -m … KIND RECORDING TRAJECTORY`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, ExportError, matrix_from_quaternion, portable
from terrain_forge.datasets import (
    Recording,
    grey,
    open_recording,
    picture_of,
    rectified_pair,
    straight_stream,
)
from terrain_forge.evaluation.poses import TimedPoses
from terrain_forge.evaluation.visual_odometry import stereo_odometry


def stereo(recording: Recording) -> TimedPoses:
    """Our stereo odometry over the first rectified pair."""
    try:
        pair = rectified_pair(recording, "", "stereo odometry")
    except ExportError as error:
        raise DataError(str(error)) from None
    left, right = pair.left, pair.right
    stream = straight_stream(left)
    across, down, column, row = left.intrinsics.tolist()

    def images() -> Iterator[tuple[float, NDArray[np.uint8], NDArray[np.uint8]]]:
        for number, stamp in enumerate(left.stamps.tolist()):
            one, other = (grey(picture_of(camera, number, stream)) for camera in (left, right))
            yield stamp / 1e9, one, other

    return stereo_odometry(
        images(), focal=(across, down), centre=(column, row), baseline=pair.baseline
    )


def wheels(recording: Recording) -> TimedPoses:
    """What wheel odometry integrates to, in the plane."""
    found = recording.series("odometry")
    if not found:
        raise DataError("wheel odometry: no odometry was recorded")
    stamps, values = found[0].table
    names = [name.partition(" ")[0] for name in found[0].columns]
    columns = dict(zip(names, values.T, strict=True))
    missing = {"x", "y", "yaw"} - columns.keys()
    if missing:
        raise DataError(f"wheel odometry: {found[0].key} has no column {missing.pop()}")
    half = 0.5 * columns["yaw"]
    zero = np.zeros_like(half)
    return TimedPoses(
        name="wheel-odometry",
        time=np.asarray(stamps / 1e9, np.float64),
        position=np.stack([columns["x"], columns["y"], zero], axis=-1),
        quaternion=np.stack([np.cos(half), zero, zero, np.sin(half)], axis=-1),
    )


def inertial(recording: Recording) -> TimedPoses:
    """Dead reckoning with the first IMU: its bias and tilt are those of its first second."""
    if not recording.imus:
        raise DataError("dead reckoning: no IMU was recorded")
    stamps, values = recording.imus[0].table
    rates, forces = values[:, :3], values[:, 3:6]
    time = (stamps - stamps[0]) / 1e9
    still = time <= 1.0
    up = forces[still].mean(axis=0)
    place, turn = integrated(
        time, rates - rates[still].mean(axis=0), forces, up=up, gravity=recording.gravity
    )
    return TimedPoses(
        name="imu", time=np.asarray(stamps / 1e9, np.float64), position=place, quaternion=turn
    )


def integrated(
    time: Array, rates: Array, forces: Array, *, up: Array, gravity: float
) -> tuple[Array, Array]:
    """Places and rotations (w, x, y, z) from rates [rad/s] and specific forces [m/s²], from rest.

    Trapezoids of the acceleration in a frame whose z axis is `up` at the start.
    """
    from scipy.spatial.transform import Rotation

    z = up / portable.norm(up)
    axis = np.array([z[1], -z[0], 0.0])  # z turned into (0, 0, 1)
    sine = float(portable.norm(axis))
    angle = float(portable.arctan2(sine, z[2]))
    start = Rotation.from_rotvec(axis * (angle / sine) if sine > 1e-12 else np.zeros(3))
    steps = np.diff(time)[:, None]
    turns = Rotation.from_rotvec(0.5 * (rates[1:] + rates[:-1]) * steps)
    quaternion = np.empty((len(time), 4))
    now = start
    quaternion[0] = np.roll(now.as_quat(), 1)
    for row, turn in enumerate(turns, 1):
        now = now * turn
        quaternion[row] = np.roll(now.as_quat(), 1)
    world = (matrix_from_quaternion(quaternion) * forces[:, None, :]).sum(axis=-1)
    pushed = world - np.array([0.0, 0.0, gravity])
    speed = np.vstack([np.zeros(3), np.cumsum(0.5 * (pushed[1:] + pushed[:-1]) * steps, axis=0)])
    place = np.cumsum(0.5 * (speed[1:] + speed[:-1]) * steps, axis=0)
    return np.vstack([np.zeros(3), place]), quaternion


KINDS = {"stereo": stereo, "wheels": wheels, "imu": inertial}


def main(kind: str, folder: str, output: str) -> int:
    """Write the trajectory of a baseline in the TUM format."""
    from terrain_forge.paths import write_tum

    try:
        poses = KINDS[kind](open_recording(folder))
    except DataError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    write_tum(Path(output), poses.time, poses.position, poses.quaternion)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
