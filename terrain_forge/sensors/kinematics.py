"""Rates of turned frames, and the motion of what is fixed to a moving one."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, kernel


def turning(rpy: Array, first: Array, second: Array) -> tuple[Array, Array, Array]:
    """Rotation, angular rate in the turned frame and its derivative, of R = Rz(ψ) Ry(θ) Rx(φ).

    Args:
        rpy: Roll, pitch, yaw [rad], shape [times, 3].
        first: Their derivatives [rad/s], shape [times, 3].
        second: Their second derivatives [rad/s²], shape [times, 3].
    """
    count = len(rpy)
    rotation, rate, change = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 3))
    columns = (np.ascontiguousarray(told) for told in (rpy, first, second))
    _turn(*columns, rotation, rate, change)
    return rotation, rate, change


def mounted(
    position: Array, rotation: Array, velocity: Array, acceleration: Array, rate: Array,
    change: Array, arm: Array, turn: Array,
) -> tuple[Array, ...]:  # fmt: skip
    """A state's six parts, of a frame that is fixed to that of a state at `arm`, turned by `turn`.

    Velocity grows by ω × r, acceleration by ω' × r + ω × (ω × r).
    """
    state = (position, rotation, velocity, acceleration, rate, change)
    found = tuple(np.empty(part.shape) for part in state)
    _carry(*map(np.ascontiguousarray, (*state, arm, turn)), *found)
    return found


@kernel
def _turn(rpy, first, second, rotation, rate, change):  # type: ignore[no-untyped-def]
    for n in range(len(rpy)):
        sr, cr = np.sin(rpy[n, 0]), np.cos(rpy[n, 0])
        sp, cp = np.sin(rpy[n, 1]), np.cos(rpy[n, 1])
        sy, cy = np.sin(rpy[n, 2]), np.cos(rpy[n, 2])
        turn = rotation[n]
        turn[0, 0], turn[0, 1], turn[0, 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
        turn[1, 0], turn[1, 1], turn[1, 2] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
        turn[2, 0], turn[2, 1], turn[2, 2] = -sp, cp * sr, cp * cr
        roll, pitch, yaw = first[n, 0], first[n, 1], first[n, 2]
        roll_2, pitch_2, yaw_2 = second[n, 0], second[n, 1], second[n, 2]
        rate[n, 0] = roll - yaw * sp
        rate[n, 1] = pitch * cr + yaw * sr * cp
        rate[n, 2] = yaw * cr * cp - pitch * sr
        change[n, 0] = roll_2 - yaw_2 * sp - yaw * pitch * cp
        change[n, 1] = (
            pitch_2 * cr - pitch * roll * sr
            + yaw_2 * sr * cp + yaw * (roll * cr * cp - pitch * sr * sp)
        )  # fmt: skip
        change[n, 2] = (
            yaw_2 * cr * cp - yaw * (roll * sr * cp + pitch * cr * sp)
            - pitch_2 * sr - pitch * roll * cr
        )  # fmt: skip


@kernel
def _carry(  # type: ignore[no-untyped-def]
    position, rotation, velocity, acceleration, rate, change, arm, turn,
    to_position, to_rotation, to_velocity, to_acceleration, to_rate, to_change,
):  # fmt: skip
    x, y, z = arm[0], arm[1], arm[2]
    for n in range(len(position)):
        a, b, c = rate[n, 0], rate[n, 1], rate[n, 2]
        u, v, w = change[n, 0], change[n, 1], change[n, 2]
        i, j, k = b * z - c * y, c * x - a * z, a * y - b * x
        p = v * z - w * y + (b * k - c * j)
        q = w * x - u * z + (c * i - a * k)
        r = u * y - v * x + (a * j - b * i)
        for row in range(3):
            d, e, f = rotation[n, row, 0], rotation[n, row, 1], rotation[n, row, 2]
            to_position[n, row] = position[n, row] + (d * x + e * y + f * z)
            to_velocity[n, row] = velocity[n, row] + (d * i + e * j + f * k)
            to_acceleration[n, row] = acceleration[n, row] + (d * p + e * q + f * r)
            for column in range(3):
                d, e, f = turn[0, column], turn[1, column], turn[2, column]
                to_rotation[n, row, column] = (
                    rotation[n, row, 0] * d + rotation[n, row, 1] * e + rotation[n, row, 2] * f
                )
        for column in range(3):
            d, e, f = turn[0, column], turn[1, column], turn[2, column]
            to_rate[n, column] = a * d + b * e + c * f
            to_change[n, column] = u * d + v * e + w * f
