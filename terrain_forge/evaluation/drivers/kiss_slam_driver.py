"""KISS-SLAM (Guadagnino et al. 2025, doi:10.48550/arXiv.2503.12660): RECORDING TRAJECTORY LIDAR.

Its odometry is KISS-ICP as that driver has it, but of a range of 25 m, and local maps end after
10 m, where for cars both are 100 m: maps that see most of a site close with their neighbours
instead of with a place that is met again. All of them, in the trajectory's frame, are map.npy;
loops.txt tells the loop closures.

Its loop closures join two local maps, not two sweeps: told are those sweeps of the two maps that
are nearest to each other as the closure lays the maps.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from kiss_slam.config import load_config
from kiss_slam.slam import KissSLAM
from recorded import (
    figure,
    places_and_times,
    quaternion_of,
    seconds,
    sweeps,
    tell_own_work,
    write_pose,
)

_RANGE_M, _SPLIT_M = 25.0, 10.0


def main(dataset: Path, output: Path, lidar: str) -> None:
    """Lead all sweeps through it."""
    slam = KissSLAM(_config(dataset, lidar))
    closures = _listen(slam)
    stamps: list[int] = []
    firsts = [0]
    for stamp, points in sweeps(dataset, lidar):
        slam.process_scan(*places_and_times(points))
        if len(slam.local_map_graph.graph) > len(firsts):
            firsts.append(len(stamps))  # where the new local map begins
        stamps.append(stamp)
    slam.generate_new_node()
    slam.local_map_graph.erase_last_local_map()
    poses, _ = slam.fine_grained_optimization()
    with output.open("w", encoding="utf-8") as file:
        for stamp, pose in zip(stamps, poses, strict=True):
            write_pose(file, stamp, pose[:3, 3], quaternion_of(pose[:3, :3]))
    maps = list(slam.local_map_graph.local_maps())
    np.save("map.npy", np.concatenate([_points(part) for part in maps]))
    with Path("loops.txt").open("w", encoding="ascii") as file:
        for older, newer, motion in closures:
            here, there, between = _nearest(maps[newer], maps[older], motion)
            times = seconds(stamps[firsts[newer] + here]), seconds(stamps[firsts[older] + there])
            file.write(" ".join([*times, *(f"{value:.6f}" for value in between)]) + "\n")


def _config(dataset: Path, lidar: str) -> Any:
    config = load_config(None)
    config.odometry.preprocessing.deskew = False
    config.odometry.preprocessing.min_range = figure(dataset, lidar, "range_min_m")
    most = figure(dataset, lidar, "range_max_m")
    config.odometry.preprocessing.max_range = min(most, _RANGE_M)
    config.odometry.mapping.voxel_size = 0.5
    config.odometry.registration.max_num_threads = 1
    config.local_mapper.splitting_distance = _SPLIT_M
    return config


def _listen(slam: Any) -> list[tuple[int, int, Any]]:
    """Its loop closures as they are found: older and newer local map, and from older to newer."""
    found: list[tuple[int, int, Any]] = []
    compute = slam.closer.compute

    def kept(*given: Any) -> Any:
        good, older, newer, motion = compute(*given)
        if good:
            found.append((older, newer, np.array(motion)))
        return good, older, newer, motion

    slam.closer.compute = kept
    return found


def _points(part: Any) -> Any:
    """A local map's points in the frame of the trajectory [m], shape [n, 3]."""
    points = part.pcd.point.positions.numpy().astype(np.float64)
    return points @ part.keypose[:3, :3].T + part.keypose[:3, 3]


def _nearest(newer: Any, older: Any, motion: Any) -> tuple[int, int, Any]:
    """The poses of two local maps nearest to each other, and the older's place from the newer's.

    Args:
        newer: A local map.
        older: Another.
        motion: From the older one's frame to the newer one's, shape [4, 4].
    """
    here = np.array(newer.local_trajectory)
    there = motion @ np.array(older.local_trajectory)
    between = there[None, :, :3, 3] - here[:, None, :3, 3]
    n, m = np.unravel_index(np.argmin((between**2).sum(axis=-1)), between.shape[:2])
    return int(n), int(m), here[n, :3, :3].T @ between[n, m]


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
    tell_own_work()
