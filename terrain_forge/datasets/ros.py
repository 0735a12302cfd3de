"""ROS messages of a recording, in the order of their stamps; the same for ROS 1 and ROS 2."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter, itemgetter
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from terrain_forge.base import (
    Array,
    FileName,
    Progress,
    RecipeError,
    Spec,
    inverse_pose,
    portable,
    quaternion_from_matrix,
)
from terrain_forge.datasets import sizes
from terrain_forge.datasets.clouds import (
    Layout,
    layout_of,
    layout_of_preset,
    packed,
    point_size,
    require_held,
)
from terrain_forge.datasets.pictures import RECTIFIED, picture_losses
from terrain_forge.datasets.poses import Poses, rates, velocities
from terrain_forge.datasets.reader import BASE, Recording
from terrain_forge.datasets.ros_cameras import CameraMessages
from terrain_forge.datasets.ros_frames import WORLD, frames_of, is_own
from terrain_forge.datasets.ros_parts import TRANSFORMS, Pair, RosParts
from terrain_forge.datasets.ros_series import (
    ODOMETRY,
    odometry_message,
    series_kind,
    series_messages,
)
from terrain_forge.datasets.sizes import Footprint
from terrain_forge.datasets.streams import (
    RecordedCamera,
    RecordedLidar,
    RecordedSensor,
    RecordedSeries,
)
from terrain_forge.datasets.writer import DatasetWriter, needed

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

TRUTH_TOPIC = "/ground_truth/odometry"
_INFO_SIZE, _CLOUD_HEAD = 560.0, 400.0
"""Bytes of a picture's message and its calibration but for the pixels, of a cloud's but for the
points, in a bag."""
_ROWS = {"imu": 400.0, "odometry": 800.0, "sun": 120.0, "inclinometer": 120.0, "tf": 180.0}
"""Bytes of the messages of tables."""
_DATATYPES = {"f4": 7, "u4": 6, "u2": 4, "u1": 2}


@dataclass(frozen=True, kw_only=True)
class RosOptions(Spec):
    """Options of both kinds of bags."""

    sensors: tuple[FileName, ...] = ()
    """Names or folders (`cam0`) of the sensors to write; all by default."""
    cloud: Literal["lidar", "velodyne", "ouster"] = "lidar"
    """Layout of point clouds: that of the lidar's own driver, or one of the two."""
    ring_bits: Literal[8, 16] = 8
    """Bits of `ring` in Ouster's layout: 8 in older drivers and FAST-LIO, 16 in newer ones."""
    truth: Literal["odometry", "tf", "both", "none"] = "odometry"
    """Where the true pose of base_link goes: `odometry`, to /ground_truth/odometry; `tf`, to /tf,
    where a system's own answer would be a second parent of base_link. Frames of sensors that move
    against base_link are always there."""
    pictures: bool = True
    """Write the cameras' pictures."""
    depth: bool = False
    """Write the cameras' true depth as images of 32-bit metres; where it is that of rectified
    pictures beside raw ones, these too."""

    def __post_init__(self) -> None:
        if self.depth and not self.pictures:
            raise RecipeError("has no effect: pictures is false", key=("depth",))


class RosBag(DatasetWriter):
    """A format of bags, which a module of rosbags writes."""

    naming: ClassVar[tuple[str, ...]] = ("sensors",)
    library: ClassVar[str]
    """The module."""

    def check(self, recording: Recording, options: Any) -> None:
        """Refuse names of sensors that were not recorded, and clouds that a layout cannot hold."""
        needed(self.library, f"the format {self.kind}")
        for name in options.sensors:
            recording.sensor(name)
        for one in _written(recording, options):
            if isinstance(one, RecordedLidar) and _layout(recording, one, options) == "ouster":
                require_held(one, self.kind, options.ring_bits)

    def size(self, footprints: Sequence[Footprint], options: Any) -> float:
        """Of pictures each value, of clouds each point, of all else messages of one length."""
        own = [one for one in footprints if one.name]
        named = [one for one in own if any(map(one.is_called, options.sensors or ("",)))]
        found = 0.0
        for one in sizes.cameras(named) if options.pictures else ():
            each = one.pixels * one.colours + _INFO_SIZE
            if options.depth and "depth" in one.sizes:
                each += 4 * one.pixels + _INFO_SIZE
                each += one.pixels * one.colours if RECTIFIED in one.sizes else 0
            found += one.count * each
        for one in sizes.lidars(named):
            layout = options.cloud if options.cloud != "lidar" else layout_of_preset(one.preset)
            found += one.count * (point_size(layout) * sizes.points(one) + _CLOUD_HEAD)
        for one in sizes.tables(named):
            found += one.count * _ROWS.get(one.key.rstrip("0123456789"), 0.0)
        truth = sum(one.count for one in footprints if not one.name)
        told = {"odometry": ("odometry", "both"), "tf": ("tf", "both")}
        return found + truth * sum(_ROWS[k] for k, when in told.items() if options.truth in when)


@dataclass(frozen=True, kw_only=True)
class Message:
    """A message of a bag."""

    stamp: int
    """Of its header and of the bag [ns]."""
    order: int
    """Of its topic in the bag."""
    value: Any
    """The message."""


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A topic of a bag."""

    name: str
    """With a leading slash."""
    kind: str
    """Type of its messages."""
    messages: Callable[[int], Iterator[Message]]
    """Its messages, given its place in the bag."""
    latched: bool = False
    """Whether who comes late still gets its last message."""


class RosMessages:
    """Makes the messages of a recording.

    Args:
        recording: The recording.
        store: The types of a version of ROS.
        options: What is written and how.
    """

    def __init__(self, recording: Recording, store: Typestore, options: RosOptions) -> None:
        self.recording, self.options, self.parts = recording, options, RosParts(store)
        self.sensors = _written(recording, options)
        self.frames = frames_of(recording)
        self.cameras = CameraMessages(recording, self.parts, self.frames)

    def topics(self) -> list[Topic]:
        """All topics, `/tf_static` first."""
        found = [self._topic("/tf_static", TRANSFORMS, self._static, latched=True)]
        clouds = 0
        for sensor in self.sensors:
            if isinstance(sensor, RecordedCamera):
                streams = self.cameras.streams(sensor, depth=self.options.depth)
                found += [self._topic(*stream) for stream in streams]
            elif isinstance(sensor, RecordedLidar):
                found.append(self._cloud_topic(sensor, clouds))
                clouds += 1
            elif isinstance(sensor, RecordedSeries) and (kind := series_kind(sensor)):
                found.append(self._topic(f"/{sensor.key}", kind, self._series(sensor)))
        truth = self.options.truth
        if truth in ("odometry", "both"):
            found.append(self._topic(TRUTH_TOPIC, ODOMETRY, self._odometry))
        if truth in ("tf", "both") or self._mounted(moving=True):
            found.append(self._topic("/tf", TRANSFORMS, self._transforms))
        return found

    def _transforms(self) -> Iterator[Pair]:
        """What is on /tf: sensors that move against base_link, and base_link where asked for."""
        streams = [self._moving(sensor) for sensor in self._mounted(moving=True)]
        streams += [self._tf()] if self.options.truth in ("tf", "both") else []
        return heapq.merge(*streams, key=itemgetter(0))

    def untold(self) -> list[str]:
        """Folders of sensors that no message is written for."""
        return [one.key for one in self.sensors if not _is_told(one)]

    def _topic(
        self, name: str, kind: str, pairs: Callable[[], Iterator[Pair]], **more: Any
    ) -> Topic:
        def messages(order: int) -> Iterator[Message]:
            return (Message(stamp=t, order=order, value=value) for t, value in pairs())

        return Topic(name=name, kind=kind, messages=messages, **more)

    def _static(self) -> Iterator[Pair]:
        begin = self.recording.span[0]
        transforms = []
        for sensor in self._mounted(moving=False):
            pose = self.recording.base_pose(sensor)
            turn = quaternion_from_matrix(pose[:3, :3])
            transforms.append(
                self.parts.transform(begin, BASE, self.frames[sensor.key], pose[:3, 3], turn)
            )
        yield begin, self.parts.make(TRANSFORMS, transforms)

    def _mounted(self, *, moving: bool) -> list[RecordedSensor]:
        """Sensors that sit on base_link, or on links that move against it."""
        there = (one for one in self.recording.sensors if "T_BS" in one.about)
        return [one for one in there if (self.recording.link_of(one.key) != BASE) == moving]

    def _moving(self, sensor: RecordedSensor) -> Iterator[Pair]:
        """Where a sensor that moves against base_link is in its frame, at the sensor's stamps."""
        if not sensor.span:
            return
        truth, base = self.recording.truth_of(sensor), self.recording.base_poses
        truth = truth[base.covering(truth.stamps, truth.stamps)]
        poses = portable.product(inverse_pose(base.at(truth.stamps).matrices), truth.matrices)
        turns, frame = quaternion_from_matrix(poses[:, :3, :3]), self.frames[sensor.key]
        for number, stamp in enumerate(truth.stamps.tolist()):
            at = poses[number, :3, 3], turns[number]
            yield (
                stamp,
                self.parts.make(TRANSFORMS, [self.parts.transform(stamp, BASE, frame, *at)]),
            )

    def _cloud_topic(self, lidar: RecordedLidar, number: int) -> Topic:
        layout = _layout(self.recording, lidar, self.options)

        def clouds() -> Iterator[Pair]:
            for index, stamp in enumerate(lidar.stamps.tolist()):
                points = packed(lidar.sweep(index), layout, self.options.ring_bits)
                yield stamp, self._cloud(stamp, self.frames[lidar.key], points)

        name = "/velodyne_points" if layout == "velodyne" else "/ouster/points"
        name = f"/{lidar.key}{name}" if number else name
        return self._topic(name, "sensor_msgs/msg/PointCloud2", clouds)

    def _cloud(self, stamp: int, frame: str, points: Any) -> Any:
        fields = [
            self.parts.make("sensor_msgs/msg/PointField", name, offset, _DATATYPES[kind.str[1:]], 1)
            for name, (kind, offset) in points.dtype.fields.items()
        ]
        step, count = points.dtype.itemsize, len(points)
        data = np.frombuffer(points.tobytes(), np.uint8)
        return self.parts.make(
            "sensor_msgs/msg/PointCloud2",
            *(self.parts.header(stamp, frame), 1, count, fields),
            *(False, step, step * count, data, True),
        )

    def _series(self, table: RecordedSeries) -> Callable[[], Iterator[Pair]]:
        return lambda: series_messages(self.parts, table, self.frames[table.key])

    def _base_states(self) -> Iterator[tuple[Poses, Array, Array]]:
        """True poses of base_link, its velocity and rate in its own frame, in pieces.

        Where the body moves against it, they are base_link's own, and so is what follows of them.
        """
        if self.recording.link_of(self.recording.body_name) != BASE:
            poses = self.recording.base_poses
            turn = np.swapaxes(poses.matrices[:, :3, :3], -1, -2)
            own = (turn * velocities(poses)[:, None, :]).sum(axis=-1)
            yield poses, own, rates(poses)
            return
        body = inverse_pose(self.recording.base_from_body)
        for poses, velocity, kept in self.recording.body_pieces():
            rate = rates(poses)
            turn = np.swapaxes(poses.matrices[:, :3, :3], -1, -2)
            own = (turn * velocity[:, None, :]).sum(axis=-1) + np.cross(rate, body[:3, 3])
            into = body[:3, :3]  # rows of vectors, from the body's frame to base_link's
            base = poses.carrying(body)[kept]
            yield base, portable.product(own, into)[kept], portable.product(rate, into)[kept]

    def _odometry(self) -> Iterator[Pair]:
        none = np.zeros(36)
        for poses, velocity, rate in self._base_states():
            for number, stamp in enumerate(poses.stamps.tolist()):
                yield (
                    stamp,
                    odometry_message(
                        self.parts,
                        self.parts.header(stamp, WORLD),
                        (poses.position[number], poses.quaternion[number], none),
                        (velocity[number], rate[number], none),
                    ),
                )

    def _tf(self) -> Iterator[Pair]:
        for poses, _, _ in self._base_states():
            for number, stamp in enumerate(poses.stamps.tolist()):
                at = poses.position[number], poses.quaternion[number]
                yield (
                    stamp,
                    self.parts.make(TRANSFORMS, [self.parts.transform(stamp, WORLD, BASE, *at)]),
                )


def _is_told(sensor: RecordedSensor) -> bool:
    """Whether there are messages for a sensor."""
    if isinstance(sensor, RecordedSeries):
        return bool(series_kind(sensor))
    return isinstance(sensor, RecordedCamera | RecordedLidar)


def _written(recording: Recording, options: RosOptions) -> list[RecordedSensor]:
    """The sensors that are written."""
    named = {recording.sensor(name).key for name in options.sensors}
    chosen = (s for s in recording.sensors if not named or s.key in named)
    return [s for s in chosen if options.pictures or not isinstance(s, RecordedCamera)]


def _layout(recording: Recording, lidar: RecordedLidar, options: RosOptions) -> Layout:
    """The layout of a lidar's clouds."""
    return layout_of(recording, lidar) if options.cloud == "lidar" else options.cloud


def in_order(topics: list[Topic], span: tuple[int, int], progress: Progress) -> Iterator[Message]:
    """Messages of all topics by their stamps, the latched ones first; one of each is held."""
    streams = [topic.messages(number) for number, topic in enumerate(topics)]
    for number, topic in enumerate(topics):
        if topic.latched:
            yield from streams[number]
    begin, end = span
    told = 0.0
    live = [s for s, topic in zip(streams, topics, strict=True) if not topic.latched]
    for message in heapq.merge(*live, key=attrgetter("stamp", "order")):
        share = (message.stamp - begin) / max(end - begin, 1)
        if share >= told + 0.01:
            progress("writing a bag", told := share)
        yield message


def losses(messages: RosMessages) -> tuple[str, ...]:
    """What a bag does not say of a recording."""
    found = ["Instances, classes, normals, flow and shadows of pictures are not in the bag."]
    found += picture_losses(s for s in messages.sensors if isinstance(s, RecordedCamera))
    if untold := messages.untold():
        found.append(f"No message of ROS is written for {', '.join(untold)}.")
    sensors = messages.recording.sensors
    frames = messages.frames
    odd = [f"{one.name} ({frames[one.key]})" for one in sensors if not is_own(one, frames[one.key])]
    if odd:
        found.append(
            "Frames of these are called as their folders, as ROS has ASCII letters, digits "
            f"and _ alone, and each frame a name of its own: {', '.join(odd)}."
        )
    if any(sensor.key.startswith("lidar") for sensor in messages.sensors):
        found.append("Point clouds say nothing of what each point is on.")
    return tuple(found)
