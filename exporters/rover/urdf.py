"""The rover as URDF, with tags of ros2_control and Gazebo; MuJoCo, Drake and PyBullet open it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from terrain_forge.exporters.sdf.sensors import rig_sensors

from terrain_forge.geometry import rover_mesh
from terrain_forge.model import Coupling, Link, Rover, Sensor, Shape, moments, simple_sensors
from terrain_forge.writers import Lines, leaves, write_xml
from terrain_forge.writers import element as plain_element

from .control import joint_name, joint_rate
from .options import Options

element = partial(plain_element, digits=12)

Colour = tuple[float, float, float]


def write_urdf(path: Path, rover: Rover, *, name: str, options: Options) -> None:
    """Write the rover, a robot of that name, as URDF.

    base_link is the root and has a mass: PyBullet fixes a root without one to the world.
    """
    gears = {gear.link: gear for gear in rover.couplings}
    # MuJoCo by default drops what is only seen, merges links and cuts paths of meshes.
    compiler = element(
        "compiler", fusestatic="false", discardvisual="false", strippath="false", angle="radian"
    )
    parts = [element("mujoco", compiler)]
    names = _material_names(rover)
    for material, rgb in {material: rgb for rgb, material in names.items()}.items():
        parts.append(element("material", element("color", rgba=(*rgb, 1.0)), name=material))
    for number, link in enumerate(rover.links):
        parts.append(_link(link, number, options, names))
        if link.parent:
            parts.append(_joint(link, rover, gears.get(link.name)))
    for sensor in simple_sensors(rover.sensors):
        parts += _sensor_frame(sensor)
    parts += [*(_transmission(joint_name(wheel.link)) for wheel in rover.wheels), _control(rover)]
    parts += _gazebo(rover, name, options)
    drake = {"xmlns:drake": "http://drake.mit.edu"}
    write_xml(path, element("robot", *parts, **drake, name=name))


def _material_names(rover: Rover) -> dict[Colour, str]:
    """A name for each colour, its own where several round to the same bytes: urdfdom asks for it.

    Colours that are written alike are one.
    """
    names: dict[Colour, str] = {}
    told: dict[str, str] = {}
    for rgb in sorted({shape.rgb for link in rover.links for shape in link.shapes}):
        name = "rgb_" + "_".join(f"{round(255 * value):03d}" for value in rgb)
        alike = sum(other == name or other.startswith(f"{name}_v") for other in told.values())
        written = " ".join(f"{value:.12g}" for value in rgb)
        names[rgb] = told.setdefault(written, f"{name}_v{alike + 1}" if alike else name)
    return names


def _link(link: Link, number: int, options: Options, materials: dict[Colour, str]) -> Lines:
    mass = element(
        "inertial",
        element("origin", xyz=link.centre_of_mass, rpy="0 0 0"),
        element("mass", value=link.mass),
        element("inertia", **moments(link.inertia)),
    )
    parts = [mass]
    for part, shape in enumerate(link.shapes):
        solid = _solid(shape, f"{options.mesh_prefix}meshes/{rover_mesh(number, part)}")
        place = element("origin", xyz=shape.position, rpy=shape.rpy)
        if shape.visible:
            colour = element("material", name=materials[shape.rgb])
            parts.append(element("visual", place, solid, colour))
        if shape.collides:
            parts.append(element("collision", place, solid))
    return element("link", *parts, name=link.name)


def _solid(shape: Shape, mesh: str) -> Lines:
    if shape.kind == "mesh":
        # Drake collides with meshes by their hulls only where it is told to.
        convex = [["<drake:declare_convex/>"]] if shape.collides else []
        return element("geometry", element("mesh", *convex, filename=mesh))
    if shape.kind == "box":
        return element("geometry", element("box", size=shape.size))
    size = dict(zip(("radius", "length"), shape.size, strict=False))
    return element("geometry", element(shape.kind, **size))


def _joint(link: Link, rover: Rover, gear: Coupling | None) -> Lines:
    parts = [
        element("parent", link=link.parent),
        element("child", link=link.name),
        element("origin", xyz=link.origin, rpy="0 0 0"),
    ]
    if link.joint == "fixed":
        return element("joint", *parts, name=joint_name(link.name), type="fixed")
    effort = rover.torque_limit if link.joint == "motor" else 0.0
    ends = dict(zip(("lower", "upper"), link.limits or (), strict=False))
    parts += [
        element("axis", xyz=link.axis),
        element("limit", effort=effort, velocity=joint_rate(rover, link), **ends),
        element("dynamics", damping=link.damping, friction=link.friction),
    ]
    if gear:
        leader = joint_name(gear.leader)
        parts.append(element("mimic", joint=leader, multiplier=gear.ratio, offset=gear.offset))
    kind = "revolute" if link.limits else "continuous"
    return element("joint", *parts, name=joint_name(link.name), type=kind)


def _sensor_frame(sensor: Sensor) -> list[Lines]:
    """A link without mass where the sensor is; said to be so, since PyBullet would take 1 kg."""
    none = dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0")
    inertial = element("inertial", element("mass", value="0"), element("inertia", **none))
    joint = element(
        "joint",
        element("parent", link=sensor.link),
        element("child", link=sensor.name),
        element("origin", xyz=sensor.position, rpy=sensor.rpy),
        name=f"{sensor.name}_mount",
        type="fixed",
    )
    return [element("link", inertial, name=sensor.name), joint]


def _transmission(joint: str) -> Lines:
    """What Drake makes an actuator of."""
    return element(
        "transmission",
        *leaves(type="transmission_interface/SimpleTransmission"),
        element(
            "joint",
            *leaves(hardwareInterface="hardware_interface/VelocityJointInterface"),
            name=joint,
        ),
        element("actuator", *leaves(mechanicalReduction="1"), name=f"{joint}_motor"),
        name=f"{joint}_transmission",
    )


def _control(rover: Rover) -> Lines:
    hardware = element("hardware", *leaves(plugin="gz_ros2_control/GazeboSimSystem"))
    states = [element("state_interface", name=name) for name in ("position", "velocity")]
    joints = []
    for link in rover.links:
        if link.joint not in ("motor", "passive"):
            continue
        command = []
        if link.joint == "motor":
            rate = joint_rate(rover, link)
            limits = element("param", -rate, name="min"), element("param", rate, name="max")
            command = [element("command_interface", *limits, name="velocity")]
        joints.append(element("joint", *command, *states, name=joint_name(link.name)))
    return element("ros2_control", hardware, *joints, name=rover.name, type="system")


def _gazebo(rover: Rover, name: str, options: Options) -> list[Lines]:
    """Friction, sensors, and the plugin that lets ros2_control drive in Gazebo."""
    friction = leaves(mu1=options.friction, mu2=options.friction, digits=12)
    tags = [element("gazebo", *friction, reference=link.name) for link in rover.links]
    rig = rig_sensors(rover, actor=name) if rover.sensors else []
    if rig:
        tags.append(element("gazebo", *rig, reference="base_link"))
    plugin = element(
        "plugin",
        *leaves(parameters=f"{name}_controllers.yaml"),
        filename="gz_ros2_control-system",
        name="gz_ros2_control::GazeboSimROS2ControlPlugin",
    )
    return [*tags, element("gazebo", plugin)]
