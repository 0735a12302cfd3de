"""Rays in packets of eight, laid out as Embree's `RTCRayHit8`, traced from compiled kernels."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from terrain_forge.base import inner, kernel

LANES = 8
"""Rays of a packet; eight is the native width of AVX2."""
(
    ORIGIN_X, ORIGIN_Y, ORIGIN_Z, NEAR, DIRECTION_X, DIRECTION_Y, DIRECTION_Z, TIME, FAR, MASK,
    RAY_ID, FLAGS, NORMAL_X, NORMAL_Y, NORMAL_Z, U, V, TRIANGLE, GEOMETRY, INSTANCE, COPY, ACTIVE,
) = range(22)  # fmt: skip
ROWS = 24
"""The 21 words of a ray and its hit, the mask of active lanes, and padding to whole cache lines."""
PACKET_BYTES = 4 * ROWS * LANES
NOTHING = np.uint32(0xFFFFFFFF)
"""Embree's index where there is none; also an active lane's mask."""
BODY = np.uint32(0xFFFFFFFE)
"""Stands for the geometry of a hit on a moving body (`bodies.meet8`), whose normal is final."""
CHUNKS = 64
"""Parts that a job is divided into, whatever the number of threads."""

_address = types.intp
_query = types.void(_address, _address, _address, _address)
intersect8 = types.ExternalFunction("rtcIntersect8", _query)
occluded8 = types.ExternalFunction("rtcOccluded8", _query)


def packet_memory(count: int = CHUNKS) -> NDArray[np.float32]:
    """Room for packets on a cache line's boundary, shape [count, ROWS, LANES]."""
    line = 64
    raw = np.zeros(count * PACKET_BYTES + line, dtype=np.uint8)
    start = -raw.ctypes.data % line
    whole = raw[start : start + count * PACKET_BYTES]
    return whole.view(np.float32).reshape(count, ROWS, LANES)


@inner
def set_ray(ray, word, lane, origin, direction, near, far):  # type: ignore[no-untyped-def]
    """Put an active ray into a lane: origin and direction as triples."""
    ray[ORIGIN_X, lane], ray[ORIGIN_Y, lane], ray[ORIGIN_Z, lane] = origin
    ray[DIRECTION_X, lane], ray[DIRECTION_Y, lane], ray[DIRECTION_Z, lane] = direction
    ray[NEAR, lane], ray[FAR, lane], ray[TIME, lane] = near, far, 0.0
    word[MASK, lane], word[RAY_ID, lane], word[FLAGS, lane] = NOTHING, 0, 0
    word[GEOMETRY, lane], word[INSTANCE, lane], word[COPY, lane] = NOTHING, NOTHING, NOTHING
    word[ACTIVE, lane] = NOTHING


@inner
def hit_rock(word, lane):  # type: ignore[no-untyped-def]
    """Row of the rock that a lane hit, or -1 ground, -2 nothing, -3 land beyond, -4 a body."""
    geometry = word[GEOMETRY, lane]
    if geometry == NOTHING:
        return -2
    if geometry == BODY:
        return -4
    if word[INSTANCE, lane] == NOTHING:
        return -1 if geometry == 0 else -3
    return np.int64(word[COPY, lane])


@inner
def hit_normal(ray, lane, rock, rotation):  # type: ignore[no-untyped-def]
    """Outward unit normal in the scene's frame of the triangle that a lane hit."""
    x = np.float64(ray[NORMAL_X, lane])
    y = np.float64(ray[NORMAL_Y, lane])
    z = np.float64(ray[NORMAL_Z, lane])
    if rock >= 0:
        turn = rotation[rock]
        x, y, z = (
            turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
            turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
            turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z,
        )
    elif z < 0.0 and rock != -4:
        x, y, z = -x, -y, -z
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@kernel
def cast_packets(  # type: ignore[no-untyped-def]
    begin, end, scene, query, origins, directions, rotation, packets, distance, normal, rock
):
    """Fill `distance`, `normal` and `rock` with the first hit of each ray of some chunks."""
    rows = -(-len(origins) // (LANES * CHUNKS)) * LANES  # of a chunk of whole packets
    for chunk in range(begin, end):
        ray = packets[chunk]
        word, address = ray.view(np.uint32), ray.ctypes.data
        stop = min((chunk + 1) * rows, len(origins))
        for first in range(chunk * rows, stop, LANES):
            filled = min(LANES, stop - first)
            for lane in range(LANES):
                word[ACTIVE, lane] = 0
            for lane in range(filled):
                o, d = origins[first + lane], directions[first + lane]
                origin = (np.float64(o[0]), np.float64(o[1]), np.float64(o[2]))
                direction = (np.float64(d[0]), np.float64(d[1]), np.float64(d[2]))
                set_ray(ray, word, lane, origin, direction, 0.0, np.inf)
            intersect8(address + 4 * ACTIVE * LANES, scene, address, query)
            for lane in range(filled):
                row, hit = first + lane, hit_rock(word, lane)
                x, y, z, distance[row] = 0.0, 0.0, 0.0, np.inf
                if hit != -2:
                    x, y, z = hit_normal(ray, lane, hit, rotation)
                    distance[row] = ray[FAR, lane]
                rock[row], normal[row, 0], normal[row, 1], normal[row, 2] = hit, x, y, z
