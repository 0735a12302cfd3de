"""What is seen during a drive, and the watchdog that ends it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, SimulationError
from terrain_forge.driving.controller import PurePursuit
from terrain_forge.driving.result import DriveResult, RockContact
from terrain_forge.model import Trajectory
from terrain_forge.recipe import DriveSpec

if TYPE_CHECKING:
    from terrain_forge.driving.vehicle import Vehicle


LOG_RATE = 10.0
"""Poses kept per second [Hz]."""
ARRIVAL = 0.05
"""How near the end of the path the rover has arrived [m]."""
_STUCK_TIME, _STUCK_PART, _STUCK_ANGLE = 10.0, 0.1, math.radians(5.0)
_TIPPED = math.radians(70.0)
_OFF_PATH_FACTOR = 3.0
_STRAINED = 0.5
"""Torque limits explain why a rover is stuck where they were reached in half of the last looks."""


@dataclass(frozen=True, kw_only=True)
class Look:
    """The rover at one look; see `DriveResult` for units."""

    time: float
    position: Array
    quaternion: Array
    cross_track: float
    heading_error: float
    tilt: float
    progress: float
    saturated: int
    wheel_rate: Array
    wheel_torque: Array
    wheel_slip: Array
    wheel_moves: NDArray[np.bool_]
    joint_angle: Array


@dataclass(kw_only=True)
class Watch:
    """Follows a drive look by look."""

    trajectory: Trajectory
    spec: DriveSpec
    tick: float
    """Time between looks [s]."""
    looks: list[Look] = field(default_factory=list)
    contacts: dict[str, RockContact] = field(default_factory=dict)
    reason: str = ""
    """Why the drive is over; empty as long as it is not."""
    completed: bool = False

    def look(self, vehicle: Vehicle, pursuit: PurePursuit) -> None:
        """Note the rover's state and decide whether the drive is over.

        Raises:
            SimulationError: if the simulation means nothing from its first step on.
        """
        fault = vehicle.fault()
        if fault:
            self.reason = f"{fault}, after {pursuit.progress:.1f} m"
            if self.looks:
                return
            raise SimulationError(f"the drive of {self.trajectory.name!r} cannot start: {fault}")
        look = Look(
            time=len(self.looks) * self.tick,
            position=vehicle.position,
            quaternion=vehicle.quaternion,
            cross_track=pursuit.offset,
            heading_error=pursuit.heading_error,
            tilt=math.acos(min(max(vehicle.rotation[2, 2], -1.0), 1.0)),
            progress=pursuit.progress,
            saturated=vehicle.saturated_steps,
            **vehicle.wheel_states(),
            joint_angle=vehicle.joint_angles,
        )
        self.looks.append(look)
        east, north = look.position[:2].tolist()
        for name, (force, by_body) in vehicle.rock_forces().items():
            first = self.contacts.get(name) or RockContact(
                rock=name, time=look.time, position=(east, north), force=0.0, duration=0.0,
                by_body=False,
            )  # fmt: skip
            self.contacts[name] = first.replace(
                force=max(first.force, force),
                duration=first.duration + self.tick,
                by_body=first.by_body or by_body,
            )
        self.completed = pursuit.progress >= pursuit.path.length - ARRIVAL
        self.reason = "arrived" if self.completed else self._trouble(pursuit)

    def _trouble(self, pursuit: PurePursuit) -> str:
        """Why the drive must end before its time; empty if it need not."""
        now = self.looks[-1]
        duration = float(self.trajectory.time[-1] - self.trajectory.time[0])
        where = f"after {pursuit.progress:.1f} m of {pursuit.path.length:.1f} m"
        if now.tilt > _TIPPED:
            return f"tipped over {where}"
        if abs(pursuit.offset) > _OFF_PATH_FACTOR * self.spec.cross_track_m:
            return f"left the path by {abs(pursuit.offset):.3g} m {where}{self._causes()}"
        window = round(_STUCK_TIME / self.tick)
        if len(self.looks) > window:  # which must bring it on, as its speed would, or round
            then, wanted = self.looks[-1 - window], pursuit.path.speed * _STUCK_TIME
            turned = abs(now.heading_error - then.heading_error) > _STUCK_ANGLE
            if now.progress - then.progress < _STUCK_PART * wanted and not turned:
                return f"stuck {where}{self._causes()}"
        if now.time > self.spec.time_factor * duration + _STUCK_TIME:
            return f"out of time {where}"
        return ""

    def _causes(self) -> str:
        """What held the rover in the last ten seconds, as far as it can be told."""
        window = min(round(_STUCK_TIME / self.tick), len(self.looks) - 1)
        begin = self.looks[-1 - window]
        reasons = []
        if self.looks[-1].saturated - begin.saturated > _STRAINED * window:
            reasons.append("motors at their torque limit")
        # The median passes over the last metre before the obstacle, which is in the window too.
        slip = np.median([look.wheel_slip.mean() for look in self.looks[-window:]])
        if slip > _STRAINED:
            reasons.append(f"wheels slip by {slip:.0%}")
        touched = [c for c in self.contacts.values() if c.time + c.duration > begin.time]
        if held := [contact.rock for contact in touched if contact.by_body]:
            reasons.append(f"its body against {', '.join(held[:3])}")
        return f": {', '.join(reasons)}" if reasons else ""

    def result(self, vehicle: Vehicle, pursuit: PurePursuit, *, skid_gain: float) -> DriveResult:
        """The drive as it went, thinned to the logging rate (its end kept)."""
        every = max(round(1.0 / LOG_RATE / self.tick), 1)
        count = len(self.looks)
        kept = [self.looks[n] for n in np.unique(np.r_[np.arange(0, count, every), count - 1])]
        path, columns = pursuit.path, vars(kept[0]).keys() - {"progress", "saturated"}
        poses = {name: np.array([getattr(look, name) for look in kept]) for name in columns}
        return DriveResult(
            **poses,
            path=self.trajectory.name,
            completed=self.completed,
            reason=self.reason,
            planned_time=float(self.trajectory.time[-1] - self.trajectory.time[0]),
            planned_distance=path.length,
            progress=min(pursuit.progress, path.length),
            distance=float(np.linalg.norm(np.diff(poses["position"], axis=0), axis=1).sum()),
            largest_cross_track=max(abs(look.cross_track) for look in self.looks),
            largest_tilt=max(look.tilt for look in self.looks),
            wheels=tuple(wheel.link for wheel in vehicle.rover.wheels),
            joints=vehicle.joints,
            clearance=np.empty(0),
            saturated=vehicle.saturated_steps / max(vehicle.steps, 1),
            skid_gain=skid_gain,
            energy=vehicle.audit.balance(),
            rock_contacts=tuple(self.contacts.values()),
        )
