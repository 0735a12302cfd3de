"""RKO-LIO (Malladi et al. 2025, arXiv:2509.06593): RECORDING TRAJECTORY LIDAR [key=value …].

Lidar and IMU; the trajectory is the IMU's, at the ends of the sweeps. It takes gravity for Earth's.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from recorded import (
    about,
    figure,
    own_work,
    sweep_s,
    sweeps,
    table,
    tell_own_work,
    transform,
    write_pose,
)  # fmt: skip
from rko_lio.config import LIOConfig
from rko_lio.lio import LIO


def main(dataset: Path, output: Path, lidar: str, words: list[str]) -> None:
    """Lead all sweeps, and what the IMU felt until their ends, through it."""
    told = about(dataset)
    config = LIOConfig(max_num_threads=1, voxel_size=0.5, initialization_phase=True)
    config.min_range = figure(dataset, lidar, "range_min_m")
    config.max_range = figure(dataset, lidar, "range_max_m")
    for word in words:
        key, _, value = word.partition("=")
        known = getattr(config, key)
        new = value == "true" if isinstance(known, bool) else type(known)(value)
        setattr(config, key, new)
    odometry = LIO(config)
    mounted = np.linalg.inv(transform(dataset, told["body"])) @ transform(dataset, lidar)
    period = round(1e9 * sweep_s(dataset, lidar))
    stamps, felt = table(dataset, told["body"])
    row = 0
    for stamp, points in sweeps(dataset, lidar):
        end = stamp + period
        while row < len(stamps) and stamps[row] <= end:
            odometry.add_imu_measurement(felt[row, 3:6], felt[row, :3], int(stamps[row]), np.eye(4))
            row += 1
        with own_work():
            places = np.column_stack([points[axis] for axis in "xyz"]).astype(np.float64)
            times = stamp + np.round(points["time"].astype(np.float64) * 1e9).astype(np.int64)
        odometry.register_scan(places, times, mounted, stamp, end)
    with output.open("w", encoding="utf-8") as file:
        for stamp, pose in zip(*odometry.poses_with_timestamps(), strict=True):
            write_pose(file, int(stamp), pose[:3], pose[3:7])
    tell_own_work()


main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4:])
