"""The rover as a tree of bodies with motors and sensors."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from terrain_forge.base import matrix_from_quaternion, portable, quaternion_from_rpy
from terrain_forge.geometry import rover_mesh
from terrain_forge.model import (
    Link,
    Rover,
    Sensor,
    Shape,
    View,
    figures_lost,
    simple_sensors,
    titles,
)
from terrain_forge.writers import Lines, Value, element

# The servos follow the angle that the commanded rate adds up to: wheels that shall stand do so on
# any slope, without the damping that would do the same. That must stay small: MuJoCo's contacts do
# not know its implicit part, and would push the rover by damping × angular acceleration × step for
# nothing (docs/driving.md). The armature stands for the gear train and keeps the light wheels from
# chattering against the ground. All are those of a rover of 50 kg on wheels of 14 cm, and grow with
# mass and radius squared.
_SERVO_STIFFNESS = 1500.0
_SERVO_DAMPING = 40.0
_WHEEL_ARMATURE = 0.2
_PARKING_DAMPING = 1500.0
_REFERENCE = 50.0 * 0.14**2
_UNSEEN_GROUP = 3
_HULL_VERTICES = 64
_PIXEL = 5e-6
"""Size of a camera's pixel, where MuJoCo wants one [m]; any gives the same picture."""
# MuJoCo's cameras look along -z with x to the right; ours along x with y to the left.
_CAMERA_AXES = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def write_rover(path: Path, rover: Rover, *, gravity: float, friction: float) -> None:
    """Write a model of the rover alone, with the settings that the world's export has.

    `gravity` is that of the world [m/s²], `friction` the sliding friction of its geoms.
    """
    body = rover_body(rover, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    sections = rover_sections(rover, friction=friction, folder="meshes")
    sections.insert(2, element("worldbody", body))
    model = element("mujoco", *simulation(gravity, timestep=0.002), *sections, model=rover.name)
    path.write_text("\n".join(model) + "\n", encoding="utf-8", newline="\n")


def simulation(gravity: float, *, timestep: float, sleep: bool = False) -> list[Lines]:
    """What MuJoCo would otherwise take from its own defaults, which have changed over versions."""
    flags = [element("flag", sleep="enable")] if sleep else []
    option = element(
        "option", *flags, timestep=timestep, gravity=(0.0, 0.0, -gravity),
        integrator="implicitfast", cone="elliptic", impratio=10, solver="Newton", jacobian="sparse",
    )  # fmt: skip
    return [element("compiler", angle="radian", autolimits="true"), option]


def rover_sections(rover: Rover, *, friction: float, folder: str) -> list[Lines]:
    """Default classes, meshes (of a folder), gears, motors and sensors of a model of the rover."""
    gears = (
        element("joint", joint1=g.link, joint2=g.leader, polycoef=(g.offset, g.ratio, 0, 0, 0))
        for g in rover.couplings
    )
    return [
        element("default", _classes(friction)),
        element("asset", *_assets(rover, folder)),
        element("equality", *gears),
        element("actuator", *_actuators(rover)),
        element("sensor", *_sensors(rover)),
    ]


def _classes(friction: float) -> Lines:
    """Default classes of the rover's geoms; wheels decide the contact, whatever they roll on."""
    sliding = (friction, 0.005, 0.0001)
    contact = element("geom", group=2, contype=1, conaffinity=0, friction=sliding)
    unseen = element("default", element("geom", contype=0, conaffinity=0), class_="visual")
    soft = {"solref": (0.04, 1.0), "solimp": (0.9, 0.95, 0.001)}
    wheel = element("geom", priority=1, condim=3, friction=sliding, **soft)
    return element(
        "default", contact, unseen, element("default", wheel, class_="wheel"), class_="rover"
    )


def rover_body(rover: Rover, position: np.ndarray, quaternion: np.ndarray) -> Lines:
    """The rover's root body, placed in the world, with everything that hangs on it."""
    return _body(rover, 0, pos=position, quat=quaternion)


def _assets(rover: Rover, folder: str) -> list[Lines]:
    """The meshes of a rover, whose files `write_rover_meshes` puts into a folder."""
    assets = []
    for number, link in enumerate(rover.links):
        for part, shape in enumerate(link.shapes):
            if shape.mesh is None:
                continue
            # As shells: what is only seen may be open. Masses are told, not computed from them.
            own: dict[str, Value] = {"inertia": "shell"}
            if shape.collides:
                own["maxhullvert"] = _HULL_VERTICES
            name = rover_mesh(number, part)
            assets.append(element("mesh", name=name[:-4], file=f"{folder}/{name}", **own))
    return assets


def servo_gain(rover: Rover) -> float:
    """Damping of a drive that follows the rate alone, stiff enough to park [N m s/rad]."""
    return _PARKING_DAMPING * _scale(rover)


def _scale(rover: Rover) -> float:
    """How much stronger than the reference a rover's motors must be."""
    radius = max(wheel.radius for wheel in rover.wheels)
    return rover.mass * radius**2 / _REFERENCE


def _actuators(rover: Rover) -> list[Lines]:
    """A servo per wheel whose control is the wheel's rate [rad/s], its activation the angle."""
    stiffness, damping = _SERVO_STIFFNESS * _scale(rover), _SERVO_DAMPING * _scale(rover)
    return [
        element(
            "general",
            name=wheel.link,
            joint=wheel.link,
            dyntype="integrator",
            biastype="affine",
            gainprm=(stiffness,),
            biasprm=(0.0, -stiffness, -damping),
            ctrlrange=(-rover.speed_limit / wheel.radius, rover.speed_limit / wheel.radius),
            forcerange=(-rover.torque_limit, rover.torque_limit),
        )
        for wheel in rover.wheels
    ]


def _sensors(rover: Rover) -> list[Lines]:
    """True pose and velocity of the root, inertial sensors, wheel and rocker rates."""
    root = rover.links[0].name
    names = {"framepos": "position", "framequat": "orientation", "framelinvel": "velocity"}
    true = {kind: f"{root}_{name}" for kind, name in names.items()}
    told = [
        *((kind, name, {"objtype": "xbody", "objname": root}) for kind, name in true.items()),
        *(
            (tag, f"{s.name}_{tag}", _site(tag, s.name))
            for s in simple_sensors(rover.sensors)
            for tag in s.mjcf
        ),
        *(("jointvel", f"{w.link}_rate", {"joint": w.link}) for w in rover.wheels),
        *(
            ("jointpos", f"{link.name}_angle", {"joint": link.name})
            for link in rover.links
            if link.joint == "passive"
        ),
    ]
    return [element(tag, name=name, **what) for tag, name, what in told]


def _site(tag: str, name: str) -> dict[str, str]:
    """Where a sensor of MuJoCo's is: frames are told of any kind of object."""
    return {"objtype": "site", "objname": name} if tag.startswith("frame") else {"site": name}


def rig_losses(rover: Rover, where: str = "") -> list[str]:
    """What MJCF does not say of rig and joints; `where` is added where other formats are too."""
    sensors = simple_sensors(rover.sensors)
    bare = titles(s for s in sensors if not (s.view or s.mjcf))
    sites = (
        f"A{'n' * (name[0] in 'aeiouAEIOU')} {name} is a bare site{where}; its figures are not "
        "part of the model."
        for name in bare
    )
    return [
        *sites,
        *figures_lost((s for s in sensors if s.view or s.mjcf), "mjcf"),
        *rates_lost(rover, where),
    ]


def rates_lost(rover: Rover, where: str) -> list[str]:
    """What a format does not say that knows no limit of a joint's rate."""
    limited = [link.name for link in rover.links if link.rate_limit is not None]
    told = f"Limits of the rates of joints are left out{where}: those of {', '.join(limited)}."
    return [told] if limited else []


def _body(rover: Rover, number: int, **placement: np.ndarray) -> Lines:
    link, wheels = rover.links[number], {wheel.link for wheel in rover.wheels}
    six = link.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]  # xx yy zz xy xz yz
    parts = [
        *_joint(link, rover),
        element("inertial", pos=link.centre_of_mass, mass=link.mass, fullinertia=six),
        *(
            _geom(shape, rover_mesh(number, part)[:-4], wheel=link.name in wheels)
            for part, shape in enumerate(link.shapes)
        ),
        *(_sensor(sensor) for sensor in simple_sensors(rover.sensors) if sensor.link == link.name),
        *(
            _body(rover, n, pos=child.origin)
            for n, child in enumerate(rover.links)
            if child.parent == link.name
        ),
    ]
    return element("body", *parts, name=link.name, childclass="rover", **placement)


def _joint(link: Link, rover: Rover) -> list[Lines]:
    if link.joint == "free":
        return [element("freejoint", name=f"{link.name}_free")]
    if link.joint == "fixed":
        return []
    own: dict[str, Value] = {"axis": link.axis, "damping": link.damping}
    if link.joint == "motor":
        own["armature"] = _WHEEL_ARMATURE * _scale(rover)
    if link.limits:
        own["range"] = link.limits
    if link.friction:
        own["frictionloss"] = link.friction
    return [element("joint", name=link.name, type="hinge", **own)]


def _geom(shape: Shape, mesh: str, *, wheel: bool) -> Lines:
    """A shape; MuJoCo counts boxes and cylinders in half lengths."""
    classes = {True: "wheel" if wheel else "rover", False: "visual"}
    own: dict[str, Value] = {"mesh": mesh}
    if shape.mesh is None:
        halves = {"box": (0.5, 0.5, 0.5), "cylinder": (1.0, 0.5), "sphere": (1.0,)}[shape.kind]
        own = {"size": np.multiply(shape.size, halves)}
    if not shape.visible:
        own["group"] = _UNSEEN_GROUP
    return element(
        "geom",
        class_=classes[shape.collides],
        type=shape.kind,
        pos=shape.position,
        quat=quaternion_from_rpy(shape.rpy),
        rgba=(*shape.rgb, 1.0),
        **own,
    )


def _sensor(sensor: Sensor) -> Lines:
    """A camera, or the site that other sensors sit at."""
    if not sensor.view:
        quaternion = quaternion_from_rpy(sensor.rpy)
        return element("site", name=sensor.name, pos=sensor.position, quat=quaternion, size=0.01)
    axes = portable.product(matrix_from_quaternion(quaternion_from_rpy(sensor.rpy)), _CAMERA_AXES)
    return element(
        "camera",
        name=sensor.name,
        pos=sensor.position,
        xyaxes=np.concatenate([axes[:, 0], axes[:, 1]]),
        resolution=(sensor.view.width_px, sensor.view.height_px),
        **_lens(sensor.view),
    )


def _lens(view: View) -> dict[str, Value]:
    """The angle from top to bottom, or a sensor of pixels of some size where that is too little.

    MuJoCo counts where the axis meets the picture to the left of its middle and up.
    """
    if view.centred:
        half = math.tan(view.horizontal_fov / 2) * view.height_px / view.width_px
        return {"fovy": math.degrees(2 * math.atan(half))}
    pixels = {
        "sensorsize": (view.width_px, view.height_px),
        "focal": view.focal_px,
        "principal": np.negative(view.offset_px),
    }
    return {name: np.multiply(_PIXEL, told) for name, told in pixels.items()}
