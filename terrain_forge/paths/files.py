"""Trajectories as files: CSV with Euler angles, and the TUM format of SLAM evaluation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from terrain_forge.base import Array, xyzw
from terrain_forge.model import Trajectory
from terrain_forge.writers import Column, write_table


def write_trajectories(trajectories: tuple[Trajectory, ...], directory: Path) -> list[Path]:
    """Write the files of all trajectories into `directory`, which is made even for none."""
    directory.mkdir(parents=True, exist_ok=True)
    return [path for one in trajectories for path in write_trajectory(one, directory)]


def write_trajectory(trajectory: Trajectory, directory: Path) -> list[Path]:
    """Write NAME.csv and NAME.tum into `directory`; returns both.

    The poses are those of `base_link` in the world frame [m, s, rad]; the angles of the CSV are
    continuous, so a full turn to the left ends at yaw + 2π. TUM has no heading and orders
    quaternions x, y, z, w.
    """
    directory.mkdir(parents=True, exist_ok=True)
    table, tum = (directory / f"{trajectory.name}.{ending}" for ending in ("csv", "tum"))
    quaternion = trajectory.quaternion
    write_table(
        table, pose_columns(trajectory.time, trajectory.position, quaternion, trajectory.rpy)
    )
    write_tum(tum, trajectory.time, trajectory.position, quaternion)
    return [table, tum]


def pose_columns(time: Array, position: Array, quaternion: Array, rpy: Array) -> list[Column]:
    """Time [s], place [m], rotation (w, x, y, z), and roll, pitch and yaw [rad] of poses."""
    return [
        *columns(time[:, None], "time_s"),
        *columns(position, "x_m", "y_m", "z_m"),
        *columns(quaternion, "qw", "qx", "qy", "qz"),
        *columns(rpy, "roll_rad", "pitch_rad", "yaw_rad"),
    ]


def write_tum(path: Path, time: Array, position: Array, quaternion: Array) -> None:
    """Write poses in the TUM format; quaternions are given as w, x, y, z."""
    poses = np.column_stack([time, position, xyzw(quaternion)])
    names = ("time_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
    write_table(path, columns(poses, *names), separator=" ", header=False)


def columns(values: Array, *names: str) -> list[Column]:
    """The columns of an array, shape [rows, columns], to nine decimals."""
    return [Column(name=name, values=values[:, n], form="%.9f") for n, name in enumerate(names)]
