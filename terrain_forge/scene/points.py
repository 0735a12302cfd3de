"""Points of light in a sky, spread over the pixels about them so that places and sums are kept."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner, kernel
from terrain_forge.scene.aiming import slopes
from terrain_forge.scene.borrowing import borrow

SIDE = 32
"""Pixels along a side of the tiles that a picture is searched in."""
_MISSED = -2
_0, _1 = np.float32(0.0), np.float32(1.0)


@inner
def _aim(view, row, column):  # type: ignore[no-untyped-def]
    """A pixel's direction in the scene's frame."""
    x, y, z = view.rays[row, column, 0], view.rays[row, column, 1], view.rays[row, column, 2]
    turn = view.turns[row]
    return (
        turn[0] * x + turn[1] * y + turn[2] * z,
        turn[3] * x + turn[4] * y + turn[5] * z,
        turn[6] * x + turn[7] * y + turn[8] * z,
    )


@inner
def _near(view, towards, top, left, found):  # type: ignore[no-untyped-def]
    """List the points that may be seen in a tile; returns how many."""
    height, width = view.rays.shape[:2]
    bottom, right = min(top + SIDE, height) - 1, min(left + SIDE, width) - 1
    a, b, c = _aim(view, (top + bottom) // 2, (left + right) // 2)
    far = _0
    for row, column in ((top, left), (top, right), (bottom, left), (bottom, right)):
        x, y, z = _aim(view, row, column)
        x, y, z = x - a, y - b, z - c
        far = max(far, x * x + y * y + z * z)
    step = slopes(view, (top + bottom) // 2, (left + right) // 2)[2]
    reach = np.float32(1.3) * np.sqrt(far) + np.float32(4.0) * step
    count = 0
    for n in range(len(towards)):
        x, y, z = towards[n, 0] - a, towards[n, 1] - b, towards[n, 2] - c
        if x * x + y * y + z * z < reach * reach:
            found[count] = n
            count += 1
    return count


@inner
def _add(view, point, row, column):  # type: ignore[no-untyped-def]
    """Part of a point's light that a pixel gets, over the pixel's solid angle."""
    turn = view.turns[row]
    x = turn[0] * point[0] + turn[3] * point[1] + turn[6] * point[2] - view.rays[row, column, 0]
    y = turn[1] * point[0] + turn[4] * point[1] + turn[7] * point[2] - view.rays[row, column, 1]
    z = turn[2] * point[0] + turn[5] * point[1] + turn[8] * point[2] - view.rays[row, column, 2]
    right, down, step = slopes(view, row, column)
    if x * x + y * y + z * z > np.float32(16.0) * step * step:
        return _0
    aa = right[0] * right[0] + right[1] * right[1] + right[2] * right[2]
    bb = down[0] * down[0] + down[1] * down[1] + down[2] * down[2]
    ab = right[0] * down[0] + right[1] * down[1] + right[2] * down[2]
    across = x * right[0] + y * right[1] + z * right[2]
    along = x * down[0] + y * down[1] + z * down[2]
    area = aa * bb - ab * ab
    if area <= _0:
        return _0
    u, v = (across * bb - along * ab) / area, (along * aa - across * ab) / area
    return max(_0, _1 - abs(u)) * max(_0, _1 - abs(v)) / np.sqrt(area)


@kernel
def add_points(begin, end, towards, rgb, view, seen):  # type: ignore[no-untyped-def]
    """Add points of the sky to the pixels that see it, in some rows of tiles."""
    view, seen = borrow(view), borrow(seen)
    found = np.empty(len(towards), np.int64)
    height, width = seen.instance.shape
    for top in range(begin * SIDE, min(end * SIDE, height), SIDE):
        for left in range(0, width, SIDE):
            count = _near(view, towards, top, left, found)
            for row in range(top, min(top + SIDE, height) if count else top):
                for column in range(left, min(left + SIDE, width)):
                    if seen.instance[row, column] != _MISSED:
                        continue
                    for k in range(count):
                        part = _add(view, towards[found[k]], row, column)
                        for channel in range(rgb.shape[1]):
                            seen.radiance[row, column, channel] += part * rgb[found[k], channel]
