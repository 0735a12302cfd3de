"""RKO-LIO (Malladi et al. 2025, arXiv:2509.06593): RECORDING TRAJECTORY [key=value …].

Lidar and IMU; the trajectory is the IMU's, at the ends of the sweeps. It takes gravity for Earth's.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from recorded import about, sweeps, table, transform, write_pose
from rko_lio.config import LIOConfig
from rko_lio.lio import LIO


def main(dataset: Path, output: Path, words: list[str]) -> None:
    """Lead all sweeps, and what the IMU felt until their ends, through it."""
    config = LIOConfig(max_num_threads=1, min_range=0.5, voxel_size=0.5, initialization_phase=True)
    for word in words:
        key, _, value = word.partition("=")
        known = getattr(config, key)
        new = value == "true" if isinstance(known, bool) else type(known)(value)
        setattr(config, key, new)
    odometry = LIO(config)
    lidar = np.linalg.inv(transform(dataset, "imu0")) @ transform(dataset, "lidar0")
    streams = {Path(one["folder"]).name: one for one in about(dataset)["streams"]}
    period = round(1e9 / float(streams["lidar0"]["rate_hz"]))
    stamps, felt = table(dataset, "imu0")
    row = 0
    for stamp, points in sweeps(dataset, "lidar0"):
        end = stamp + period
        while row < len(stamps) and stamps[row] <= end:
            odometry.add_imu_measurement(felt[row, 3:6], felt[row, :3], int(stamps[row]), np.eye(4))
            row += 1
        places = np.column_stack([points[axis] for axis in "xyz"]).astype(np.float64)
        times = stamp + np.round(points["time"].astype(np.float64) * 1e9).astype(np.int64)
        odometry.register_scan(places, times, lidar, stamp, end)
    with output.open("w", encoding="utf-8") as file:
        for stamp, pose in zip(*odometry.poses_with_timestamps(), strict=True):
            write_pose(file, int(stamp), pose[:3], pose[3:7])


main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
