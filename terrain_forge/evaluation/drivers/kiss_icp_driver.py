"""KISS-ICP (Vizzo et al. 2023, doi:10.1109/LRA.2023.3236571): RECORDING TRAJECTORY LIDAR [deskew].

Its deskewing takes the motion of the sweep before for that of this one: of a rover that moves
centimetres between sweeps that feeds its own jitter back, so it is off unless asked for. All else
is as in `calibration/kiss_icp/config.yaml`. What is left of its map at the end is map.npy.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from kiss_icp.config import load_config
from kiss_icp.kiss_icp import KissICP
from recorded import (
    figure,
    places_and_times,
    quaternion_of,
    sweeps,
    tell_own_work,
    write_pose,
)

dataset, output, lidar, *words = sys.argv[1:]
config = load_config(None)
config.data.deskew = "deskew" in words
config.data.min_range = figure(Path(dataset), lidar, "range_min_m")
config.data.max_range = figure(Path(dataset), lidar, "range_max_m")
config.mapping.voxel_size = 0.5
config.registration.max_num_threads = 1
odometry = KissICP(config)
with Path(output).open("w", encoding="utf-8") as file:
    for stamp, points in sweeps(Path(dataset), lidar):
        odometry.register_frame(*places_and_times(points))
        pose = odometry.last_pose
        write_pose(file, stamp, pose[:3, 3], quaternion_of(pose[:3, :3]))
np.save("map.npy", np.asarray(odometry.local_map.point_cloud()))
tell_own_work()
