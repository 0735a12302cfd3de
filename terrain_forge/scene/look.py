"""A look at a scene through a table of rays: radiance, depth, what is seen, what the Sun lights.

All that a pixel has besides radiance is that of its middle ray, and so are its normal and its
texture, which is filtered to the pixel's size. Only where surfaces or light change are eight rays
cast about the middle, symmetric to it, each to its own place on the Sun's disc: edges are smooth
and displaced by nothing, and no noise hangs on the screen. From pixels that the Sun lights in part
the search goes on to those beside them, until penumbrae of any width are done.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel, merged, over_chunks, stage_key
from terrain_forge.base.portable import norm, product
from terrain_forge.scene.bodies import Bodies, meet8, shade8
from terrain_forge.scene.embree import COHERENT
from terrain_forge.scene.grain import CLAST_SHARE
from terrain_forge.scene.lanes import (
    AIM_X,
    AIM_Y,
    AIM_Z,
    DIRECT,
    FLAT_X,
    FLAT_Y,
    FLAT_Z,
    HIT_X,
    HIT_Y,
    HIT_Z,
    LIFT,
    OWNER,
    RANGE,
    REST,
    SMOOTH_X,
    STEP,
    WORKSPACE,
    meet,
    shine,
)
from terrain_forge.scene.packets import (
    ACTIVE,
    DIRECTION_X,
    FAR,
    LANES,
    ORIGIN_X,
    ROWS,
    hit_rock,
    intersect8,
    occluded8,
    set_ray,
)
from terrain_forge.scene.relief import relief_about
from terrain_forge.scene.render import borrow
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.stage import Stage, Wheels, bands, prepare_wheels, triple32

_COLUMNS, _BAND = 4, 2
_0, _1, _FAR_AWAY = np.float32(0.0), np.float32(1.0), np.float32(np.inf)
_NEAR_LIFT, _FAR_LIFT = np.float32(5e-4), np.float32(2e-4)
_SAME = np.float32(0.03)
"""Part of the distance within which a ray sees the surface that its pixel's middle does."""
_BENT = np.float32(0.1)
"""Change of the slope of nearness, over nearness, that tells an edge within one surface."""
_CALM, _DARK_EDGE, _LIT_EDGE, _LIGHT, _PARTLY = (np.uint8(n) for n in range(5))
"""States of a pixel: nothing changes about it; surfaces change in the dark, in the Sun; the light
changes; and, once that is refined, the Sun lights a surface in part."""

# Eight rooks that do not see each other, symmetric to the middle of the board.
_ROOKS = (np.stack([np.arange(8), [3, 6, 0, 5, 2, 7, 1, 4]], axis=1) + 0.5) / 8.0 - 0.5
_RING = np.sqrt((np.array([2, 0, 3, 1, 1, 3, 0, 2]) + 0.5) / 4.0)
_ROUND = np.pi * (np.array([0.1, 0.85, 0.35, 0.6, 1.6, 1.35, 1.85, 1.1]))
_SAMPLES = np.column_stack(
    [_ROOKS, _RING * np.cos(_ROUND), _RING * np.sin(_ROUND)],
).astype(np.float32)
"""Place in the pixel and on the Sun's disc of each ray; the last ones mirror the first."""


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


class _Passing(NamedTuple):
    """Moving bodies as kernels need them."""

    handle: int
    rotation: NDArray[np.float64]
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    poses: NDArray[np.float64]
    parts: NDArray[np.float32]
    ball: tuple[np.float32, np.float32, np.float32, np.float32]
    """Middle and radius of a ball around them in the scene's frame [m]."""


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
        share=CLAST_SHARE,
        shadow=(lean * float(stage.sun[0]), lean * float(stage.sun[1])),
    )
    view = View(
        rays=_fixed(np.ascontiguousarray(rays, np.float32)),
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
    given = (scene.handle, COHERENT), stage, relief, wheels, _passing(rover, channels), view, seen
    over_chunks(_look_bands, -(-height // _BAND), *given)
    state = np.empty((height, width), np.uint8)
    over_chunks(_find_edges, height, seen, state)
    pixels = np.flatnonzero(state)
    while len(pixels):
        over_chunks(_refine, len(pixels), *given, state, pixels)
        more = np.empty(8 * len(pixels), np.int64)
        pixels = more[: _spread(state, pixels, more)]
    return seen


def _fixed(array: NDArray[Any]) -> NDArray[Any]:
    """An array that nobody may write to: for kernels that is another type, so they get no other."""
    view = array.view()
    view.setflags(write=False)
    return view


def _passing(rover: Rover | None, channels: int) -> _Passing:
    """Bodies and a ball around them for all of their poses."""
    if rover is None:
        nowhere = (0.0, 0.0, 0.0)
        bodies = Bodies(0, _fixed(np.zeros((0, 3, 3))), nowhere, nowhere)
        rover = Rover(bodies, np.zeros((1, 3, 4)), np.zeros((0, 3)))
    low, high = np.array(rover.bodies.low), np.array(rover.bodies.high)
    middles = product(rover.poses[:, :, :3], 0.5 * (low + high)) + rover.poses[:, :, 3]
    middle = 0.5 * (middles.min(axis=0) + middles.max(axis=0))
    radius = 0.5 * norm(high - low) + norm(middles - middle).max() + 1e-3
    return _Passing(
        handle=rover.bodies.handle,
        rotation=rover.bodies.rotation,
        low=rover.bodies.low,
        high=rover.bodies.high,
        poses=np.ascontiguousarray(rover.poses),
        parts=bands(rover.rgb, channels),
        ball=(*triple32(middle), np.float32(radius)),
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
def _meet_all(world, passing, pose, ray, own):  # type: ignore[no-untyped-def]
    """What the packet's rays meet first."""
    if passing.handle != 0 and _passes_ball(ray, passing.ball):
        meet8(world[0], passing, pose, world[1], ray, own)
    else:
        intersect8(ray.ctypes.data + 4 * ACTIVE * LANES, world[0], ray.ctypes.data, world[1])


@merged
def _lit_lanes(world, passing, pose, ray, own, lit):  # type: ignore[no-untyped-def]
    """Which of some lanes' rays meet nothing, as bits."""
    if lit == 0:
        return lit
    if passing.handle != 0 and _passes_ball(ray, passing.ball):
        shade8(world[0], passing, pose, world[1], ray, own)
    else:
        occluded8(ray.ctypes.data + 4 * ACTIVE * LANES, world[0], ray.ctypes.data, world[1])
    for lane in range(LANES):
        lit &= ~((ray[FAR, lane] < _0) << lane)
    return lit


@merged
def _pose_at(passing, pose, lane, row):  # type: ignore[no-untyped-def]
    """Note the bodies' pose of a lane in a row; where all rows have one it is noted already."""
    if len(passing.poses) > 1:
        for i in range(3):
            for j in range(4):
                pose[lane, i, j] = passing.poses[row, i, j]


@inner
def _room(count):  # type: ignore[no-untyped-def]
    """Packets that begin on a cache line."""
    raw = np.zeros(count * ROWS * LANES + 16, np.float32)
    start = (-raw.ctypes.data // 4) % 16
    return raw[start : start + count * ROWS * LANES].reshape(count, ROWS, LANES)


@merged
def _aim(space, lane, view, row, column, right, down):  # type: ignore[no-untyped-def]
    """Direction and angle of a place in a pixel, `right` and `down` of its middle [pixels]."""
    rays, turn = view.rays, view.turns[row]
    height, width = rays.shape[:2]
    west, east = max(column - 1, 0), min(column + 1, width - 1)
    north, south = max(row - 1, 0), min(row + 1, height - 1)
    across, along = _1 / np.float32(max(east - west, 1)), _1 / np.float32(max(south - north, 1))
    wide, high, length = _0, _0, _0
    for axis in range(3):
        a = (rays[row, east, axis] - rays[row, west, axis]) * across
        b = (rays[south, column, axis] - rays[north, column, axis]) * along
        ray = rays[row, column, axis] + right * a + down * b
        wide, high, length = wide + a * a, high + b * b, length + ray * ray
        space[AIM_X + LANES * axis + lane] = ray
    if wide == _0 or high == _0:
        wide = high = max(wide, high)
    space[STEP + lane] = np.sqrt(np.sqrt(wide * high))
    scale = _1 if right == _0 and down == _0 else _1 / np.sqrt(length)
    x, y, z = space[AIM_X + lane], space[AIM_Y + lane], space[AIM_Z + lane]
    for axis in range(3):
        turned = turn[3 * axis] * x + turn[3 * axis + 1] * y + turn[3 * axis + 2] * z
        space[AIM_X + LANES * axis + lane] = scale * turned


@merged
def _send(space, lane, ray, word, view, row):  # type: ignore[no-untyped-def]
    place = view.places[row]
    towards = (space[AIM_X + lane], space[AIM_Y + lane], space[AIM_Z + lane])
    set_ray(ray, word, lane, (place[0], place[1], place[2]), towards, _0, np.inf)


@merged
def _ask_sun(space, lane, ray, word, stage, a, b):  # type: ignore[no-untyped-def]
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
    if owner == np.float32(-2.0) or (rise <= _0 and owner != -_1):
        word[ACTIVE, lane] = 0
        return False
    lift = _NEAR_LIFT + _FAR_LIFT * space[RANGE + lane]
    start = (
        space[HIT_X + lane] + lift * flat[0],
        space[HIT_Y + lane] + lift * flat[1],
        space[HIT_Z + lane] + lift * flat[2] + space[LIFT + lane],
    )
    set_ray(ray, word, lane, start, towards, _0, np.inf)
    return True


@merged
def _look_packet(world, stage, relief, wheels, passing, view, room, space, left, top, seen):  # type: ignore[no-untyped-def]
    """Look through 4 × 2 pixels; those beyond the picture's edge repeat the last ones."""
    ray, own, pose = room
    word = ray.view(np.uint32)
    height, width = seen.depth.shape
    for lane in range(LANES):
        row = min(top + lane // _COLUMNS, height - 1)
        column = min(left + lane % _COLUMNS, width - 1)
        _aim(space, lane, view, row, column, _0, _0)
        _send(space, lane, ray, word, view, row)
        _pose_at(passing, pose, lane, row)
    _meet_all(world, passing, pose, ray, own)
    lit = 0
    for lane in range(LANES):
        place = view.places[min(top + lane // _COLUMNS, height - 1)]
        origin = (place[0], place[1], place[2])
        meet(space, lane, ray, word, hit_rock(word, lane), origin, stage, passing.parts)
        lit |= _ask_sun(space, lane, ray, word, stage, _0, _0) << lane
    lit = _lit_lanes(world, passing, pose, ray, own, lit)
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
    memory, workspace, poses = _room(2), np.zeros(WORKSPACE, np.float32), np.empty((LANES, 3, 4))
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
    workspace[0] = memory[0, 0, 0] + np.float32(poses[0, 0, 0])  # what is lent lives until here


@kernel
def _find_edges(begin, end, seen, state):  # type: ignore[no-untyped-def]
    """Mark the pixels of some rows in whose neighbourhood surfaces or light change."""
    height, width = state.shape
    seen = borrow(seen)
    owner, sunlit, distance = seen.instance, seen.sunlit, seen.distance
    for row in range(begin, end):
        north, south = max(row - 1, 0), min(row + 1, height - 1)
        for column in range(width):
            west, east = max(column - 1, 0), min(column + 1, width - 1)
            mine, found, lit, dark = owner[row, column], False, False, False
            for j in (north, row, south):
                for i in (west, column, east):
                    found = found or owner[j, i] != mine
                    if owner[j, i] != -2:
                        lit, dark = lit or sunlit[j, i], dark or not sunlit[j, i]
            if not found and mine != -2:
                near = _1 / distance[row, column]
                for one, other in (
                    (distance[row, west], distance[row, east]),
                    (distance[north, column], distance[south, column]),
                ):
                    found = found or abs(_1 / one + _1 / other - near - near) > _BENT * near
            if lit and dark:
                state[row, column] = _LIGHT
            elif found:
                state[row, column] = _LIT_EDGE if lit else _DARK_EDGE
            else:
                state[row, column] = _CALM


@merged
def _refine_pixel(  # type: ignore[no-untyped-def]
    world, stage, relief, wheels, passing, view, room, space, row, column, samples, state, seen
):
    """Expose a pixel by eight rays; returns whether the Sun lights a surface in part."""
    ray, own_ray, pose = room
    word = ray.view(np.uint32)
    mine, middle = seen.instance[row, column], seen.distance[row, column]
    for lane in range(LANES):
        _aim(space, lane, view, row, column, samples[lane, 0], samples[lane, 1])
        _send(space, lane, ray, word, view, row)
        _pose_at(passing, pose, lane, row)
    _meet_all(world, passing, pose, ray, own_ray)
    place = view.places[row]
    origin, own, lit, hits = (place[0], place[1], place[2]), 0, 0, 0
    for lane in range(LANES):
        owner = hit_rock(word, lane)
        far = ray[FAR, lane]
        beside = owner == -2 or abs(far - middle) < _SAME * middle
        own |= (owner == mine and beside) << lane
        hits |= (owner != -2) << lane
        meet(space, lane, ray, word, owner, origin, stage, passing.parts)
        a, b = samples[lane, 2], samples[lane, 3]
        lit |= _ask_sun(space, lane, ray, word, stage, a, b) << lane
    if state == _LIGHT:
        lit = _lit_lanes(world, passing, pose, ray, own_ray, lit)
    elif state == _DARK_EDGE:
        lit = 0
    alone = own == (1 << LANES) - 1
    if not alone:
        shine(space, stage, relief, wheels, view.behind, view.anchor)
    for channel in range(seen.radiance.shape[2]):
        direct, total = seen.direct[row, column, channel], _0
        rest = seen.radiance[row, column, channel]
        if seen.sunlit[row, column]:
            rest -= direct
        for lane in range(LANES):
            if not alone:
                rest = space[REST + LANES * channel + lane]
                direct = space[DIRECT + LANES * channel + lane]
            total += rest + np.float32((lit >> lane) & 1) * direct
        seen.radiance[row, column, channel] = total / np.float32(LANES)
    mixed = False
    for part in (own & hits, ~own & hits):
        mixed = mixed or ((lit & part) != 0 and (lit & part) != part)
    return mixed


@kernel
def _refine(  # type: ignore[no-untyped-def]
    begin, end, world, stage, relief, wheels, passing, view, seen, state, pixels
):
    """Expose some pixels anew and mark those that the Sun lights in part."""
    memory, workspace, poses = _room(2), np.zeros(WORKSPACE, np.float32), np.empty((LANES, 3, 4))
    for lane in range(LANES):
        poses[lane] = passing.poses[0]
    stage, relief, wheels = borrow(stage), borrow(relief), borrow(wheels)
    view, seen, passing = borrow(view), borrow(seen), borrow(passing)
    space, room = borrow((workspace,))[0], borrow((memory[0], memory[1], poses))
    width = state.shape[1]
    for n in range(begin, end):
        row, column = pixels[n] // width, pixels[n] % width
        mixed = _refine_pixel(
            world, stage, relief, wheels, passing, view, room, space, row, column, _SAMPLES,
            state[row, column], seen,
        )  # fmt: skip
        if mixed and state[row, column] == _LIGHT:
            state[row, column] = _PARTLY
    workspace[0] = memory[0, 0, 0] + np.float32(poses[0, 0, 0])  # what is lent lives until here


@kernel
def _spread(state, pixels, more):  # type: ignore[no-untyped-def]
    """List the pixels beside partly lit ones that are yet to be refined; returns how many."""
    height, width = state.shape
    count = 0
    for pixel in pixels:
        row, column = pixel // width, pixel % width
        if state[row, column] == _PARTLY:
            for j in range(max(row - 1, 0), min(row + 2, height)):
                for i in range(max(column - 1, 0), min(column + 2, width)):
                    if state[j, i] == _CALM:
                        state[j, i] = _LIGHT
                        more[count] = j * width + i
                        count += 1
    return count
