"""Rays from a camera into a scene, and from what they meet to the Sun."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner, merged, portable
from terrain_forge.scene.bodies import SKIN, Bodies, meet8, shade8
from terrain_forge.scene.lanes import (
    AIM_X,
    AIM_Y,
    AIM_Z,
    FLAT_X,
    FLAT_Y,
    FLAT_Z,
    HIT_X,
    HIT_Y,
    HIT_Z,
    LIFT,
    OWNER,
    RANGE,
    STEP,
    WIDE,
)
from terrain_forge.scene.packets import (
    ACTIVE,
    DIRECTION_X,
    FAR,
    LANES,
    ORIGIN_X,
    ROWS,
    intersect8,
    occluded8,
    set_ray,
)
from terrain_forge.scene.stage import bands, triple32

_0, _HALF, _1, _FAR_AWAY = (np.float32(n) for n in (0.0, 0.5, 1.0, np.inf))
_THIN = np.float32(1e-12)
_MARGIN = 1e-3
"""What 32 bits may be wrong by where they tell whether a ray comes near bodies [m]."""
_NEAR_LIFT, _FAR_LIFT = np.float32(5e-4), np.float32(2e-4)


class View(NamedTuple):
    """Where a picture is taken from."""

    rays: NDArray[np.float32]
    """Unit directions in the optical frame (right, down, ahead), shape [height, width, 3]."""
    places: NDArray[np.float32]
    """Where the rays of each row begin in the scene's frame [m], shape [height, 3]."""
    turns: NDArray[np.float32]
    """From the optical frame to the scene's, row by row, shape [height, 9]."""
    anchor: tuple[np.float32, np.float32]
    """Where the relief's places count from in the scene's frame [m]."""
    behind: np.float32
    """Wheels have been so far along their path [m]."""


class Rover(NamedTuple):
    """Moving bodies in the picture."""

    bodies: Bodies
    """The bodies, in a frame of their own."""
    poses: NDArray[np.float64]
    """That frame in the scene's own, at all rows or each, shape [1 or height, 3, 4]."""
    rgb: NDArray[np.float64]
    """Linear albedo of the bodies' parts, shape [parts, 3]."""


class Passing(NamedTuple):
    """Moving bodies as kernels need them."""

    handle: int
    rotation: NDArray[np.float64]
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    near: float
    poses: NDArray[np.float64]
    parts: NDArray[np.float32]
    ball: tuple[np.float32, np.float32, np.float32, np.float32]
    """Middle and radius of a ball around them in the scene's frame [m]."""
    turn: NDArray[np.float32]
    """The first pose, shape [3, 4]."""
    box: NDArray[np.float32]
    """Corners of a box around them in their frame, a little more than `low` and `high` [m], shape
    [2, 3]."""


def fixed(array: NDArray[Any]) -> NDArray[Any]:
    """An array that nobody may write to: for kernels that is another type, so they get no other."""
    view = array.view()
    view.setflags(write=False)
    return view


def passing_bodies(rover: Rover | None, channels: int) -> Passing:
    """Bodies and a ball around them for all of their poses."""
    if rover is None:
        nowhere = (0.0, 0.0, 0.0)
        bodies = Bodies(0, fixed(np.zeros((0, 3, 3))), nowhere, nowhere, SKIN)
        rover = Rover(bodies, np.zeros((1, 3, 4)), np.zeros((0, 3)))
    low, high = np.array(rover.bodies.low), np.array(rover.bodies.high)
    middles = portable.product(rover.poses[:, :, :3], 0.5 * (low + high)) + rover.poses[:, :, 3]
    middle = 0.5 * (middles.min(axis=0) + middles.max(axis=0))
    radius = 0.5 * portable.norm(high - low) + portable.norm(middles - middle).max() + _MARGIN
    return Passing(
        handle=rover.bodies.handle,
        rotation=rover.bodies.rotation,
        low=rover.bodies.low,
        high=rover.bodies.high,
        near=rover.bodies.near,
        poses=np.ascontiguousarray(rover.poses),
        parts=bands(rover.rgb, channels),
        ball=(*triple32(middle), np.float32(radius)),
        turn=np.ascontiguousarray(rover.poses[0], np.float32),
        box=np.array([low - _MARGIN, high + _MARGIN], np.float32),
    )


@merged
def _passes_ball(ray, ball):  # type: ignore[no-untyped-def]
    """Whether a ray of the packet may come through the ball."""
    nearest = _FAR_AWAY
    for lane in range(LANES):
        x, y, z = (
            ball[0] - ray[ORIGIN_X, lane], ball[1] - ray[ORIGIN_X + 1, lane],
            ball[2] - ray[ORIGIN_X + 2, lane],
        )  # fmt: skip
        a, b, c = (
            ray[DIRECTION_X, lane], ray[DIRECTION_X + 1, lane], ray[DIRECTION_X + 2, lane]
        )  # fmt: skip
        along = max(x * a + y * b + z * c, _0)
        x, y, z = x - along * a, y - along * b, z - along * c
        nearest = min(nearest, x * x + y * y + z * z)
    return nearest <= ball[3] * ball[3]


@merged
def _passes_box(ray, turn, box):  # type: ignore[no-untyped-def]
    """Whether a ray of the packet may come through the box, which is at one pose for all."""
    passing = False
    for lane in range(LANES):
        x, y, z = (
            ray[ORIGIN_X, lane] - turn[0, 3], ray[ORIGIN_X + 1, lane] - turn[1, 3],
            ray[ORIGIN_X + 2, lane] - turn[2, 3],
        )  # fmt: skip
        a, b, c = (
            ray[DIRECTION_X, lane], ray[DIRECTION_X + 1, lane], ray[DIRECTION_X + 2, lane]
        )  # fmt: skip
        begin, end = _0, _FAR_AWAY
        for axis in range(3):
            at = turn[0, axis] * x + turn[1, axis] * y + turn[2, axis] * z
            along = turn[0, axis] * a + turn[1, axis] * b + turn[2, axis] * c
            per = _1 / (along if abs(along) > _THIN else _THIN)
            one, other = (box[0, axis] - at) * per, (box[1, axis] - at) * per
            begin, end = max(begin, min(one, other)), min(end, max(one, other))
        if begin <= end:
            passing = True
    return passing


@merged
def _may_meet(passing, ray):  # type: ignore[no-untyped-def]
    """Whether a ray of the packet may meet a body; all of them need not be turned else."""
    if passing.handle == 0:
        return False
    if len(passing.poses) > 1:
        return _passes_ball(ray, passing.ball)
    return _passes_box(ray, passing.turn, passing.box)


@merged
def meet_all(world, passing, pose, ray, own):  # type: ignore[no-untyped-def]
    """What the packet's rays meet first."""
    if _may_meet(passing, ray):
        meet8(world[0], passing, pose, world[1], ray, own)
    else:
        intersect8(ray.ctypes.data + 4 * ACTIVE * LANES, world[0], ray.ctypes.data, world[1])


@merged
def lit_lanes(world, passing, pose, ray, own, lit):  # type: ignore[no-untyped-def]
    """Which of some lanes' rays meet nothing, as bits."""
    if lit == 0:
        return lit
    if _may_meet(passing, ray):
        shade8(world[0], passing, pose, world[1], ray, own)
    else:
        occluded8(ray.ctypes.data + 4 * ACTIVE * LANES, world[0], ray.ctypes.data, world[1])
    for lane in range(LANES):
        lit &= ~((ray[FAR, lane] < _0) << lane)
    return lit


@merged
def pose_at(passing, pose, lane, row):  # type: ignore[no-untyped-def]
    """Note the bodies' pose of a lane in a row; where all rows have one it is noted already."""
    if len(passing.poses) > 1:
        for i in range(3):
            for j in range(4):
                pose[lane, i, j] = passing.poses[row, i, j]


@inner
def packet_room(count):  # type: ignore[no-untyped-def]
    """Packets that begin on a cache line."""
    raw = np.zeros(count * ROWS * LANES + 16, np.float32)
    start = (-raw.ctypes.data // 4) % 16
    return raw[start : start + count * ROWS * LANES].reshape(count, ROWS, LANES)


@inner
def keep(memory, poses, workspace):  # type: ignore[no-untyped-def]
    """Use arrays that were borrowed until here, or their owner would free them too early."""
    memory[0, 0, 0], poses[0, 0, 0], workspace[0] = _0, 0.0, _0


@inner
def slopes(view, row, column):  # type: ignore[no-untyped-def]
    """How a pixel's direction changes to the right and down, and the angle of a pixel [rad]."""
    rays = view.rays
    height, width = rays.shape[:2]
    west, east = max(column - 1, 0), min(column + 1, width - 1)
    north, south = max(row - 1, 0), min(row + 1, height - 1)
    across, along = _1 / np.float32(max(east - west, 1)), _1 / np.float32(max(south - north, 1))
    a, b = (
        (
            (rays[row, east, 0] - rays[row, west, 0]) * across,
            (rays[row, east, 1] - rays[row, west, 1]) * across,
            (rays[row, east, 2] - rays[row, west, 2]) * across,
        ),
        (
            (rays[south, column, 0] - rays[north, column, 0]) * along,
            (rays[south, column, 1] - rays[north, column, 1]) * along,
            (rays[south, column, 2] - rays[north, column, 2]) * along,
        ),
    )
    wide = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    high = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    if wide == _0 or high == _0:
        wide = high = max(wide, high)
    return a, b, np.sqrt(np.sqrt(wide * high))


@merged
def send(space, lane, ray, word, view, row, x, y, z):  # type: ignore[no-untyped-def]
    """Send a lane from a row's place along a unit vector of the optical frame."""
    turn, place = view.turns[row], view.places[row]
    towards = (
        turn[0] * x + turn[1] * y + turn[2] * z,
        turn[3] * x + turn[4] * y + turn[5] * z,
        turn[6] * x + turn[7] * y + turn[8] * z,
    )
    space[AIM_X + lane], space[AIM_Y + lane], space[AIM_Z + lane] = towards
    set_ray(ray, word, lane, (place[0], place[1], place[2]), towards, _0, np.inf)


@merged
def ask_sun(space, lane, ray, word, stage, a, b):  # type: ignore[no-untyped-def]
    """Aim a lane from its surface at a place of the Sun; returns whether it may see it."""
    sun, up, side = stage.sun, stage.sun_up, stage.sun_side
    towards = (
        sun[0] + a * side[0] + b * up[0],
        sun[1] + a * side[1] + b * up[1],
        sun[2] + a * side[2] + b * up[2],
    )
    owner = space[OWNER + lane]
    flat = (space[FLAT_X + lane], space[FLAT_Y + lane], space[FLAT_Z + lane])
    rise = towards[0] * flat[0] + towards[1] * flat[1] + towards[2] * flat[2]
    # The ground is smoother than its triangles: those that the Sun lies behind may be lit.
    smooth = owner == -_1 or (owner == np.float32(-3.0) and space[WIDE + lane] == _0)
    if owner == np.float32(-2.0) or (rise <= _0 and not smooth):
        word[ACTIVE, lane] = 0
        return False
    # Half a pixel at most, where it is a look through a telescope.
    lift = _NEAR_LIFT + min(_FAR_LIFT, _HALF * space[STEP + lane]) * space[RANGE + lane]
    start = (
        space[HIT_X + lane] + lift * flat[0],
        space[HIT_Y + lane] + lift * flat[1],
        space[HIT_Z + lane] + lift * flat[2] + space[LIFT + lane],
    )
    set_ray(ray, word, lane, start, towards, _0, np.inf)
    return True
