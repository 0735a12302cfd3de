"""How much of the sky the ground sees, found once for all pictures of a scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import kernel, over_chunks, portable
from terrain_forge.scene.camera import Camera
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
_STRIDES = (1, 2, 4)
_PIXELS = 12
"""Nodes that lie closer than so many pixels of a camera are interpolated."""
_BLEND = 8
"""Nodes over which finer ones fade in."""
_CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))


def sky_shares(scene: RayScene, camera: Camera | None = None) -> NDArray[np.float32]:
    """Share of the sky's light that gets to each node past ground and rocks, shape [rows, columns].

    A node and its next ones look to 32 places of the sky between them, and each is given the mean
    that weighs these alike. Nodes within a rock count for nothing; amid such ones it is 1, as on
    the rock's top. What one camera alone sees from afar, or not at all, is interpolated between
    every second or fourth node.
    """
    if camera is None:
        return _shares(scene, *(np.arange(number) for number in scene.subject.ground.shape))
    apart = scene.subject.ground.spacing / (_PIXELS * float(portable.norm(camera.right)))
    if not camera.pinhole:
        stride = max((s for s in _STRIDES if s * apart < 1.0), default=1)
        return _seen_from_above(scene, stride)
    shares = _seen_from_above(scene, _STRIDES[-1])
    for stride in reversed(_STRIDES[:-1]):
        _refine(scene, shares, camera, 2.0 * stride * apart, stride)
    return shares


def _seen_from_above(scene: RayScene, stride: int) -> NDArray[np.float32]:
    """The shares at every so many nodes, and between them."""
    rows, columns = (_every(0, number, stride) for number in scene.subject.ground.shape)
    return _filled(_shares(scene, rows, columns), rows, columns)


def _refine(
    scene: RayScene, shares: NDArray[np.float32], camera: Camera, reach: float, stride: int
) -> None:
    """Put in the shares at every so many nodes where a camera sees ground within a distance [m]."""
    ground, half = scene.subject.ground, 0.5 * np.array([camera.width, camera.height])
    corners = [a * half[0] * camera.right + b * half[1] * camera.down for a, b in _CORNERS]
    rays = np.array([camera.forward + corner for corner in corners])
    ends = camera.position + reach * rays / np.sqrt((rays * rays).sum(axis=1, keepdims=True))
    edges = []
    for axis, number in ((1, ground.shape[0]), (0, ground.shape[1])):
        places = np.append(ends[:, axis], camera.position[axis]) - ground.origin[axis]
        low, high = np.array([places.min(), places.max()]) / ground.spacing
        edges.append((max(0, int(low) - _BLEND), min(number, int(high) + _BLEND + 1), number))
    if any(high - low <= 2 * stride for low, high, _ in edges):
        return
    rows, columns = (_every(low, high, stride) for low, high, _ in edges)
    fine = _filled(_shares(scene, rows, columns), rows, columns)
    down, across = (_ramp(*edge) for edge in edges)
    weight = np.minimum(down[:, None], across)
    part = shares[slice(*edges[0][:2]), slice(*edges[1][:2])]
    part += weight * (fine - part)


def _ramp(low: int, high: int, number: int) -> NDArray[np.float32]:
    """1 within a window's rows, and falling to its ends where these are not the ground's."""
    place = np.arange(low, high)
    before = place - low if low else np.full(len(place), _BLEND)
    behind = high - 1 - place if high < number else np.full(len(place), _BLEND)
    return np.asarray(np.minimum(np.minimum(before, behind) / _BLEND, 1.0), np.float32)


def _every(low: int, high: int, stride: int) -> NDArray[np.int64]:
    """Every so many indices, and the last one."""
    return np.append(np.arange(low, high - 1, stride), high - 1)


def _filled(
    shares: NDArray[np.float32], rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Shares between the rows and columns where they are known."""
    for axis, known in ((0, rows), (1, columns)):
        wanted = np.arange(known[0], known[-1] + 1)
        if len(wanted) > len(known):
            first = np.minimum(np.searchsorted(known, wanted, "right") - 1, len(known) - 2)
            part = (wanted - known[first]) / np.diff(known)[first]
            part = np.expand_dims(part.astype(np.float32), 1 - axis)
            low, high = shares.take(first, axis), shares.take(first + 1, axis)
            shares = low + part * (high - low)
    return shares


def _shares(
    scene: RayScene, rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> NDArray[np.float32]:
    """The shares at the nodes of some rows and columns."""
    ground = scene.subject.ground
    nodes = np.empty((len(rows), len(columns), 3), np.float32)
    nodes[..., 0] = ground.east[columns] - scene.origin[0]
    nodes[..., 1] = (ground.north[rows] - scene.origin[1])[:, None]
    nodes[..., 2] = ground.elevation[np.ix_(rows, columns)] - scene.origin[2]
    number = np.arange(4 * _DIRECTIONS) + 0.5
    out, turn = np.sqrt(number / len(number)), _GOLDEN * number
    towards = np.stack([out * np.cos(turn), out * np.sin(turn), np.sqrt(1.0 - out * out)], axis=-1)
    directions = towards.reshape(_DIRECTIONS, 4, 3).swapaxes(0, 1).astype(np.float32)
    seen = np.zeros((*nodes.shape[:2], 2), np.float32)
    memory = packet_memory(len(rows))
    turns = scene.subject.instances.rotation
    over_chunks(_look_up, len(rows), scene.handle, COHERENT, nodes, directions, turns, memory, seen)
    for axis in (0, 1):
        ends = [(1, 1) if axis == a else (0, 0) for a in (0, 1)]
        wide = np.pad(seen, (*ends, (0, 0)), mode="reflect")
        take = [wide.take(range(k, k + nodes.shape[axis]), axis=axis) for k in range(3)]
        seen = 0.25 * (take[0] + take[2]) + 0.5 * take[1]
    share = seen[..., 0] / np.maximum(seen[..., 1], 1e-6)
    return np.asarray(np.where(seen[..., 1] > 0.0, share, 1.0), np.float32)


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
