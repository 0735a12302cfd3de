"""The rover as a tree of bodies with motors and sensors."""

from __future__ import annotations

import math

import numpy as np

from terrain_forge.frames import matrix_from_quaternion, quaternion_from_rpy
from terrain_forge.rovers.description import Link, Rover, Sensor, Shape

from .xml import element

# A velocity servo stiff enough to hold the commanded rate on slopes; the armature stands for the
# gear train and keeps the light wheels from chattering against the ground.
_SERVO_GAIN = 100.0
_WHEEL_ARMATURE = 0.05
# MuJoCo's cameras look along -z with x to the right; ours along x with y to the left.
_CAMERA_AXES = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def rover_classes(friction: float) -> list[str]:
    """Default classes of the rover's geoms; wheels decide the contact, whatever they roll on."""
    grip = (friction, 0.005, 0.0001)
    unseen = element("default", [element("geom", contype=0, conaffinity=0)], class_="visual")
    wheel = element(
        "geom",
        priority=1,
        condim=3,
        friction=grip,
        solref=(0.04, 1.0),
        solimp=(0.9, 0.95, 0.001),
    )
    contact = element("geom", group=2, contype=1, conaffinity=0, friction=grip)
    rover = [contact, unseen, element("default", [wheel], class_="wheel")]
    return [element("default", rover, class_="rover")]


def rover_body(rover: Rover, position: np.ndarray, quaternion: np.ndarray) -> str:
    """The rover's root body, placed in the world, with everything that hangs on it."""
    return _body(rover, rover.links[0], pos=position, quat=quaternion)


def rover_actuators(rover: Rover) -> list[str]:
    """A velocity servo per wheel; its control is the wheel's rate [rad/s]."""
    return [
        element(
            "velocity",
            name=wheel.link,
            joint=wheel.link,
            kv=_SERVO_GAIN,
            ctrlrange=(-rover.speed_limit / wheel.radius, rover.speed_limit / wheel.radius),
            forcerange=(-rover.torque_limit, rover.torque_limit),
        )
        for wheel in rover.wheels
    ]


def rover_sensors(rover: Rover) -> list[str]:
    """True pose and velocity of the root, inertial sensors, wheel and rocker rates."""
    root = rover.links[0].name
    pose = [
        element("framepos", name=f"{root}_position", objtype="xbody", objname=root),
        element("framequat", name=f"{root}_orientation", objtype="xbody", objname=root),
        element("framelinvel", name=f"{root}_velocity", objtype="xbody", objname=root),
    ]
    inertial = [
        element(kind, name=f"{sensor.name}_{kind}", site=sensor.name)
        for sensor in rover.sensors
        if sensor.kind == "imu"
        for kind in ("accelerometer", "gyro")
    ]
    rates = [
        element("jointvel", name=f"{wheel.link}_rate", joint=wheel.link) for wheel in rover.wheels
    ]
    angles = [
        element("jointpos", name=f"{link.name}_angle", joint=link.name)
        for link in rover.links
        if link.joint == "passive"
    ]
    return pose + inertial + rates + angles


def _body(rover: Rover, link: Link, **placement: np.ndarray) -> str:
    wheels = {wheel.link for wheel in rover.wheels}
    parts = [
        *_joint(link),
        element("inertial", pos=link.centre_of_mass, mass=link.mass, fullinertia=_six(link)),
        *(_geom(shape, wheel=link.name in wheels) for shape in link.shapes),
        *(_sensor(sensor) for sensor in rover.sensors if sensor.link == link.name),
        *(
            _body(rover, child, pos=child.origin)
            for child in rover.links
            if child.parent == link.name
        ),
    ]
    return element("body", parts, name=link.name, childclass="rover", **placement)


def _joint(link: Link) -> list[str]:
    if link.joint == "free":
        return [element("freejoint", name=f"{link.name}_free")]
    if link.joint == "fixed":
        return []
    motor = link.joint == "motor"
    own = {"armature": (_WHEEL_ARMATURE,)} if motor else {"range": (-link.limit, link.limit)}
    hinge = element(
        "joint",
        name=link.name,
        type="hinge",
        axis=link.axis,
        damping=link.damping,
        **own,  # type: ignore[arg-type]
    )
    return [hinge]


def _six(link: Link) -> np.ndarray:
    """The inertia as xx yy zz xy xz yz."""
    return link.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _geom(shape: Shape, *, wheel: bool) -> str:
    """A shape; MuJoCo counts boxes and cylinders in half lengths."""
    halves = {"box": (0.5, 0.5, 0.5), "cylinder": (1.0, 0.5), "sphere": (1.0,)}[shape.kind]
    classes = {True: "wheel" if wheel else "rover", False: "visual"}
    return element(
        "geom",
        class_=classes[shape.collides],
        type=shape.kind,
        size=np.multiply(shape.size, halves),
        pos=shape.position,
        quat=quaternion_from_rpy(shape.rpy),
        rgba=(*shape.rgb, 1.0),
    )


def _sensor(sensor: Sensor) -> str:
    """A camera, or the site that other sensors sit at."""
    if sensor.kind != "camera":
        quaternion = quaternion_from_rpy(sensor.rpy)
        return element("site", name=sensor.name, pos=sensor.position, quat=quaternion, size=0.01)
    axes = matrix_from_quaternion(quaternion_from_rpy(sensor.rpy)) @ _CAMERA_AXES
    figures = dict(sensor.properties)
    width, height = figures["width_px"], figures["height_px"]
    view = 2 * math.atan(math.tan(figures["horizontal_fov"] / 2) * height / width)
    return element(
        "camera",
        name=sensor.name,
        pos=sensor.position,
        xyaxes=np.concatenate([axes[:, 0], axes[:, 1]]),
        fovy=math.degrees(view),
        resolution=(width, height),
    )
