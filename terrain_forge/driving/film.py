"""A drive as an animated picture, a picture of its end, and the rover as it stood during it.

The rover is a body that passes through a piece of the world, as for a recording's cameras: the
piece is made ready once for all frames that show it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from terrain_forge.base import Array, matrix_from_quaternion, worker_threads
from terrain_forge.driving.result import DriveResult
from terrain_forge.geometry import RoverLook, rover_instances, rover_looks
from terrain_forge.model import Rover, World
from terrain_forge.scene import (
    SKIN,
    BodyShapes,
    Instances,
    RayScene,
    Subject,
    pinhole_camera,
    prepare_stage,
    subject_of,
    take_picture,
    tones,
)
from terrain_forge.scene import Rover as Passing
from terrain_forge.terrain import Border, shape_horizon
from terrain_forge.writers import write_png

FRAMES = 24
"""Frames of an animated picture, at equal times."""
_SIZE = (400, 225)
END_SIZE = (960, 540)
"""Of the picture of a drive's end [pixels]."""
_FRAME_MS, _LAST_MS, _QUALITY, _EFFORT = 180, 1500, 60, 2
_INSET, _EDGE = 72, 6
_PATH, _TRACK, _TEXT, _SHADE = (242, 194, 48), (120, 190, 255), (255, 255, 255), (0, 0, 0, 120)

_REACH = 14.0
"""Half the side of the piece of the world that a picture shows [m]."""
_BEHIND, _ABOVE, _LOWEST, _PITCH = 3.6, 2.2, 0.8, math.radians(24.0)
_LENGTH = 1.2
"""Length of a rover that is seen well from there [m]; the camera stands off more for longer
ones."""
_FIELD_OF_VIEW = math.radians(62.0)
SHARED = 3.0
"""How large a piece of the world may be that frames share, over that of one frame."""


def write_film(world: World, result: DriveResult, path: Path) -> Path:
    """Write the drive as an animated WebP, seen from behind the rover, with a map of the path."""
    poses = np.unique(np.linspace(0, len(result.time) - 1, FRAMES).round().astype(int)).tolist()
    planned = next(t for t in world.trajectories if t.name == result.path).position[:, :2]
    frames = list[Image.Image]()
    for together in _shared(world, result, poses):
        with _Set(world, result, together) as scenery, worker_threads(2) as pool:
            # While one frame's rays are cast, the next one is begun and the last one is drawn on.
            frames += pool.map(partial(_frame, scenery, planned), together)
    times = [_FRAME_MS] * (len(frames) - 1) + [_LAST_MS]
    frames[0].save(
        path, format="WEBP", save_all=True, append_images=frames[1:], duration=times, loop=0,
        quality=_QUALITY, method=_EFFORT,
    )  # fmt: skip
    return path


def write_end(world: World, result: DriveResult, path: Path) -> Path:
    """Write a picture of the place where the drive ended."""
    width, height = END_SIZE
    last = len(result.time) - 1
    write_png(path, photograph(world, result, last, width=width, height=height))
    return path


def photograph(
    world: World, result: DriveResult, pose: int, *, width: int, height: int
) -> NDArray[np.uint8]:
    """The rover from behind and above at a pose of its drive; sRGB, shape [height, width, 3]."""
    with _Set(world, result, [pose]) as scenery:
        return scenery.photograph(pose, width=width, height=height)


def _shared(world: World, result: DriveResult, poses: list[int]) -> Iterator[list[int]]:
    """The poses in runs that show one piece of the world: it costs more than what passes there."""
    together = list[int]()
    alone = (2.0 * _reach(world)) ** 2
    for pose in poses:
        east, north, _ = np.ptp(result.position[[*together, pose]], axis=0) + 2.0 * _reach(world)
        if together and east * north > SHARED * alone:
            yield together
            together = []
        together.append(pose)
    yield together


def _reach(world: World) -> float:
    """How far around the rover a picture shows the ground [m]."""
    return _REACH + _away(world) - _BEHIND


def _away(world: World) -> float:
    """How far behind the rover the camera stands [m]."""
    return _BEHIND * max(world.rover.length / _LENGTH, 1.0)


class _Set:
    """A piece of the world in its light, through which the rover drives. Use it in a `with`."""

    def __init__(self, world: World, result: DriveResult, poses: list[int]) -> None:
        self.world, self.result = world, result
        subject = _around(world, result.position[poses], _reach(world))
        self._scene = RayScene(subject)
        self._stage = prepare_stage(self._scene, subject.lighting, 3)
        self._looks = rover_looks(world.rover)
        self._parts = _rover_parts(world.rover, self._looks, world.site.seed)
        self._shapes = BodyShapes(self._parts)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._shapes.close()
        self._scene.close()

    def photograph(self, pose: int, *, width: int, height: int) -> NDArray[np.uint8]:
        """The rover from behind and above at a pose; sRGB, shape [height, width, 3]."""
        position, away = self.result.position[pose], _away(self.world)
        # The mean heading around the pose, so that the camera swings calmly.
        yaw = self.result.rpy[max(pose - 15, 0) : pose + 16, 2]
        heading = math.atan2(np.sin(yaw).mean(), np.cos(yaw).mean())
        behind = position - away * np.array([math.cos(heading), math.sin(heading), 0.0])
        west, south, east, north = self._scene.subject.ground.bounds
        at = np.clip(behind[:2], (west, south), (east, north))
        lowest = float(self._scene.subject.ground.height_at(*at)) + _LOWEST
        behind[2] = max(position[2] + away * _ABOVE / _BEHIND, lowest)
        camera = pinhole_camera(
            position=behind, yaw=heading, pitch=_PITCH, field_of_view=_FIELD_OF_VIEW, width=width,
            height=height,
        )  # fmt: skip
        poses = link_poses(self.world.rover, self.result, pose)
        parts = [poses[look.link] for look in self._looks]
        places = np.array([place for place, _ in parts]).reshape(-1, 3)
        turns = np.array([turn for _, turn in parts]).reshape(-1, 3, 3)
        placed = self._shapes.placed(places - position, turns)  # held as long as rays are cast
        frame = np.column_stack([np.eye(3), position - self._scene.origin])[None]
        rover = Passing(placed.beyond(SKIN), frame, self._parts.rgb)
        return take_picture(self._scene, camera, stage=self._stage, rover=rover)


def _frame(scenery: _Set, planned: Array, pose: int) -> Image.Image:
    (width, height), result = _SIZE, scenery.result
    image = Image.fromarray(scenery.photograph(pose, width=width, height=height))
    draw = ImageDraw.Draw(image, "RGBA")
    travelled = np.linalg.norm(np.diff(result.position[: pose + 1], axis=0), axis=1).sum()
    draw.rectangle((0, height - 18, width, height), fill=_SHADE)
    text = (
        f"{result.path}   {result.time[pose]:.0f} s   {travelled:.1f} m   "
        f"tilt {math.degrees(result.tilt[pose]):.0f}°   "
        f"slip {100 * np.abs(result.wheel_slip[pose]).mean():.0f} %"
    )
    draw.text((_EDGE, height - 16), text, fill=_TEXT)
    _draw_inset(draw, planned, result.position[: pose + 1, :2], width)
    return image


def _draw_inset(draw: ImageDraw.ImageDraw, planned: Array, driven: Array, width: int) -> None:
    """A small map in the upper right corner, north up: the path, and how far it is driven."""
    low, high = planned.min(0), planned.max(0)
    scale = _INSET / max(float((high - low).max()), 1e-6)
    corner = np.array([width - _INSET - 2 * _EDGE, 0.0])
    draw.rectangle((corner[0], 0, width, _INSET + 2 * _EDGE), fill=_SHADE)
    middle = corner + _EDGE + 0.5 * _INSET

    def on_map(points: Array) -> list[tuple[float, float]]:
        offset = (points - 0.5 * (low + high)) * scale * (1.0, -1.0)
        return [(east, south) for east, south in (middle + offset).tolist()]

    draw.line(on_map(planned), fill=_PATH, width=3)
    if len(driven) > 1:
        draw.line(on_map(driven), fill=_TRACK, width=1)
    east, south = on_map(driven[-1:])[0]
    draw.ellipse((east - 3, south - 3, east + 3, south + 3), fill=_TEXT)


def _around(world: World, places: Array, reach: float) -> Subject:
    """The ground and the rocks so far around places, and what lies beyond, without rocks."""
    subject = subject_of(world, close=True)
    ground, rocks, grain = subject.ground, subject.instances, subject.node_grain
    rows, columns = ground.shape
    first, last = places.min(axis=0)[:2] - reach, places.max(axis=0)[:2] + reach
    column, row = (
        min(max(math.floor((first[n] - ground.origin[n]) / ground.spacing), 0), count - 2)
        for n, count in enumerate((columns, rows))
    )
    last_column, last_row = (
        math.ceil((last[n] - ground.origin[n]) / ground.spacing) for n in range(2)
    )
    wide = max(min(last_column, columns - 1) - column, 1)
    high = max(min(last_row, rows - 1) - row, 1)
    near = ((rocks.position[:, :2] > first - 2.0) & (rocks.position[:, :2] < last + 2.0)).all(
        axis=1
    )
    part = ground.cut(column=column, row=row, columns=wide, rows=high)
    nodes = np.s_[row : row + high + 1, column : column + wide + 1]
    rgb, material = subject.ground_rgb[nodes], world.appearance.material
    looks = world.appearance.replace(
        ground_rgb=rgb, material=None if material is None else material[nodes], drift=None
    )
    beyond = shape_horizon(site=world.site, border=Border.of(part, looks), layers=(), reach=None)
    return subject.replace(
        ground=part,
        ground_rgb=rgb,
        grain=grain[nodes],
        horizon=beyond,
        instances=rocks.select(near),
        tracks=(),
    )


def _rover_parts(rover: Rover, looks: list[RoverLook], seed: int) -> Instances:
    """The rover's visible shapes, one for each link and colour, of several tones."""
    parts = rover_instances(looks, rover.origins)
    tone = tones(np.int32(np.iinfo(np.int32).max - len(parts)) + parts.mesh, seed)
    return parts.replace(rgb=parts.rgb * tone[:, None])


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
        half = 0.5 * angles.get(link.name, 0.0)
        turn = matrix_from_quaternion(np.array([math.cos(half), *(math.sin(half) * link.axis)]))
        places[link.name] = origin + rotation @ link.origin, rotation @ turn
    return places
