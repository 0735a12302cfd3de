"""The rover as an SDF model that gz-sim drives by its diff-drive system."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from terrain_forge.exporters.sdf.model import inertial, plain, solid, surface, write_config
from terrain_forge.exporters.sdf.scenery import gz_system
from terrain_forge.exporters.sdf.sensors import rig_sensors

from terrain_forge.base import Array
from terrain_forge.geometry import rover_mesh
from terrain_forge.model import Link, Rover
from terrain_forge.writers import Lines, element, leaves, write_xml

from .control import SKID_GAIN, joint_name, joint_rate, sides, track, wheel_radius
from .options import Options

_VERSIONS = {"fortress": "1.9", "harmonic": "1.11"}
_exact = partial(leaves, digits=12)


def write_sdf(directory: Path, rover: Rover, *, name: str, options: Options) -> None:
    """Write NAME.sdf and model.config, which make the folder a model that Gazebo finds."""
    version, places = _VERSIONS[options.release], rover.origins
    parts = [
        _link(rover, number, places[link.name], name, options)
        for number, link in enumerate(rover.links)
    ]
    parts += [_joint(link, rover, options) for link in rover.links if link.parent]
    model = element("model", *parts, *_plugins(rover, name), name=name)
    write_xml(directory / f"{name}.sdf", element("sdf", model, version=version))
    description = f"The rover {rover.name}."
    write_config(directory, f"{name}.sdf", version, name=name, description=description)


def _link(rover: Rover, number: int, place: Array, name: str, options: Options) -> Lines:
    link = rover.links[number]
    weight = inertial(link.mass, link.inertia, centre=link.centre_of_mass, digits=12)
    parts = [*_exact(pose=(*place, 0, 0, 0)), weight]
    for part, shape in enumerate(link.shapes):
        geometry = solid(shape, f"meshes/{rover_mesh(number, part)}", digits=12)
        body = [*_exact(pose=(*shape.position, *shape.rpy)), geometry]
        if shape.visible:
            parts.append(element("visual", *body, plain(shape.rgb), name=f"visual_{part}"))
        if shape.collides:
            friction = surface(options.friction)
            parts.append(element("collision", *body, friction, name=f"collision_{part}"))
    if number == 0 and rover.sensors:
        parts += rig_sensors(rover, actor=name)
    return element("link", *parts, name=link.name)


def _joint(link: Link, rover: Rover, options: Options) -> Lines:
    name, ends = joint_name(link.name), leaves(parent=link.parent, child=link.name)
    if link.joint == "fixed":
        return element("joint", *ends, name=name, type="fixed")
    lower, upper = link.limits or (-1e16, 1e16)
    gear = next((gear for gear in rover.couplings if gear.link == link.name), None)
    # Drake puts a motor on each joint whose effort is not 0; DART keeps a gear by efforts.
    follows = gear is not None and options.release != "fortress"
    effort = rover.torque_limit if link.joint == "motor" else -1.0 if follows else 0.0
    limited = link.joint == "motor" or link.rate_limit is not None
    rate = joint_rate(rover, link) if limited else -1.0
    axis = [
        *_exact(xyz=link.axis),
        element("limit", *_exact(lower=lower, upper=upper, effort=effort, velocity=rate)),
        element("dynamics", *_exact(damping=link.damping, friction=link.friction)),
    ]
    if gear and follows:
        told = _exact(multiplier=gear.ratio, offset=gear.offset, reference=0.0)
        axis.append(element("mimic", *told, joint=joint_name(gear.leader), axis="axis"))
    return element("joint", *ends, element("axis", *axis), name=name, type="revolute")


def _plugins(rover: Rover, name: str) -> list[Lines]:
    """Driving by /model/NAME/cmd_vel, odometry, and the joints' states."""
    left, right = sides(rover)
    drive = [
        *(element("left_joint", joint) for joint in left),
        *(element("right_joint", joint) for joint in right),
        *_exact(
            # Skidding wheels turn the rover as if they stood farther apart.
            wheel_separation=SKID_GAIN * track(rover),
            wheel_radius=wheel_radius(rover),
            max_linear_velocity=rover.speed_limit,
            min_linear_velocity=-rover.speed_limit,
            topic=f"model/{name}/cmd_vel",
            odom_topic=f"model/{name}/odometry",
            tf_topic=f"model/{name}/tf",
            frame_id="odom",
            child_frame_id="base_link",
        ),
    ]
    return [
        gz_system("diff-drive", "DiffDrive", *drive),
        gz_system("joint-state-publisher", "JointStatePublisher"),
    ]
