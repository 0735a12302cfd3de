"""A rover at one moment of a drive, and what its wheels did at many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.driving.result import longitudinal_slip

_UPWARD = np.array([0.0, 0.0, 1e-9])
"""What pushes a wheel that touches nothing [N]: such a one is told as on level ground."""


class Snapshot(NamedTuple):
    """What MuJoCo knows of a rover at one moment, in the world frame."""

    position: Array
    """Origin of base_link [m], shape [3]."""
    quaternion: Array
    """Rotation (w, x, y, z) of base_link, shape [4]."""
    centre: Array
    """The rover's centre of mass, about which velocities are told [m], shape [3]."""
    moving: Array
    """Turn rates [rad/s] and velocities there [m/s] of the wheels, shape [wheels, 6]."""
    wheel: Array
    """Places of the wheels [m], shape [wheels, 3]."""
    push: Array
    """Sums of the normal forces at the wheels' contacts [N], shape [wheels, 3]."""
    axle: Array
    """Unit vectors along the axles, shape [wheels, 3]."""
    rate: Array
    """Rates of the axles [rad/s], shape [wheels]."""
    torque: Array
    """Torques of the motors about them [N m], shape [wheels]."""
    joint_angle: Array
    """Angles of the passive joints [rad], shape [joints]."""


def pushes(data: Any, wheel_of: NDArray[np.int64], count: int) -> Array:
    """Sums of the normal forces at the contacts of each of so many wheels [N], shape [wheels, 3].

    `wheel_of` is the number of the wheel of each of MuJoCo's geoms, -1 for the others.
    """
    contact, found = data.contact, np.zeros((count, 3))
    for side, sign in ((0, -1.0), (1, 1.0)):  # a normal points to the second geom
        wheel = wheel_of[contact.geom[:, side]]
        held = np.flatnonzero((wheel >= 0) & (contact.efc_address >= 0))
        forces = sign * data.efc_force[contact.efc_address[held]]
        np.add.at(found, wheel[held], forces[:, None] * contact.frame[held, :3])
    return found


def wheel_states(
    taken: Sequence[Snapshot], *, sides: Array, radii: Array
) -> dict[str, NDArray[Any]]:
    """What rover and wheels did at some moments, as `DriveResult` names it.

    Args:
    taken: The moments.
    sides: 1 for wheels whose axle points left, -1 for the others, shape [wheels].
    radii: Of the wheels [m], shape [wheels].
    """
    one = Snapshot(*(np.array(part) for part in zip(*taken, strict=True)))
    turning, moving = one.moving[..., :3], one.moving[..., 3:]
    moving = moving + _cross(turning, one.wheel - one.centre[:, None])
    left = one.axle * sides[:, None]
    push = one.push + _UPWARD
    push *= np.where(push[..., 2:] < 0.0, -1.0, 1.0)  # under a ledge a wheel rolls forward too
    forward = _cross(left, push)
    forward /= np.linalg.norm(forward, axis=-1, keepdims=True)
    rim = (turning * left).sum(axis=-1) * radii
    slip, moves = longitudinal_slip(rim, (moving * forward).sum(axis=-1))
    return {
        "position": one.position,
        "quaternion": one.quaternion,
        "wheel_rate": sides * one.rate,
        "wheel_torque": sides * one.torque,
        "wheel_slip": slip,
        "wheel_moves": moves,
        "joint_angle": one.joint_angle,
    }


def _cross(one: Array, other: Array) -> Array:
    """Cross products of rows; NumPy's own takes five times as long for a few."""
    (a, b, c), (x, y, z) = (np.moveaxis(rows, -1, 0) for rows in (one, other))
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)
