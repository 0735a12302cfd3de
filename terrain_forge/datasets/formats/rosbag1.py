"""ROS 1 bags."""

from __future__ import annotations

from dataclasses import dataclass
from os import SEEK_CUR
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

from terrain_forge.base import ExportError, Progress, Spec
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.ros import RosBag, RosMessages, RosOptions, in_order, losses
from terrain_forge.datasets.ros_parts import TRANSFORMS

NAME = "recording.bag"
_HEADER_START, _HEADER_SIZE = 13, 4096
"""Where the record of the bag's own header begins, behind the version; its bytes but for the two
lengths within it, as ROS writes it."""


@dataclass(frozen=True, kw_only=True)
class Options(RosOptions):
    """Options of a ROS 1 bag."""


class Rosbag1(RosBag):
    """Writes one uncompressed bag of version 2.0."""

    kind: ClassVar[str] = "rosbag1"
    title: ClassVar[str] = "ROS 1 bag"
    Options: ClassVar[type[Spec]] = Options
    library: ClassVar[str] = "rosbags.rosbag1"

    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the bag."""
        from rosbags.rosbag1 import Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        store = get_typestore(Stores.ROS1_NOETIC)
        store.register(
            get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS)
        )
        messages = RosMessages(recording, store, options)
        topics = messages.topics()
        if recording.span[1] >= 2**32 * 10**9:
            raise ExportError("rosbag1 holds stamps up to the year 2106")
        with Writer(folder / NAME) as bag:
            _make_room(bag.bio)
            connections = [
                bag.add_connection(
                    *(topic.name, topic.kind),
                    typestore=store,
                    callerid="/terrain_forge" if topic.latched else None,
                    latching=1 if topic.latched else None,
                )
                for topic in topics
            ]
            for message in in_order(topics, recording.span, progress):
                data = store.serialize_ros1(message.value, topics[message.order].kind)
                bag.write(connections[message.order], message.stamp, data)
        _end_header(folder / NAME)
        return losses(messages)


def _make_room(file: BinaryIO | None) -> None:
    """Begin a bag's chunks where ROS does.

    ROS writes the header anew when it appends to a bag or reindexes it; one of rosbags ends earlier
    (0.11), and the first chunk was overwritten.
    """
    if file is not None:
        file.write(b" " * (_HEADER_START + 8 + _HEADER_SIZE - file.tell()))


def _end_header(path: Path) -> None:
    """Say in a bag's header that it reaches to the first chunk."""
    with path.open("r+b") as file:
        file.seek(_HEADER_START)
        size = int.from_bytes(file.read(4), "little")
        file.seek(size, SEEK_CUR)
        file.write((_HEADER_SIZE - size).to_bytes(4, "little"))
