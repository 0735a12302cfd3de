"""ROS 1 bags."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from terrain_forge.base import ExportError, Progress, Spec
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.ros import RosBag, RosMessages, RosOptions, in_order, losses
from terrain_forge.datasets.ros_parts import TRANSFORMS

NAME = "recording.bag"


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
        return losses(messages)
