"""Layouts of point clouds: which field lies where, as drivers of lidars have them."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.datasets.poses import Poses, Stamps, inverse_pose
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.streams import RecordedLidar

Layout = Literal["velodyne", "ouster"]

_VELODYNE = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": [0, 4, 8, 12, 16, 18],
        "itemsize": 22,
    }
)
_OUSTER_NAMES = ["x", "y", "z", "intensity", "t", "reflectivity", "ring", "ambient", "range"]


def layout_of(recording: Recording, lidar: RecordedLidar) -> Layout:
    """The layout of the driver that a lidar's figures are of: Ouster's, or else Velodyne's."""
    preset = str(recording.recipe_of(lidar).get("preset", ""))
    return "ouster" if preset.startswith(("os0", "os1", "os2")) else "velodyne"


def packed(points: NDArray[Any], layout: Layout, ring_bits: int = 8) -> NDArray[Any]:
    """Points of a sweep as a driver lays them out.

    Velodyne's `time` is in seconds, Ouster's `t` in nanoseconds, both from the first firing; its
    `range` is in millimetres. Its driver's `ring` has 8 bits in older and 16 in newer versions.
    """
    found = np.zeros(len(points), _VELODYNE if layout == "velodyne" else _ouster(ring_bits))
    for name in ("x", "y", "z", "intensity", "ring"):
        found[name] = points[name]
    if layout == "velodyne":
        found["time"] = points["time"]
        return found
    found["t"] = nanoseconds(points)
    found["reflectivity"] = np.clip(np.rint(points["intensity"]), 0, 2**16 - 1)
    squares = sum(points[name].astype(np.float64) ** 2 for name in ("x", "y", "z"))
    found["range"] = np.rint(1000.0 * np.sqrt(squares))
    return found


def _ouster(ring_bits: int) -> np.dtype[Any]:
    return np.dtype(
        {
            "names": _OUSTER_NAMES,
            "formats": [*["<f4"] * 4, "<u4", "<u2", f"<u{ring_bits // 8}", "<u2", "<u4"],
            "offsets": [0, 4, 8, 16, 20, 24, 26, 28, 32],
            "itemsize": 48,
        }
    )  # fmt: skip


def nanoseconds(points: NDArray[Any]) -> Stamps:
    """Times of points from their sweep's first firing [ns]."""
    return np.asarray(np.rint(points["time"].astype(np.float64) * 1e9), np.int64)


def places(points: NDArray[Any]) -> NDArray[np.float64]:
    """Places of points [m], shape [points, 3]."""
    return np.stack([points[name].astype(np.float64) for name in ("x", "y", "z")], axis=-1)


def in_world(points: NDArray[Any], begin: int, lidar_poses: Poses) -> NDArray[np.float64]:
    """Places of a sweep's points in the world [m], each by the pose at its own time.

    Args:
        points: The points, in the lidar's frame.
        begin: Stamp of the first firing [ns].
        lidar_poses: Poses of the lidar around the sweep, closer than its points' motion bends.
    """
    when, which = np.unique(nanoseconds(points), return_inverse=True)
    poses = lidar_poses.at(begin + when).matrices[which]
    return moved(places(points), poses)


def at_stamp(
    sweep: NDArray[Any], begin: int, stamp: int, lidar: RecordedLidar, lidar_poses: Poses
) -> NDArray[np.float64]:
    """Places of a sweep's points where the lidar sees them at a stamp [m], by the true motion.

    Those on the rover, which moves with the lidar, stay.
    """
    back = inverse_pose(lidar_poses.at(np.array([stamp])).matrices[0])
    seen = moved(in_world(sweep, begin, lidar_poses), back)
    return np.where(on_rover(sweep, lidar)[:, None], places(sweep), seen)


def on_rover(sweep: NDArray[Any], lidar: RecordedLidar) -> NDArray[np.bool_]:
    """Which points are on the rover itself."""
    if "instance" not in (sweep.dtype.names or ()) or "rover" not in lidar.codes:
        return np.zeros(len(sweep), np.bool_)
    return np.asarray(sweep["instance"] == lidar.codes["rover"])


def moved(points: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points, shape [points, 3], by a pose, or each by its own; summed in a fixed order."""
    turned = poses[..., :3, 0] * points[:, :1] + poses[..., :3, 1] * points[:, 1:2]
    return np.asarray(turned + poses[..., :3, 2] * points[:, 2:] + poses[..., :3, 3])
