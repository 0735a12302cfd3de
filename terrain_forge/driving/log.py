"""The rover at hundreds of looks a second of a drive, for instruments that measure its motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from terrain_forge.base import Array, Record, shaped

if TYPE_CHECKING:
    from terrain_forge.driving.vehicle import Vehicle

FASTEST = 500.0
"""Looks that are kept per second [Hz], or each time step of the physics where those are longer."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveLog(Record):
    """A drive look by look, from when the rover had settled."""

    step: float
    """Time between looks [s]."""
    position: Array = field(metadata=shaped("looks", 3))
    """Origin of base_link in the world frame [m], shape [looks, 3]."""
    quaternion: Array = field(metadata=shaped("looks", 4))
    """Rotation (w, x, y, z) of base_link, shape [looks, 4]."""
    joints: tuple[str, ...]
    """Names of the passive joints, in the order of the columns below."""
    joint_angle: Array = field(metadata=shaped("looks", "joints"))
    """Angles of the passive joints [rad], shape [looks, joints]."""
    wheel_angle: Array = field(metadata=shaped("looks", "wheels"))
    """Angles of the wheels, forwards positive, 0 at the start [rad], shape [looks, wheels]."""
    wheel_rate: Array = field(metadata=shaped("looks", "wheels"))
    """Rates of the wheels, forwards positive [rad/s], shape [looks, wheels]."""
    wheel_torque: Array = field(metadata=shaped("looks", "wheels"))
    """Torques of the motors in the step before a look, forwards positive [N m], shape [looks,
    wheels]."""


class Logger:
    """Keeps the state of a vehicle at its time steps; give it to `drive`."""

    def __init__(self) -> None:
        self._vehicle: Vehicle | None = None
        self._every = self._count = 0
        self._before = np.empty(0)
        self._kept: list[tuple[Array, Array, Array]] = []

    def begin(self, vehicle: Vehicle) -> None:
        """Begin with a vehicle that has settled."""
        self._vehicle, self._count, self._before = vehicle, 0, vehicle.settled
        self._every = max(round(1.0 / FASTEST / vehicle.model.opt.timestep), 1)
        self._kept.clear()

    def go_on(self, vehicle: Vehicle, told: Callable[[Array], Array]) -> None:
        """Go on with the vehicle in another scene, in which states are told otherwise."""
        self._vehicle, self._before = vehicle, told(self._before)

    def note(self, states: Array) -> None:
        """Note MuJoCo's states before some time steps, shape [steps, state]."""
        vehicle, kept = self._vehicle, slice(-self._count % self._every, None, self._every)
        assert vehicle is not None
        before = np.vstack([self._before, states[:-1]])
        places, rates, _ = vehicle.motion(states[kept])
        self._kept.append((places, rates, vehicle.motion(before[kept])[2]))
        self._count, self._before = self._count + len(states), states[-1].copy()

    def log(self) -> DriveLog:
        """What was noted."""
        vehicle = self._vehicle
        assert vehicle is not None
        self.note(vehicle.state[None])
        found, rates, torques = map(np.concatenate, zip(*self._kept, strict=True))
        wheels = len(vehicle.rover.wheels)
        angles = vehicle.sides * (found[:, 7 : 7 + wheels] - found[0, 7 : 7 + wheels])
        return DriveLog(
            step=self._every * vehicle.model.opt.timestep,
            position=found[:, :3],
            quaternion=found[:, 3:7],
            joints=vehicle.joints,
            joint_angle=found[:, 7 + wheels :],
            wheel_angle=angles,
            wheel_rate=vehicle.sides * rates,
            wheel_torque=vehicle.sides * torques,
        )
