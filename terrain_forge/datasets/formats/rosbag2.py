"""ROS 2 bags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from terrain_forge.base import ExportError, Progress, Spec
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.ros import RosBag, RosMessages, RosOptions, in_order, losses
from terrain_forge.datasets.sizes import Footprint

_VERSION: Literal[8] = 8
"""Of the metadata: what Humble and later read."""
_COMPRESSED = 0.6
"""About what zstd leaves."""


@dataclass(frozen=True, kw_only=True)
class Options(RosOptions):
    """Options of a ROS 2 bag."""

    storage: Literal["mcap", "sqlite3"] = "mcap"
    """What the bag's file is."""
    compression: Literal["none", "zstd"] = "none"
    """`zstd` compresses the chunks of an mcap, which all its readers understand; sqlite3 has no
    such chunks."""


class Rosbag2(RosBag):
    """Writes a bag: a folder with metadata.yaml and one file."""

    kind: ClassVar[str] = "rosbag2"
    title: ClassVar[str] = "ROS 2 bag"
    Options: ClassVar[type[Spec]] = Options
    library: ClassVar[str] = "rosbags.rosbag2"

    def check(self, recording: Recording, options: Any) -> None:
        """Also refuse compressed sqlite3."""
        super().check(recording, options)
        if options.storage == "sqlite3" and options.compression != "none":
            raise ExportError("rosbag2: compression zstd needs storage mcap, not sqlite3")

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """Of a bag, or what compression leaves of it."""
        share = _COMPRESSED if options.compression == "zstd" else 1.0
        return share * super().size(footprints, options)

    def write(
        self, recording: Recording, folder: Path, options: Any, progress: Progress
    ) -> tuple[str, ...]:
        """Write the bag."""
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS2_HUMBLE)
        messages = RosMessages(recording, store, options)
        topics = messages.topics()
        folder.rmdir()  # the library makes it
        storage = StoragePlugin.MCAP if options.storage == "mcap" else StoragePlugin.SQLITE3
        writer = Writer(folder, version=_VERSION, storage_plugin=storage)
        if options.compression == "zstd":
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer as bag:
            connections = [
                bag.add_connection(
                    *(topic.name, topic.kind),
                    typestore=store,
                    offered_qos_profiles=[_quality(latched=topic.latched)],
                )
                for topic in topics
            ]
            for message in in_order(topics, recording.span, progress):
                data = store.serialize_cdr(message.value, topics[message.order].kind)
                bag.write(connections[message.order], message.stamp, data)
        return losses(messages)


def _quality(*, latched: bool) -> Any:
    """Reliable; what is latched is kept for those who come late, as `/tf_static` must be."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    unlimited = QosTime(9223372036, 854775807)
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=durability,
        deadline=unlimited,
        lifespan=unlimited,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=unlimited,
        avoid_ros_namespace_conventions=False,
    )
