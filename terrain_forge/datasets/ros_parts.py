"""Parts of ROS messages, which ROS 1 and ROS 2 have alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from terrain_forge.base import Array, xyzw

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

TRANSFORMS = "tf2_msgs/msg/TFMessage"
Pair = tuple[int, Any]
"""A stamp [ns] and the message that has it."""


class RosParts:
    """Makes messages and parts of them, of the types of a version of ROS."""

    def __init__(self, store: Typestore) -> None:
        self._types = store.types
        self._is_first = "seq" in self._types["std_msgs/msg/Header"].__annotations__

    def make(self, kind: str, *values: Any) -> Any:
        """A message or a part of one, its fields in their order."""
        return self._types[kind](*values)

    def header(self, stamp: int, frame: str) -> Any:
        """A header; ROS 1 counts messages, which is done by who plays them."""
        time = self.make("builtin_interfaces/msg/Time", *divmod(stamp, 10**9))
        first = (0,) if self._is_first else ()
        return self.make("std_msgs/msg/Header", *first, time, frame)

    def vector(self, values: Array) -> Any:
        """Three numbers."""
        return self.make("geometry_msgs/msg/Vector3", *map(float, values))

    def turn(self, quaternion: Array) -> Any:
        """A quaternion, of (w, x, y, z)."""
        return self.make("geometry_msgs/msg/Quaternion", *map(float, xyzw(quaternion)))

    def transform(self, stamp: int, parent: str, child: str, place: Array, turn: Array) -> Any:
        """Where a child frame is in its parent's."""
        moved = self.make("geometry_msgs/msg/Transform", self.vector(place), self.turn(turn))
        header = self.header(stamp, parent)
        return self.make("geometry_msgs/msg/TransformStamped", header, child, moved)
