"""A look at a scene through a table of rays: radiance, depth, what is seen, what the Sun lights.

All that a pixel has besides radiance is that of its middle ray, and so are its normal and its
texture, which is filtered to the pixel's size. Only where surfaces change are four rays cast about
the middle, symmetric to it, and eight where light does, each to its own place on the Sun's disc:
edges are smooth and displaced by nothing. These places are turned for each pixel by its direction
and the camera's place, so that penumbrae have no steps and no noise hangs on the screen. From
pixels that the Sun lights in part the search goes on to those beside them, until penumbrae of any
width are done.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel, merged, over_chunks, stage_key
from terrain_forge.scene.aiming import (
    Rover,
    View,
    ask_sun,
    fixed,
    keep,
    lit_lanes,
    meet_all,
    packet_room,
    passing_bodies,
    pose_at,
    send,
    slopes,
)
from terrain_forge.scene.borrowing import borrow
from terrain_forge.scene.edges import find_edges, pair, refine, spread
from terrain_forge.scene.embree import COHERENT
from terrain_forge.scene.lanes import DIRECT, OWNER, RANGE, REST, SMOOTH_X, STEP, WORKSPACE, meet
from terrain_forge.scene.packets import LANES, hit_rock
from terrain_forge.scene.points import SIDE, add_points
from terrain_forge.scene.relief import relief_about
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.shining import shine
from terrain_forge.scene.stage import Stage, Wheels, prepare_wheels

_COLUMNS, _BAND = 4, 2
_0 = np.float32(0.0)


class Seen(NamedTuple):
    """What a look finds, in arrays to be filled; `Exposure` tells what they hold."""

    radiance: NDArray[np.float32]
    direct: NDArray[np.float32]
    depth: NDArray[np.float32]
    distance: NDArray[np.float32]
    instance: NDArray[np.int32]
    normal: NDArray[np.float32]
    sunlit: NDArray[np.bool_]


def look(
    scene: RayScene,
    stage: Stage,
    *,
    rays: NDArray[np.float32],
    position: Array,
    rotation: Array,
    wheels: Wheels | None = None,
    behind: float = -np.inf,
    rover: Rover | None = None,
) -> Seen:
    """Look at a scene; the result depends on no number of threads.

    Args:
        scene: What is looked at.
        stage: Its surfaces and light, in one channel or three.
        rays: Unit directions in the optical frame (right, down, ahead), shape [height, width, 3].
        position: Where the rays of each row begin in the world [m], shape [height, 3].
        rotation: From the optical frame to the world's of each row, shape [height, 3, 3].
        wheels: Tracks, if there are any.
        behind: How far along their path the wheels have been [m].
        rover: Moving bodies, if there are any.
    """
    height, width = rays.shape[:2]
    channels = stage.colours.shape[1]
    places = (position - scene.origin).astype(np.float32)
    middle = places[height // 2, :2]
    lean = 1.0 / max(float(stage.sun[2]), 0.3)
    relief = relief_about(
        scene.origin[:2] + middle,
        key=stage_key(scene.subject.seed, "grain"),
        spacing=float(stage.spacing),
        rough=float(stage.rough),
        shadow=(lean * float(stage.sun[0]), lean * float(stage.sun[1])),
    )
    view = View(
        rays=fixed(np.ascontiguousarray(rays, np.float32)),
        places=places,
        turns=np.ascontiguousarray(rotation, np.float32).reshape(height, 9),
        anchor=(middle[0], middle[1]),
        behind=np.float32(behind),
    )
    seen = Seen(
        radiance=np.empty((height, width, channels), np.float32),
        direct=np.empty((height, width, channels), np.float32),
        depth=np.empty((height, width), np.float32),
        distance=np.empty((height, width), np.float32),
        instance=np.empty((height, width), np.int32),
        normal=np.empty((height, width, 3), np.float32),
        sunlit=np.empty((height, width), np.bool_),
    )
    wheels = wheels or prepare_wheels(scene, scene.origin[None, :2])
    given = (
        (scene.handle, COHERENT),
        stage,
        relief,
        wheels,
        passing_bodies(rover, channels),
        view,
        seen,
    )
    over_chunks(_look_bands, -(-height // _BAND), *given)
    state = np.empty((height, width), np.uint8)
    over_chunks(find_edges, height, seen, state)
    pixels = np.flatnonzero(state)
    while len(pixels):
        pairs = pair(state, pixels)
        over_chunks(refine, len(pairs), *given, state, pairs)
        more = np.empty(8 * len(pixels), np.int64)
        pixels = more[: spread(state, pixels, more)]
    if len(stage.points):
        over_chunks(add_points, -(-height // SIDE), stage.points, stage.point_rgb, view, seen)
    return seen


@merged
def _look_packet(world, stage, relief, wheels, passing, view, room, space, left, top, seen):  # type: ignore[no-untyped-def]
    """Look through 4 × 2 pixels; those beyond the picture's edge repeat the last ones."""
    ray, own, pose = room
    word = ray.view(np.uint32)
    height, width = seen.depth.shape
    for lane in range(LANES):
        row = min(top + lane // _COLUMNS, height - 1)
        column = min(left + lane % _COLUMNS, width - 1)
        rays = view.rays
        x, y, z = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]
        send(space, lane, ray, word, view, row, x, y, z)
        space[STEP + lane] = slopes(view, row, column)[2]
        pose_at(passing, pose, lane, row)
    meet_all(world, passing, pose, ray, own)
    lit = 0
    for lane in range(LANES):
        place = view.places[min(top + lane // _COLUMNS, height - 1)]
        origin = (place[0], place[1], place[2])
        meet(space, lane, ray, word, hit_rock(word, lane), origin, stage, passing.parts)
        lit |= ask_sun(space, lane, ray, word, stage, _0, _0) << lane
    lit = lit_lanes(world, passing, pose, ray, own, lit)
    shine(space, stage, relief, wheels, view.behind, view.anchor)
    for lane in range(LANES):
        row, column = top + lane // _COLUMNS, left + lane % _COLUMNS
        if row < height and column < width:
            _note(space, lane, view, (lit >> lane) & 1, row, column, seen)


@merged
def _note(space, lane, view, sunlit, row, column, seen):  # type: ignore[no-untyped-def]
    owner = np.int32(space[OWNER + lane])
    missed = owner == -2
    seen.instance[row, column], seen.sunlit[row, column] = owner, sunlit
    far = np.float32(np.inf) if missed else space[RANGE + lane]
    seen.distance[row, column] = far
    seen.depth[row, column] = far if missed else far * view.rays[row, column, 2]
    for axis in range(3):
        normal = _0 if missed else space[SMOOTH_X + LANES * axis + lane]
        seen.normal[row, column, axis] = normal
    for channel in range(seen.radiance.shape[2]):
        direct = space[DIRECT + LANES * channel + lane]
        seen.direct[row, column, channel] = direct
        seen.radiance[row, column, channel] = (
            space[REST + LANES * channel + lane] + np.float32(sunlit) * direct
        )


@kernel
def _look_bands(  # type: ignore[no-untyped-def]
    begin, end, world, stage, relief, wheels, passing, view, seen
):
    """Look through bands of two rows."""
    memory, workspace, poses = (
        packet_room(2),
        np.zeros(WORKSPACE, np.float32),
        np.empty((LANES, 3, 4)),
    )
    for lane in range(LANES):
        poses[lane] = passing.poses[0]
    stage, relief, wheels = borrow(stage), borrow(relief), borrow(wheels)
    view, seen, passing = borrow(view), borrow(seen), borrow(passing)
    space, room = borrow((workspace,))[0], borrow((memory[0], memory[1], poses))
    for band in range(begin, end):
        for left in range(0, seen.depth.shape[1], _COLUMNS):
            _look_packet(
                world, stage, relief, wheels, passing, view, room, space, left, band * _BAND,
                seen,
            )  # fmt: skip
    keep(memory, poses, workspace)
