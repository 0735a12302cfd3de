"""How much of the sky the ground sees, found once for all pictures of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import kernel, over_chunks
from terrain_forge.scene.embree import COHERENT
from terrain_forge.scene.packets import (
    ACTIVE,
    FAR,
    LANES,
    hit_normal,
    hit_rock,
    intersect8,
    occluded8,
    packet_memory,
    set_ray,
)
from terrain_forge.scene.scene import RayScene

_DIRECTIONS = 8
_REACH = 8.0
_LIFT = 2e-3
_GOLDEN = 2.399963229728653


def sky_shares(scene: RayScene) -> NDArray[np.float32]:
    """Share of the sky's light that gets to each node past ground and rocks, shape [rows, columns].

    A node and its next ones look to 32 places of the sky between them, and each is given the mean
    that weighs these alike. Nodes within a rock count for nothing.
    """
    ground = scene.subject.ground
    nodes = np.empty((*ground.shape, 3), np.float32)
    nodes[..., 0] = ground.east - scene.origin[0]
    nodes[..., 1] = (ground.north - scene.origin[1])[:, None]
    nodes[..., 2] = ground.elevation - scene.origin[2]
    number = np.arange(4 * _DIRECTIONS) + 0.5
    out, turn = np.sqrt(number / len(number)), _GOLDEN * number
    towards = np.stack([out * np.cos(turn), out * np.sin(turn), np.sqrt(1.0 - out * out)], axis=-1)
    directions = towards.reshape(_DIRECTIONS, 4, 3).swapaxes(0, 1).astype(np.float32)
    seen = np.zeros((*ground.shape, 2), np.float32)
    memory = packet_memory(ground.shape[0])
    turns = scene.subject.instances.rotation
    over_chunks(
        _look_up, ground.shape[0], scene.handle, COHERENT, nodes, directions, turns, memory, seen
    )
    for axis in (0, 1):
        ends = [(1, 1) if axis == a else (0, 0) for a in (0, 1)]
        wide = np.pad(seen, (*ends, (0, 0)), mode="reflect")
        take = [wide.take(range(k, k + ground.shape[axis]), axis=axis) for k in range(3)]
        seen = 0.25 * (take[0] + take[2]) + 0.5 * take[1]
    return np.asarray(seen[..., 0] / np.maximum(seen[..., 1], 1e-6), np.float32)


@kernel
def _look_up(begin, end, scene, query, nodes, directions, turns, memory, seen):  # type: ignore[no-untyped-def]
    """Fill in what some rows of nodes see, and whether they can."""
    columns = nodes.shape[1]
    up = (0.0, 0.0, 1.0)
    for row in range(begin, end):
        ray = memory[row]
        word, address = ray.view(np.uint32), ray.ctypes.data
        for first in range(0, columns, 2 * LANES):
            for odd in range(2):
                for lane in range(LANES):
                    column = min(first + 2 * lane + odd, columns - 1)
                    x, y, z = nodes[row, column]
                    set_ray(ray, word, lane, (x, y, z + _LIFT), up, 0.0, np.inf)
                intersect8(address + 4 * ACTIVE * LANES, scene, address, query)
                for lane in range(LANES):
                    rock = hit_rock(word, lane)
                    outside = rock < 0 or hit_normal(ray, lane, rock, turns)[2] < 0.0
                    column = first + 2 * lane + odd
                    if column < columns:
                        seen[row, column, 0], seen[row, column, 1] = 0.0, outside
                fan = directions[2 * (row & 1) + odd]
                for k in range(len(fan)):
                    towards = (fan[k, 0], fan[k, 1], fan[k, 2])
                    for lane in range(LANES):
                        column = min(first + 2 * lane + odd, columns - 1)
                        x, y, z = nodes[row, column]
                        set_ray(ray, word, lane, (x, y, z + _LIFT), towards, 0.0, _REACH)
                    occluded8(address + 4 * ACTIVE * LANES, scene, address, query)
                    for lane in range(LANES):
                        column = first + 2 * lane + odd
                        if column < columns and ray[FAR, lane] >= 0.0:
                            seen[row, column, 0] += seen[row, column, 1] / len(fan)
