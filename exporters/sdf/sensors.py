"""The rover's sensors on an actor: stereo camera, lidar and IMU with their noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Rover, Sensor
from terrain_forge.writers import identifier

from .markup import Lines, element, numbers

_NEAR, _FAR = 0.02, 300.0
"""What a camera sees at least [m]."""
_BIAS_TIME = {"gyro": 1000.0, "accelerometer": 300.0}
"""Correlation times of the IMU's biases [s], those of the ADIS16448 model of RotorS."""


@dataclass(frozen=True, kw_only=True)
class Topic:
    """What a sensor publishes in gz-sim, and what ROS 2 calls it."""

    name: str
    """Topic, without a leading slash."""
    gz_type: str
    """Type of its messages in Gazebo."""
    ros_type: str
    """Type of the ROS message that the bridge makes of them."""


def rig_sensors(rover: Rover, *, actor: str, flavour: str, reach: float) -> list[Lines]:
    """The `<sensor>` elements of a rover's rig, in the frame of base_link.

    In Gazebo Classic the cameras are one multicamera, which takes their images at the same moment.

    Args:
        rover: The rover.
        actor: Name of the actor, in the sensors' topics.
        flavour: `gz` or `classic`.
        reach: Size of the world, which the cameras shall see [m].
    """
    poses = _poses(rover)
    far = max(_FAR, reach)
    cameras = [sensor for sensor in rover.sensors if sensor.kind == "camera"]
    others = [sensor for sensor in rover.sensors if sensor.kind != "camera"]
    if flavour == "classic" and cameras:
        sensors = [_multicamera(cameras, poses, far)]
    else:
        sensors = [_camera(s, poses[s.name], far, f"{topic(actor, s)}/image") for s in cameras]
    for sensor in others:
        make = {"lidar": _lidar, "imu": _imu}[sensor.kind]
        sensors.append(make(sensor, poses[sensor.name], flavour, topic(actor, sensor)))
    return sensors


def rig_topics(rover: Rover, *, actor: str) -> list[Topic]:
    """What the sensors of an actor publish in gz-sim."""
    topics = []
    for sensor in rover.sensors:
        name = topic(actor, sensor)
        if sensor.kind == "camera":
            topics.append(Topic(name=f"{name}/image", gz_type="Image", ros_type="Image"))
            info = {"gz_type": "CameraInfo", "ros_type": "CameraInfo"}
            topics.append(Topic(name=f"{name}/camera_info", **info))
        elif sensor.kind == "lidar":
            cloud = {"gz_type": "PointCloudPacked", "ros_type": "PointCloud2"}
            topics.append(Topic(name=f"{name}/points", **cloud))
        elif sensor.kind == "imu":
            topics.append(Topic(name=name, gz_type="IMU", ros_type="Imu"))
    return topics


def topic(actor: str, sensor: Sensor) -> str:
    """Topic of a sensor; a camera adds a level, so that two of them do not share camera_info."""
    return f"{identifier(actor)}/{identifier(sensor.name)}"


def _poses(rover: Rover) -> dict[str, Array]:
    """Pose of each sensor in base_link's frame, x y z roll pitch yaw [m, rad]."""
    origins: dict[str, Array] = {}
    for link in rover.links:
        origins[link.name] = origins.get(link.parent, np.zeros(3)) + link.origin
    return {s.name: np.hstack([origins[s.link] + s.position, s.rpy]) for s in rover.sensors}


def _sensor(name: str, kind: str, rate: float, *content: Lines) -> Lines:
    return element(
        "sensor", element("update_rate", numbers([rate])), *content, name=name, type=kind
    )


def _pose(pose: Array) -> Lines:
    return element("pose", numbers(pose))


def _camera(sensor: Sensor, pose: Array, far: float, address: str) -> Lines:
    return _sensor(
        sensor.name,
        "camera",
        dict(sensor.properties)["rate"],
        _pose(pose),
        element("topic", address),
        element("camera", *_lens(sensor, far)),
    )


def _multicamera(cameras: list[Sensor], poses: dict[str, Array], far: float) -> Lines:
    lenses = [
        element("camera", _pose(poses[sensor.name]), *_lens(sensor, far), name=sensor.name)
        for sensor in cameras
    ]
    return _sensor("cameras", "multicamera", dict(cameras[0].properties)["rate"], *lenses)


def _lens(sensor: Sensor, far: float) -> list[Lines]:
    figures = dict(sensor.properties)
    size = [
        element("width", f"{figures['width_px']:.0f}"),
        element("height", f"{figures['height_px']:.0f}"),
        element("format", "R8G8B8"),
    ]
    clip = [element("near", numbers([_NEAR])), element("far", numbers([far]))]
    return [
        element("horizontal_fov", numbers([figures["horizontal_fov"]])),
        element("image", *size),
        element("clip", *clip),
        *_noise_of(figures.get("noise", 0.0)),
    ]


def _lidar(sensor: Sensor, pose: Array, flavour: str, address: str) -> Lines:
    figures = dict(sensor.properties)
    columns, half = figures["horizontal_samples"], figures["vertical_fov"] / 2
    # A full turn: the last column is one step short of the first.
    around = _angles(columns, -math.pi, math.pi - 2 * math.pi / columns)
    scan = element(
        "scan",
        element("horizontal", *around),
        element("vertical", *_angles(figures["channels"], -half, half)),
    )
    span = element(
        "range",
        element("min", numbers([figures["range_min"]])),
        element("max", numbers([figures["range_max"]])),
    )
    rays = [scan, span, *_noise_of(figures.get("noise", 0.0))]
    kind, tag = {"gz": ("gpu_lidar", "lidar"), "classic": ("ray", "ray")}[flavour]
    named = [element("topic", address)] if flavour == "gz" else []
    return _sensor(sensor.name, kind, figures["rate"], _pose(pose), *named, element(tag, *rays))


def _angles(samples: float, low: float, high: float) -> list[Lines]:
    return [
        element("samples", f"{samples:.0f}"),
        element("resolution", "1"),
        element("min_angle", numbers([low])),
        element("max_angle", numbers([high])),
    ]


def _imu(sensor: Sensor, pose: Array, flavour: str, address: str) -> Lines:
    figures = dict(sensor.properties)
    parts = [
        element(tag, *(element(axis, *_axis_noise(figures, name)) for axis in "xyz"))
        for tag, name in (("angular_velocity", "gyro"), ("linear_acceleration", "accelerometer"))
    ]
    named = [element("topic", address)] if flavour == "gz" else []
    return _sensor(sensor.name, "imu", figures["rate"], _pose(pose), *named, element("imu", *parts))


def _axis_noise(figures: dict[str, float], name: str) -> list[Lines]:
    """Noise of one axis. Gazebo's `stddev` is that of a sample, not a density: density · √rate."""
    deviation = figures.get(f"{name}_noise", 0.0) * math.sqrt(figures["rate"])
    walk = figures.get(f"{name}_walk", 0.0)
    bias = [
        element("dynamic_bias_stddev", numbers([walk])),
        element("dynamic_bias_correlation_time", numbers([_BIAS_TIME[name]])),
    ]
    noise = [element("mean", "0"), element("stddev", numbers([deviation]))]
    return [element("noise", *noise, *(bias if walk else []), type="gaussian")]


def _noise_of(deviation: float) -> list[Lines]:
    """White noise of the given standard deviation, or none."""
    if not deviation:
        return []
    kind, mean = element("type", "gaussian"), element("mean", "0")
    return [element("noise", kind, mean, element("stddev", numbers([deviation])))]
