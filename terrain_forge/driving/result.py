"""How a drive went: the track, the wheels, the rocks that were met, the energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, rpy_from_quaternion

MOVING = 0.02
"""A wheel's slip counts where its rim or its centre moves at least this fast [m/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RockContact(Record):
    """A rock that the rover touched."""

    rock: str
    """Its name, `rock_<id>`."""
    time: float
    """When it was first touched [s]."""
    position: tuple[float, float]
    """Where base_link was then, east and north [m]."""
    force: float
    """Largest normal force at one contact with it [N]."""
    duration: float
    """How long it was touched, to a tick of the controller [s]."""
    by_body: bool
    """Whether anything but wheels touched it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyBalance(Record):
    """Where the motors' work went."""

    driving: float
    """Work of the motors while they push [J]."""
    braking: float
    """Work taken up by the motors while they brake, negative [J]."""
    gained: float
    """Mechanical energy at the end minus that at the start [J]."""
    unexplained: float
    """Largest rise of mechanical energy above the motors' work, over any part of the drive [J]."""

    @property
    def dissipated(self) -> float:
        """Lost to friction, dampers and impacts [J]."""
        return self.driving + self.braking - self.gained


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveResult(Record):
    """How a drive went. `poses` are the looks that are kept, ten a second and the last."""

    path: str
    """Name of the path."""
    completed: bool
    """Whether the rover came to the end of the path."""
    reason: str
    """How the drive ended, in words."""
    planned_time: float
    """Duration of the path itself [s]."""
    planned_distance: float
    """Length of the path in the plane [m]."""
    progress: float
    """How far along the path the rover came [m]."""
    distance: float
    """Length of the driven track [m]."""
    time: Array
    """Times of the poses from the start [s], shape [poses]."""
    position: Array
    """Origin of base_link in the world frame [m], shape [poses, 3]."""
    quaternion: Array
    """Rotation (w, x, y, z) of base_link, shape [poses, 4]."""
    cross_track: Array
    """Offset to the left of the path [m], shape [poses]."""
    heading_error: Array
    """Heading minus the path's [rad], shape [poses]."""
    tilt: Array
    """Angle of base_link's z axis to the vertical [rad], shape [poses]."""
    largest_cross_track: float
    """Largest distance from the path, of all looks [m]."""
    largest_tilt: float
    """Largest tilt, of all looks [rad]."""
    wheels: tuple[str, ...]
    """Names of the wheels, in the order of the columns below."""
    wheel_rate: Array
    """Rates of the wheels about their axles, positive forwards [rad/s], shape [poses, wheels]."""
    wheel_torque: Array
    """Torques of the motors, positive forwards [N m], shape [poses, wheels]."""
    wheel_slip: Array
    """Longitudinal slip: (ωr - v) over the larger of |ωr| and |v|, -1 (locked) to 1 (spins in
    place), 0 where both are below 0.02 m/s; v is along the ground in the wheel's plane, shape
    [poses, wheels]."""
    wheel_moves: NDArray[np.bool_]
    """Whether a wheel moves fast enough to have a slip, shape [poses, wheels]."""
    joints: tuple[str, ...]
    """Names of the passive joints, such as rockers, in the order of the columns below."""
    joint_angle: Array
    """Angles of the passive joints [rad], shape [poses, joints]."""
    clearance: Array
    """Free height beneath the belly's lowest-lying point over ground and rocks [m], shape [poses];
    empty if it was not measured."""
    saturated: float
    """Part of the time in which a motor was at its torque limit."""
    skid_gain: float
    """Commanded over real turn rate, as the controller knew it at the end."""
    energy: EnergyBalance
    """The motors' work and what became of it."""
    rock_contacts: tuple[RockContact, ...]
    """Rocks that were touched, in the order of first touch."""

    def __post_init__(self) -> None:
        self.freeze("time", np.float64, ("poses",))
        count = len(self.time)
        self.freeze("position", np.float64, (count, 3))
        self.freeze("quaternion", np.float64, (count, 4))
        for name in ("cross_track", "heading_error", "tilt"):
            self.freeze(name, np.float64, (count,))
        for name in ("wheel_rate", "wheel_torque", "wheel_slip"):
            self.freeze(name, np.float64, (count, len(self.wheels)))
        self.freeze("wheel_moves", np.bool_, (count, len(self.wheels)))
        self.freeze("joint_angle", np.float64, (count, len(self.joints)))
        self.freeze("clearance", np.float64, (count if np.size(self.clearance) else 0,))

    @property
    def duration(self) -> float:
        """Simulated time from start to end [s]."""
        return float(self.time[-1])

    @property
    def rpy(self) -> Array:
        """Roll, pitch, yaw [rad], wrapped, shape [poses, 3]."""
        return rpy_from_quaternion(self.quaternion)

    @property
    def rocks(self) -> tuple[str, ...]:
        """Names of the rocks that were touched, in the order of first touch."""
        return tuple(contact.rock for contact in self.rock_contacts)

    @property
    def slips(self) -> Array:
        """Sizes of the slips of all wheels while they move, shape [slips]."""
        return np.abs(self.wheel_slip[self.wheel_moves])

    @property
    def mean_slip(self) -> float:
        """Mean size of the slip over all wheels and poses; 0 where no wheel moved."""
        return float(self.slips.mean()) if self.slips.size else 0.0


def longitudinal_slip(rim: Array, speed: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Slip of wheels and whether they move fast enough to have one, from rims and centres [m/s].

    (ωr - v) over the larger of |ωr| and |v|, positive where the rim is faster than the ground
    (Ishigami et al. 2007, doi:10.1002/rob.20187).
    """
    faster = np.maximum(np.abs(rim), np.abs(speed))
    moves = faster >= MOVING
    return np.clip(np.where(moves, (rim - speed) / np.where(moves, faster, 1.0), 0.0), -1, 1), moves
