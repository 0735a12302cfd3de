"""Trajectories as files: CSV with Euler angles, and the TUM format of SLAM evaluation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import xyzw
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
    table = directory / f"{trajectory.name}.csv"
    tum = directory / f"{trajectory.name}.tum"
    time = [Column(name="time_s", values=trajectory.time, form="%.9f")]
    position = _columns(trajectory.position, ("x_m", "y_m", "z_m"))
    quaternion = _columns(trajectory.quaternion, ("qw", "qx", "qy", "qz"))
    angles = _columns(trajectory.rpy, ("roll_rad", "pitch_rad", "yaw_rad"))
    write_table(table, time + position + quaternion + angles)
    rotation = _columns(xyzw(trajectory.quaternion), ("qx", "qy", "qz", "qw"))
    write_table(tum, time + position + rotation, separator=" ", header=False)
    return [table, tum]


def _columns(values: NDArray[np.float64], names: tuple[str, ...]) -> list[Column]:
    return [Column(name=name, values=values[:, n], form="%.9f") for n, name in enumerate(names)]
