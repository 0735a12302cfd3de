"""Geometry that several rooms need."""

from __future__ import annotations

import numpy as np

from terrain_forge.base.arrays import Array
from terrain_forge.base.kernels import inner


def fibonacci_sphere(count: int) -> Array:
    """`count` unit vectors spread evenly, shape [count, 3] (golden-angle spiral)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * index
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=1)


def rectangle_distance(xy: Array, rectangle: tuple[float, float, float, float]) -> Array:
    """Distance of points, shape [points, 2], to a rectangle (west, south, east, north)."""
    beyond = np.maximum(rectangle[:2] - xy, xy - np.array(rectangle[2:]))
    return np.asarray(np.hypot(*np.maximum(beyond, 0.0).T))


@inner
def segment_square_distance(segment, x, y):  # type: ignore[no-untyped-def]
    """Square of the distance of a point to a segment (x, y, x, y of its ends), for kernels."""
    along_x, along_y = segment[2] - segment[0], segment[3] - segment[1]
    off_x, off_y = x - segment[0], y - segment[1]
    square = along_x * along_x + along_y * along_y
    if square > 0.0:
        part = min(max((off_x * along_x + off_y * along_y) / square, 0.0), 1.0)
        off_x, off_y = off_x - part * along_x, off_y - part * along_y
    return off_x * off_x + off_y * off_y
