"""Layouts of point clouds: which field lies where, as drivers of lidars have them."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import ExportError, inverse_pose
from terrain_forge.datasets.poses import Poses, Stamps
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
    return layout_of_preset(str(recording.recipe_of(lidar).get("preset", "")))


def layout_of_preset(preset: str) -> Layout:
    """The layout of the driver that a preset's figures are of."""
    return "ouster" if preset.startswith(("os0", "os1", "os2")) else "velodyne"


def point_size(layout: Layout) -> int:
    """Bytes of a point in a layout."""
    return _VELODYNE.itemsize if layout == "velodyne" else _ouster(8).itemsize


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


def require_held(lidar: RecordedLidar, kind: str, ring_bits: int) -> None:
    """Refuse a lidar whose rings or times Ouster's layout cannot hold.

    Raises:
        ExportError: says which.
    """
    rings = int(lidar.numbers("rings", (1,))[0])
    if rings > 2**ring_bits:
        raise ExportError(
            f"{kind}: {lidar.name} has {rings} rings, of which Ouster's layout holds "
            f"{2**ring_bits}: give it ring_bits: 16, or cloud: velodyne"
        )
    if lidar.sweep_s >= 2**32 * 1e-9 and not lidar.about.get("snapshot"):
        raise ExportError(
            f"{kind}: a sweep of {lidar.name} lasts {lidar.sweep_s:g} s, times of Ouster's "
            "layout end at 4.29 s: give it cloud: velodyne"
        )


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


class LidarMotion:
    """Where a lidar is between the samples of the truth, to move its points by."""

    def __init__(self, recording: Recording, lidar: RecordedLidar) -> None:
        """Prepare a lidar.

        Raises:
            ExportError: if it sits on a link whose motion was not recorded.
        """
        self._lidar, (self._carrier, self._pose) = lidar, recording.carrier(lidar)
        self.length = 0 if lidar.about.get("snapshot") else round(1e9 * lidar.sweep_s)
        """How long a sweep lasts [ns]; a snapshot is all at its begin."""

    def covers(self, begin: int) -> bool:
        """Whether the truth is known during a sweep."""
        return self._carrier.covers(begin, begin + self.length)

    def at(self, stamps: Stamps) -> Poses:
        """Poses of the lidar in the world."""
        return self._carrier.at(stamps).carrying(self._pose)

    def in_world(self, sweep: NDArray[Any], begin: int) -> NDArray[np.float64]:
        """Places of a sweep's points in the world [m], each by the pose at its own time."""
        when, which = np.unique(nanoseconds(sweep), return_inverse=True)
        return moved(places(sweep), self.at(begin + when).matrices[which])

    def seen_from(
        self, sweep: NDArray[Any], begin: int, pose: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Places of a sweep's points where the lidar sees them [m] from a pose, shape [4, 4].

        Those on the rover, which moves with the lidar, stay.
        """
        seen = moved(self.in_world(sweep, begin), inverse_pose(pose))
        return np.where(on_rover(sweep, self._lidar)[:, None], places(sweep), seen)


def on_rover(sweep: NDArray[Any], lidar: RecordedLidar) -> NDArray[np.bool_]:
    """Which points are on the rover itself."""
    if "instance" not in (sweep.dtype.names or ()) or "rover" not in lidar.codes:
        return np.zeros(len(sweep), np.bool_)
    return np.asarray(sweep["instance"] == lidar.codes["rover"])


def moved(points: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points, shape [points, 3], by a pose, or each by its own; summed in a fixed order."""
    turned = poses[..., :3, 0] * points[:, :1] + poses[..., :3, 1] * points[:, 1:2]
    return np.asarray(turned + poses[..., :3, 2] * points[:, 2:] + poses[..., :3, 3])
