"""The rover as URDF, with tags of ros2_control and Gazebo; MuJoCo, Drake and PyBullet open it."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.exporters.sdf.markup import Lines, element, figures
from terrain_forge.exporters.sdf.sensors import rig_sensors

from terrain_forge.geometry import rover_mesh
from terrain_forge.model import Coupling, Link, Rover, Sensor, Shape, moments

from .options import Options
from .rig import joint_name, joint_rate

Colour = tuple[float, float, float]


def write_urdf(path: Path, rover: Rover, *, name: str, options: Options) -> None:
    """Write the rover as URDF.

    base_link is the root and has a mass: PyBullet fixes a root without one to the world.

    Args:
        path: The file.
        rover: The rover.
        name: Name of the robot.
        options: The export's.
    """
    gears = {gear.link: gear for gear in rover.couplings}
    names = _material_names(rover)
    parts = [_mujoco(), *_materials(names)]
    for number, link in enumerate(rover.links):
        parts.append(_link(link, number, options, names))
        if link.parent:
            parts.append(_joint(link, rover, gears.get(link.name)))
    for sensor in rover.sensors:
        parts += _sensor_frame(sensor)
    parts += [*(_transmission(joint_name(wheel.link)) for wheel in rover.wheels), _control(rover)]
    parts += _gazebo(rover, name, options)
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', *_robot(parts, name)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _robot(parts: list[Lines], name: str) -> Lines:
    return element("robot", *parts, **{"xmlns:drake": "http://drake.mit.edu"}, name=name)


def _mujoco() -> Lines:
    """MuJoCo by default drops what is only seen, merges links and cuts paths of meshes."""
    compiler = element(
        "compiler", fusestatic="false", discardvisual="false", strippath="false", angle="radian"
    )
    return element("mujoco", compiler)


def _material_names(rover: Rover) -> dict[Colour, str]:
    """A name for each colour, its own where several round to the same bytes: urdfdom asks for it.

    Colours that are written alike are one.
    """
    names: dict[Colour, str] = {}
    told: dict[str, str] = {}
    for rgb in sorted({shape.rgb for link in rover.links for shape in link.shapes}):
        name = "rgb_" + "_".join(f"{round(255 * value):03d}" for value in rgb)
        alike = sum(other == name or other.startswith(f"{name}_v") for other in told.values())
        names[rgb] = told.setdefault(figures(rgb), f"{name}_v{alike + 1}" if alike else name)
    return names


def _materials(names: dict[Colour, str]) -> list[Lines]:
    return [
        element("material", element("color", rgba=figures([*rgb, 1.0])), name=name)
        for name, rgb in {name: rgb for rgb, name in names.items()}.items()
    ]


def _link(link: Link, number: int, options: Options, materials: dict[Colour, str]) -> Lines:
    parts = [_inertial(link)]
    for part, shape in enumerate(link.shapes):
        solid = _solid(shape, f"{options.mesh_prefix}meshes/{rover_mesh(number, part)}")
        place = element("origin", xyz=figures(shape.position), rpy=figures(shape.rpy))
        if shape.visible:
            colour = element("material", name=materials[shape.rgb])
            parts.append(element("visual", place, solid, colour))
        if shape.collides:
            parts.append(element("collision", place, solid))
    return element("link", *parts, name=link.name)


def _inertial(link: Link) -> Lines:
    inertia = {name: figures([value]) for name, value in moments(link.inertia).items()}
    return element(
        "inertial",
        element("origin", xyz=figures(link.centre_of_mass), rpy="0 0 0"),
        element("mass", value=figures([link.mass])),
        element("inertia", **inertia),
    )


def _solid(shape: Shape, mesh: str) -> Lines:
    if shape.kind == "mesh":
        # Drake collides with meshes by their hulls only where it is told to.
        convex = [["<drake:declare_convex/>"]] if shape.collides else []
        return element("geometry", element("mesh", *convex, filename=mesh))
    if shape.kind == "box":
        return element("geometry", element("box", size=figures(shape.size)))
    size = {name: figures([v]) for name, v in zip(("radius", "length"), shape.size, strict=False)}
    return element("geometry", element(shape.kind, **size))


def _joint(link: Link, rover: Rover, gear: Coupling | None) -> Lines:
    parts = [
        element("parent", link=link.parent),
        element("child", link=link.name),
        element("origin", xyz=figures(link.origin), rpy="0 0 0"),
    ]
    if link.joint == "fixed":
        return element("joint", *parts, name=joint_name(link.name), type="fixed")
    parts.append(element("axis", xyz=figures(link.axis)))
    limit = {"effort": "0", "velocity": figures([joint_rate(rover, link)])}
    if link.joint == "motor":
        limit["effort"] = figures([rover.torque_limit])
    if link.limits:
        limit["lower"], limit["upper"] = (figures([angle]) for angle in link.limits)
    dynamics = {"damping": figures([link.damping]), "friction": figures([link.friction])}
    parts += [element("limit", **limit), element("dynamics", **dynamics)]
    if gear:
        ratio, offset = figures([gear.ratio]), figures([gear.offset])
        parts.append(
            element("mimic", joint=joint_name(gear.leader), multiplier=ratio, offset=offset)
        )
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
        element("origin", xyz=figures(sensor.position), rpy=figures(sensor.rpy)),
        name=f"{sensor.name}_mount",
        type="fixed",
    )
    return [element("link", inertial, name=sensor.name), joint]


def _transmission(joint: str) -> Lines:
    """What Drake makes an actuator of."""
    interface = element("hardwareInterface", "hardware_interface/VelocityJointInterface")
    return element(
        "transmission",
        element("type", "transmission_interface/SimpleTransmission"),
        element("joint", interface, name=joint),
        element("actuator", element("mechanicalReduction", "1"), name=f"{joint}_motor"),
        name=f"{joint}_transmission",
    )


def _control(rover: Rover) -> Lines:
    hardware = element("hardware", element("plugin", "gz_ros2_control/GazeboSimSystem"))
    states = [element("state_interface", name=name) for name in ("position", "velocity")]
    joints = []
    for link in rover.links:
        if link.joint not in ("motor", "passive"):
            continue
        command = []
        if link.joint == "motor":
            rate = joint_rate(rover, link)
            least = element("param", figures([-rate]), name="min")
            most = element("param", figures([rate]), name="max")
            command = [element("command_interface", least, most, name="velocity")]
        joints.append(element("joint", *command, *states, name=joint_name(link.name)))
    return element("ros2_control", hardware, *joints, name=rover.name, type="system")


def _gazebo(rover: Rover, name: str, options: Options) -> list[Lines]:
    """Friction, sensors, and the plugin that lets ros2_control drive in Gazebo."""
    friction = figures([options.friction])
    tags = [
        element("gazebo", element("mu1", friction), element("mu2", friction), reference=link.name)
        for link in rover.links
    ]
    rig = rig_sensors(rover, actor=name, flavour="gz") if rover.sensors else []
    if rig:
        tags.append(element("gazebo", *rig, reference="base_link"))
    plugin = element(
        "plugin",
        element("parameters", f"{name}_controllers.yaml"),
        filename="gz_ros2_control-system",
        name="gz_ros2_control::GazeboSimROS2ControlPlugin",
    )
    return [*tags, element("gazebo", plugin)]
