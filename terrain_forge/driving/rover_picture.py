"""The rover in pictures of the ray scene, as it stood during a drive.

Its links join the rocks around it: the renderer then gives them their shadows, the Sun and whatever
stands before them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    linear_from_srgb,
    matrix_from_quaternion,
    quaternion_from_rpy,
)
from terrain_forge.driving.result import DriveResult
from terrain_forge.model import Link, Mesh, Rover, Shape, World
from terrain_forge.scene import (
    Instances,
    RayScene,
    Subject,
    pinhole_camera,
    subject_of,
    take_picture,
    tones,
)

_REACH = 14.0
"""Half the side of the piece of the world that a picture shows [m]."""
_BEHIND, _ABOVE, _LOWEST, _PITCH = 3.6, 2.2, 0.8, math.radians(24.0)
_LENGTH = 1.2
"""Length of a rover that is seen well from there [m]; the camera stands off more for longer
ones."""
_FIELD_OF_VIEW = math.radians(62.0)
_SIDES = 20
_SMOOTH = 1e-6
"""Size that rover parts have for the renderer, which grows no grain on what is so small [m]."""


def photograph(
    world: World, result: DriveResult, pose: int, *, width: int, height: int
) -> NDArray[np.uint8]:
    """The rover from behind and above at one of the poses of its drive.

    Args:
        world: where it drove.
        result: its drive.
        pose: which pose.
        width: columns of pixels.
        height: rows of pixels.

    Returns:
        sRGB, shape [height, width, 3].
    """
    position = result.position[pose]
    size = max(world.rover.length / _LENGTH, 1.0)
    away = size * _BEHIND
    subject = _around(subject_of(world), position, _REACH + away - _BEHIND)
    rover = rover_parts(world, result, pose)
    ground = subject.ground
    heading = _heading(result, pose)
    behind = position - away * np.array([math.cos(heading), math.sin(heading), 0.0])
    west, south, east, north = ground.bounds
    at = np.clip(behind[:2], (west, south), (east, north))
    lowest = float(ground.height_at(*at)) + _LOWEST
    behind[2] = max(position[2] + size * _ABOVE, lowest)
    camera = pinhole_camera(
        position=behind, yaw=heading, pitch=_PITCH, field_of_view=_FIELD_OF_VIEW, width=width,
        height=height,
    )  # fmt: skip
    with RayScene(subject.replace(instances=subject.instances.add(rover))) as scene:
        return take_picture(scene, camera)


def _heading(result: DriveResult, pose: int) -> float:
    """Mean heading around a pose, so that the camera swings calmly [rad]."""
    around = slice(max(pose - 15, 0), pose + 16)
    yaw = result.rpy[around, 2]
    return math.atan2(np.sin(yaw).mean(), np.cos(yaw).mean())


def _around(subject: Subject, position: Array, reach_m: float) -> Subject:
    """The ground and the rocks so far around a place, with no tracks on it but the rover's."""
    ground, rocks = subject.ground, subject.instances
    rows, columns = ground.shape
    reach = math.ceil(reach_m / ground.spacing)
    i, j = (round((position[n] - ground.origin[n]) / ground.spacing) for n in range(2))
    column, row = max(min(i, columns - 2) - reach, 0), max(min(j, rows - 2) - reach, 0)
    wide, high = min(2 * reach, columns - 1 - column), min(2 * reach, rows - 1 - row)
    near = np.abs(rocks.position[:, :2] - position[:2]).max(axis=1) < reach_m + 2.0
    return subject.replace(
        ground=ground.cut(column=column, row=row, columns=wide, rows=high),
        ground_rgb=subject.ground_rgb[row : row + high + 1, column : column + wide + 1],
        instances=rocks.select(near),
        tracks=(),
    )


def rover_parts(world: World, result: DriveResult, pose: int) -> Instances:
    """The rover's visible shapes at a pose of a drive, one instance for each link and colour."""
    poses = link_poses(world.rover, result, pose)
    parts = [
        (*poses[link.name], mesh, rgb) for link in world.rover.links for mesh, rgb in _looks(link)
    ]
    positions, rotations, meshes, colours = zip(*parts, strict=True)
    count = len(parts)
    number = np.arange(count, dtype=np.int32)
    tone = tones(np.int32(np.iinfo(np.int32).max - count) + number, world.site.seed)
    return Instances(
        meshes=meshes,
        mesh=number,
        position=np.array(positions),
        rotation=np.array(rotations),
        scale=np.ones(count),
        grain=np.full(count, _SMOOTH),
        rgb=linear_from_srgb(np.round(255.0 * np.array(colours)) / 255.0) * tone[:, None],
    )


def link_poses(rover: Rover, result: DriveResult, pose: int) -> dict[str, tuple[Array, Array]]:
    """Position [m] and rotation matrix of each link in the world frame at a pose of a drive."""
    angles = dict(zip(result.joints, result.joint_angle[pose].tolist(), strict=True))
    rates, steps = result.wheel_rate[: pose + 1], np.diff(result.time[: pose + 1])
    turned: list[float] = (0.5 * steps @ (rates[:-1] + rates[1:])).tolist()
    angles |= dict(zip(result.wheels, turned, strict=True))
    places = {
        rover.links[0].name: (
            result.position[pose], matrix_from_quaternion(result.quaternion[pose])
        )
    }  # fmt: skip
    for link in rover.links[1:]:
        origin, rotation = places[link.parent]
        turn = _about(link.axis, angles.get(link.name, 0.0))
        places[link.name] = origin + rotation @ link.origin, rotation @ turn
    return places


def _about(axis: Array, angle: float) -> Array:
    half = 0.5 * angle
    return matrix_from_quaternion(np.array([math.cos(half), *(math.sin(half) * axis)]))


def _looks(link: Link) -> list[tuple[Mesh, tuple[float, float, float]]]:
    """The link's visible shapes, one mesh in its frame for each colour."""
    meshes = dict[tuple[float, float, float], list[Array]]()
    for shape in link.shapes:
        if shape.visible:
            meshes.setdefault(shape.rgb, []).append(_triangles(shape))
    return [(_unwelded(np.concatenate(parts)), rgb) for rgb, parts in meshes.items()]


def _triangles(shape: Shape) -> Array:
    """Corners of a shape's triangles in its link's frame [m], shape [triangles, 3, 3]."""
    import trimesh

    if shape.kind == "mesh" and shape.mesh is not None:
        corners = shape.mesh.vertices[shape.mesh.faces]
    else:
        made = {
            "box": lambda: trimesh.creation.box(shape.size),
            "cylinder": lambda: trimesh.creation.cylinder(
                radius=shape.size[0], height=shape.size[1], sections=_SIDES
            ),
            "sphere": lambda: trimesh.creation.icosphere(2, shape.size[0]),
        }[shape.kind]()
        corners = np.asarray(made.triangles)
    rotation = matrix_from_quaternion(quaternion_from_rpy(shape.rpy))
    return np.asarray(corners @ rotation.T + shape.position)


def _unwelded(triangles: Array) -> Mesh:
    """A mesh whose faces share no vertex, so that it is shaded with sharp edges."""
    faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    return Mesh(vertices=triangles.reshape(-1, 3), faces=faces)
