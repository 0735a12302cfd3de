"""Edges of surfaces and of light: pixels there are exposed anew.

Where surfaces change it is by four rays, where light changes by eight, each of which goes to a
place of its own on the Sun's disc.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import kernel, merged
from terrain_forge.scene.aiming import (
    ask_sun,
    keep,
    lit_lanes,
    meet_all,
    packet_room,
    pose_at,
    send,
    slopes,
)
from terrain_forge.scene.borrowing import borrow
from terrain_forge.scene.lanes import DIRECT, REST, STEP, WORKSPACE, meet
from terrain_forge.scene.packets import FAR, LANES, hit_rock
from terrain_forge.scene.shining import shine
from terrain_forge.scene.words import mixed

_0, _1 = np.float32(0.0), np.float32(1.0)
HALF = LANES // 2
"""Rays of a pixel where two share a packet."""
_SAME = np.float32(0.03)
"""Part of the distance within which a ray sees the surface that its pixel's middle does."""
_BENT = np.float32(0.1)
"""Change of the slope of nearness, over nearness, that tells an edge within one surface."""
_CALM, _DARK_EDGE, _LIT_EDGE, _LIGHT, _PARTLY = (np.uint8(n) for n in range(5))
"""States of a pixel: nothing changes about it; surfaces change in the dark, in the Sun; the light
changes; and, once that is refined, the Sun lights a surface in part."""

# Rooks that do not see each other, symmetric to the middle of the board: eight, and four.
_ROOKS = (np.stack([np.arange(8), [3, 6, 0, 5, 2, 7, 1, 4]], axis=1) + 0.5) / 8.0 - 0.5
_FEW = (np.stack([np.arange(4), [1, 3, 0, 2]], axis=1) + 0.5) / 4.0 - 0.5
_RING = np.sqrt((np.array([2, 0, 3, 1, 1, 3, 0, 2]) + 0.5) / 4.0)
_ROUND = np.pi * (np.array([0.1, 0.85, 0.35, 0.6, 1.6, 1.35, 1.85, 1.1]))
_SUN = np.stack([_RING * np.cos(_ROUND), _RING * np.sin(_ROUND)], axis=1)
_SAMPLES = np.stack([np.hstack([_ROOKS, _SUN]), np.hstack([np.tile(_FEW, (2, 1)), _SUN])]).astype(
    np.float32
)
"""Place in the pixel and on the Sun's disc of each ray of a packet for one pixel, and of one for
two; the last ones mirror the first."""
_TURNS = np.pi * (np.arange(64) + 0.5) / 64.0
_TURN = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1).astype(np.float32)
"""Turns of the places on the Sun's disc, of which each pixel takes its own: with the same for all a
wide penumbra would come in steps."""
_FINE, _HASH = np.float32(2.0**24), np.uint32(0xB5297A4D)


@kernel
def find_edges(begin, end, seen, state):  # type: ignore[no-untyped-def]
    """Mark the pixels of some rows in whose neighbourhood surfaces or light change."""
    height, width = state.shape
    seen = borrow(seen)
    owner, sunlit, distance = seen.instance, seen.sunlit, seen.distance
    for row in range(begin, end):
        north, south = max(row - 1, 0), min(row + 1, height - 1)
        for column in range(width):
            west, east = max(column - 1, 0), min(column + 1, width - 1)
            mine, found, lit, dark = owner[row, column], False, False, False
            for j, i in ((row, column), (row, west), (row, east), (north, column), (south, column)):
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
def _cast_about(world, passing, view, room, space, place, samples):  # type: ignore[no-untyped-def]
    """Send a packet through two pixels, or one twice, and find what it meets."""
    ray, own_ray, pose = room
    word = ray.view(np.uint32)
    rays = view.rays
    for lane in range(LANES):
        row, column = place[lane // HALF, 0], place[lane // HALF, 1]
        right, down, step = slopes(view, row, column)
        a, b = samples[lane, 0], samples[lane, 1]
        x = rays[row, column, 0] + a * right[0] + b * down[0]
        y = rays[row, column, 1] + a * right[1] + b * down[1]
        z = rays[row, column, 2] + a * right[2] + b * down[2]
        scale = _1 / np.sqrt(x * x + y * y + z * z)
        send(space, lane, ray, word, view, row, scale * x, scale * y, scale * z)
        space[STEP + lane] = step
        pose_at(passing, pose, lane, row)
    meet_all(world, passing, pose, ray, own_ray)


@merged
def _turn(view, row, column):  # type: ignore[no-untyped-def]
    """Cosine and sine of the turn of a pixel, which hangs on its direction and the camera's place.

    So it is the same in a part of a picture, and other in the other eye and in the next frame.
    """
    draw, ray, place = _HASH, view.rays[row, column], view.places[row]
    for number in (ray[0], ray[1], place[0], place[1]):
        draw = mixed(draw ^ np.uint32(np.int64(number * _FINE)))
    turn = _TURN[np.int64(draw >> np.uint32(26))]
    return turn[0], turn[1]


@merged
def _refine_packet(  # type: ignore[no-untyped-def]
    world, stage, relief, wheels, passing, view, room, space, place, samples, light, seen, state
):
    """Expose two pixels by four rays each, or one by eight; returns which of these are its own.

    The Sun is asked for one pixel alone, whose light changes; returns too which rays it reaches and
    which met a surface.
    """
    ray, own_ray, pose = room
    word = ray.view(np.uint32)
    _cast_about(world, passing, view, room, space, place, samples)
    own, lit, hits = 0, 0, 0
    for lane in range(LANES):
        row, column = place[lane // HALF, 0], place[lane // HALF, 1]
        mine, middle = seen.instance[row, column], seen.distance[row, column]
        owner, far = hit_rock(word, lane), ray[FAR, lane]
        beside = owner == -2 or abs(far - middle) < _SAME * middle
        own |= (owner == mine and beside) << lane
        hits |= (owner != -2) << lane
    alone = own == (1 << LANES) - 1
    if alone and not light:
        return own, lit, hits
    for lane in range(LANES):
        row, column = place[lane // HALF, 0], place[lane // HALF, 1]
        begin = view.places[row]
        origin = (begin[0], begin[1], begin[2])
        meet(space, lane, ray, word, hit_rock(word, lane), origin, stage, passing.parts)
        cosine, sine = _turn(view, row, column)
        a = cosine * samples[lane, 2] - sine * samples[lane, 3]
        b = sine * samples[lane, 2] + cosine * samples[lane, 3]
        faces = ask_sun(space, lane, ray, word, stage, a, b)
        lit |= (faces and state[row, column] != _DARK_EDGE) << lane
    if light:
        lit = lit_lanes(world, passing, pose, ray, own_ray, lit)
    if not alone:
        shine(space, stage, relief, wheels, view.behind, view.anchor)
    return own, lit, hits


@merged
def _note_pixel(space, row, column, first, count, own, lit, seen):  # type: ignore[no-untyped-def]
    """Set a pixel to the mean of some lanes, of which those that see its own surface share it."""
    alone = own == (1 << LANES) - 1
    for channel in range(seen.radiance.shape[2]):
        direct, total = seen.direct[row, column, channel], _0
        rest = seen.radiance[row, column, channel]
        if seen.sunlit[row, column]:
            rest -= direct
        for lane in range(first, first + count):
            if not alone:
                rest = space[REST + LANES * channel + lane]
                direct = space[DIRECT + LANES * channel + lane]
            total += rest + np.float32((lit >> lane) & 1) * direct
        seen.radiance[row, column, channel] = total / np.float32(count)


@kernel
def refine(  # type: ignore[no-untyped-def]
    begin, end, world, stage, relief, wheels, passing, view, seen, state, pairs
):
    """Expose some pixels anew and mark those that the Sun lights in part.

    A pixel whose light changes has a packet of its own, the others go by twos.
    """
    memory, workspace, poses = (
        packet_room(2),
        np.zeros(WORKSPACE, np.float32),
        np.empty((LANES, 3, 4)),
    )
    place = np.empty((2, 2), np.int64)
    for lane in range(LANES):
        poses[lane] = passing.poses[0]
    stage, relief, wheels = borrow(stage), borrow(relief), borrow(wheels)
    view, seen, passing = borrow(view), borrow(seen), borrow(passing)
    space, room = borrow((workspace,))[0], borrow((memory[0], memory[1], poses))
    width = state.shape[1]
    for n in range(begin, end):
        for k in range(2):
            place[k, 0], place[k, 1] = pairs[n, k] // width, pairs[n, k] % width
        one = pairs[n, 0] == pairs[n, 1]
        light = state[place[0, 0], place[0, 1]] == _LIGHT
        samples = _SAMPLES[0 if one else 1]
        own, lit, hits = _refine_packet(
            world, stage, relief, wheels, passing, view, room, space, place, samples, light, seen,
            state,
        )  # fmt: skip
        count = LANES if one else HALF
        for k in range(1 if one else 2):
            mask = ((1 << count) - 1) << (k * HALF)
            if light or own & mask != mask:
                _note_pixel(space, place[k, 0], place[k, 1], k * HALF, count, own, lit, seen)
        if light:
            for part in (own & hits, ~own & hits):
                if (lit & part) != 0 and (lit & part) != part:
                    state[place[0, 0], place[0, 1]] = _PARTLY
    keep(memory, poses, workspace)


def pair(state: NDArray[np.uint8], pixels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pixels as packets take them: by twos, those whose light changes with themselves."""
    light = state.ravel()[pixels] == _LIGHT
    edges, alone = pixels[~light], pixels[light]
    if len(edges) % 2:
        edges = np.append(edges, edges[-1])
    return np.concatenate([edges.reshape(-1, 2), np.repeat(alone, 2).reshape(-1, 2)])


@kernel
def spread(state, pixels, more):  # type: ignore[no-untyped-def]
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
