"""The rover as an SDF model that gz-sim drives by its diff-drive system."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.exporters.sdf.markup import Lines, element, figures, write_document
from terrain_forge.exporters.sdf.material import plain
from terrain_forge.exporters.sdf.model import surface
from terrain_forge.exporters.sdf.sensors import rig_sensors
from terrain_forge.exporters.sdf.solids import inertial, solid

from terrain_forge.base import Array
from terrain_forge.geometry import rover_mesh
from terrain_forge.model import Link, Rover

from .options import Options
from .rig import SKID_GAIN, joint_name, joint_rate, sides, track, wheel_radius

_VERSIONS = {"fortress": "1.9", "harmonic": "1.11"}
_FILES = {"fortress": "ignition-gazebo-", "harmonic": "gz-sim-"}
_CLASSES = {"fortress": "ignition::gazebo::systems::", "harmonic": "gz::sim::systems::"}


def write_sdf(directory: Path, rover: Rover, *, name: str, options: Options) -> None:
    """Write NAME.sdf and model.config, which make the folder a model that Gazebo finds."""
    version, places = _VERSIONS[options.release], rover.origins
    parts = [
        _link(rover, number, places[link.name], name, options)
        for number, link in enumerate(rover.links)
    ]
    parts += [_joint(link, rover, options) for link in rover.links if link.parent]
    model = element("model", *parts, *_plugins(rover, name, options), name=name)
    write_document(directory / f"{name}.sdf", version, model)
    config = element(
        "model",
        element("name", name),
        element("version", "1.0"),
        element("sdf", f"{name}.sdf", version=version),
        element("author", element("name", "terrain-forge")),
        element("description", f"The rover {rover.name}."),
    )
    text = "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', *config]) + "\n"
    (directory / "model.config").write_text(text, encoding="utf-8", newline="\n")


def _link(rover: Rover, number: int, place: Array, name: str, options: Options) -> Lines:
    link = rover.links[number]
    weight = inertial(link.mass, link.inertia, centre=link.centre_of_mass, text=figures)
    parts = [element("pose", figures([*place, 0, 0, 0])), weight]
    for part, shape in enumerate(link.shapes):
        pose = element("pose", figures([*shape.position, *shape.rpy]))
        geometry = solid(shape, f"meshes/{rover_mesh(number, part)}", text=figures)
        if shape.visible:
            parts.append(element("visual", pose, geometry, plain(shape.rgb), name=f"visual_{part}"))
        if shape.collides:
            friction = surface(options.friction)
            parts.append(element("collision", pose, geometry, friction, name=f"collision_{part}"))
    if number == 0 and rover.sensors:
        parts += rig_sensors(rover, actor=name, flavour="gz")
    return element("link", *parts, name=link.name)


def _joint(link: Link, rover: Rover, options: Options) -> Lines:
    ends = [element("parent", link.parent), element("child", link.name)]
    if link.joint == "fixed":
        return element("joint", *ends, name=joint_name(link.name), type="fixed")
    lower, upper = link.limits or (-1e16, 1e16)
    gear = next((gear for gear in rover.couplings if gear.link == link.name), None)
    # Drake puts a motor on each joint whose effort is not 0; DART keeps a gear by efforts.
    follows = gear is not None and options.release != "fortress"
    effort = rover.torque_limit if link.joint == "motor" else -1.0 if follows else 0.0
    limit = element(
        "limit",
        element("lower", figures([lower])),
        element("upper", figures([upper])),
        element("effort", figures([effort])),
        element("velocity", figures([joint_rate(rover, link) if effort > 0 else -1.0])),
    )
    dynamics = element(
        "dynamics",
        element("damping", figures([link.damping])),
        element("friction", figures([link.friction])),
    )
    axis = [element("xyz", figures(link.axis)), limit, dynamics]
    if gear and follows:
        figure = {"multiplier": gear.ratio, "offset": gear.offset, "reference": 0.0}
        told = [element(key, figures([value])) for key, value in figure.items()]
        leader = joint_name(gear.leader)
        axis.append(element("mimic", *told, joint=leader, axis="axis"))
    name = joint_name(link.name)
    return element("joint", *ends, element("axis", *axis), name=name, type="revolute")


def _plugins(rover: Rover, name: str, options: Options) -> list[Lines]:
    """Driving by /model/NAME/cmd_vel, odometry, and the joints' states."""
    left, right = sides(rover)
    drive = [
        *(element("left_joint", joint) for joint in left),
        *(element("right_joint", joint) for joint in right),
        # Skidding wheels turn the rover as if they stood farther apart.
        element("wheel_separation", figures([SKID_GAIN * track(rover)])),
        element("wheel_radius", figures([wheel_radius(rover)])),
        element("max_linear_velocity", figures([rover.speed_limit])),
        element("min_linear_velocity", figures([-rover.speed_limit])),
        element("topic", f"model/{name}/cmd_vel"),
        element("odom_topic", f"model/{name}/odometry"),
        element("tf_topic", f"model/{name}/tf"),
        element("frame_id", "odom"),
        element("child_frame_id", "base_link"),
    ]
    systems: list[tuple[str, str, list[Lines]]] = [
        ("diff-drive", "DiffDrive", drive),
        ("joint-state-publisher", "JointStatePublisher", []),
    ]
    return [
        element(
            "plugin",
            *content,
            filename=f"{_FILES[options.release]}{file}-system",
            name=f"{_CLASSES[options.release]}{kind}",
        )
        for file, kind, content in systems
    ]
