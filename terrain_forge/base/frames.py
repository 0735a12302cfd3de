"""Conversions at the boundaries, one named function each (docs/conventions.md).

Inside terrain-forge: right-handed ENU, metres, radians, quaternions (w, x, y, z), grid rows that
run north, linear light. Degrees, image rows, other quaternion orders, sRGB exist only where a file
or a person needs them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, portable


def image_rows(grid: NDArray[Any]) -> NDArray[Any]:
    """Turn rows that run north into image rows that run south (and back)."""
    return grid[::-1]


def xyzw(quaternion: Array) -> Array:
    """Reorder quaternions (w, x, y, z) as (x, y, z, w), shape [..., 4]."""
    return np.roll(quaternion, -1, axis=-1)


def compass_to_direction(azimuth_rad: float, elevation_rad: float) -> Array:
    """Unit vector (east, north, up) towards a compass azimuth (clockwise from north)."""
    level, up = np.cos(elevation_rad), np.sin(elevation_rad)
    return np.array([level * np.sin(azimuth_rad), level * np.cos(azimuth_rad), up])


def quaternion_from_rpy(rpy: Array) -> Array:
    """Quaternions (w, x, y, z), shape [..., 4], of roll, pitch, yaw [rad], shape [..., 3].

    Fixed axes x, then y, then z (ROS and SDF): R = Rz(yaw) Ry(pitch) Rx(roll). Positive pitch is
    nose down, since x is forward and z is up.
    """
    half = 0.5 * np.asarray(rpy, dtype=np.float64)
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(half), -1, 0), np.moveaxis(np.sin(half), -1, 0)
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def rpy_from_matrix(rotation: Array) -> Array:
    """Roll, pitch, yaw [rad], shape [..., 3], of rotation matrices, shape [..., 3, 3]."""
    return np.stack(
        [
            portable.arctan2(rotation[..., 2, 1], rotation[..., 2, 2]),
            portable.arcsin(np.clip(-rotation[..., 2, 0], -1.0, 1.0)),
            portable.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]),
        ],
        axis=-1,
    )


def matrix_from_quaternion(quaternion: Array) -> Array:
    """Rotation matrices, shape [..., 3, 3], of unit quaternions (w, x, y, z), shape [..., 4]."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        axis=-2,
    )


def quaternion_from_matrix(rotation: Array) -> Array:
    """Unit quaternions (w, x, y, z), w not negative, shape [..., 4], of rotations.

    Of the four squares that the trace gives, the largest is the one that is divided by
    (Shepperd 1978, doi:10.2514/3.55767b).
    """
    r = np.asarray(rotation, np.float64)
    d0, d1, d2 = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    squares = np.stack([1 + d0 + d1 + d2, 1 + d0 - d1 - d2, 1 - d0 + d1 - d2, 1 - d0 - d1 + d2], -1)
    x, y, z = (r[..., i, j] - r[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0)))
    xy, xz, yz = (r[..., i, j] + r[..., j, i] for i, j in ((1, 0), (0, 2), (2, 1)))
    rows = np.stack(
        [
            np.stack([squares[..., 0], x, y, z], -1),
            np.stack([x, squares[..., 1], xy, xz], -1),
            np.stack([y, xy, squares[..., 2], yz], -1),
            np.stack([z, xz, yz, squares[..., 3]], -1),
        ],
        axis=-2,
    )
    best = np.argmax(squares, axis=-1)[..., None, None]
    row = np.take_along_axis(rows, best, axis=-2)[..., 0, :]
    unit = row / portable.norm(row)[..., None]
    return np.asarray(np.where(unit[..., :1] < 0.0, -unit, unit))


def placed(position: Array, rotation: Array) -> Array:
    """Homogeneous matrices, shape [..., 4, 4], of places [m] and rotation matrices."""
    found = np.zeros((*np.shape(position)[:-1], 4, 4))
    found[..., :3, :3], found[..., :3, 3], found[..., 3, 3] = rotation, position, 1.0
    return found


def inverse_pose(pose: Array) -> Array:
    """The inverse of rigid transforms, shape [..., 4, 4]."""
    back = np.swapaxes(pose[..., :3, :3], -1, -2)
    return placed(-portable.product(back, pose[..., :3, 3:])[..., 0], back)


def rpy_from_quaternion(quaternion: Array) -> Array:
    """Roll, pitch, yaw [rad], wrapped, shape [..., 3], of quaternions (w, x, y, z)."""
    return rpy_from_matrix(matrix_from_quaternion(quaternion))


def linear_from_srgb(colour: ArrayLike) -> Array:
    """Linear light of sRGB values, both 0 to 1 (IEC 61966-2-1)."""
    values = np.asarray(colour, dtype=np.float64)
    curve = portable.power((values + 0.055) / 1.055, 2.4)
    return np.asarray(np.where(values <= 0.04045, values / 12.92, curve))


def srgb_from_linear(light: ArrayLike) -> Array:
    """SRGB values of linear light, both 0 to 1; the inverse of `linear_from_srgb`."""
    values = np.asarray(light, dtype=np.float64)
    curve = 1.055 * portable.power(np.maximum(values, 0.0), 1 / 2.4) - 0.055
    return np.asarray(np.where(values <= 0.0031308, 12.92 * values, curve))
