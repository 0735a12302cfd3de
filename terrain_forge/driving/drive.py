"""The validation drive: a rover follows a path through the exported scene, in MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.driving.controller import PlanarPath, PurePursuit, wheel_rates
from terrain_forge.errors import SimulationError
from terrain_forge.frames import quaternion_from_rpy, rpy_from_quaternion
from terrain_forge.motion import Trajectory
from terrain_forge.records import Record
from terrain_forge.rovers.description import Rover
from terrain_forge.validation.spec import DriveSpec

Array = NDArray[np.float64]

CONTROL_RATE = 50.0
"""Commands, and looks at the state, per second [Hz]; as near as whole time steps come."""
LOG_RATE = 10.0
"""Poses kept per second [Hz]."""
ARRIVAL = 0.05
_STUCK_TIME, _STUCK_PART, _STUCK_ANGLE = 10.0, 0.1, math.radians(5.0)
_TIPPED = math.radians(70.0)
_OFF_PATH_FACTOR = 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveResult(Record):
    """How a drive went."""

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
    rocks: tuple[str, ...]
    """Rocks that were touched, in the order of first touch."""
    largest_rock_force: float
    """Largest normal force at a contact with a rock, of all looks [N]."""

    def __post_init__(self) -> None:
        self.freeze("time", np.float64, ("poses",))
        count = len(self.time)
        self.freeze("position", np.float64, (count, 3))
        self.freeze("quaternion", np.float64, (count, 4))
        for name in ("cross_track", "heading_error", "tilt"):
            self.freeze(name, np.float64, (count,))

    @property
    def duration(self) -> float:
        """Simulated time from start to end [s]."""
        return float(self.time[-1])

    @property
    def rpy(self) -> Array:
        """Roll, pitch, yaw [rad], wrapped, shape [poses, 3]."""
        return rpy_from_quaternion(self.quaternion)


def load_scene(path: Path) -> Any:
    """The MuJoCo model of an exported scene.

    Raises:
        SimulationError: if MuJoCo cannot load it.
    """
    import mujoco

    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise SimulationError(f"{path}: MuJoCo cannot load it: {error}") from None


def drive(
    *,
    scene: Path | Any,
    trajectory: Trajectory,
    rover: Rover,
    spec: DriveSpec,
    progress: Callable[[float], None] | None = None,
) -> DriveResult:
    """Set the rover on the start of a path and follow it to its end, or until a watchdog stops it.

    Args:
        scene: The exported scene.xml, or what `load_scene` made of it.
        trajectory: The path.
        rover: The rover in the scene.
        spec: Limits; the drive goes on beyond them as long as it makes sense.
        progress: Told the share of the path that is done, 0 to 1, now and then.

    Raises:
        SimulationError: if the scene cannot be loaded, lacks the rover, or its start is not free.
    """
    from terrain_forge.driving.vehicle import Vehicle

    model = load_scene(scene) if isinstance(scene, Path) else scene
    vehicle = Vehicle(model, rover)
    vehicle.set_down(trajectory.position[0], quaternion_from_rpy(trajectory.rpy[0]))
    pursuit = PurePursuit(PlanarPath.of(trajectory))
    steps = max(round(1.0 / CONTROL_RATE / model.opt.timestep), 1)
    log = _Log(trajectory=trajectory, spec=spec, tick=steps * model.opt.timestep)
    while not log.reason:
        command = pursuit.command(vehicle.position[:2], _yaw(vehicle.rotation))
        log.look(vehicle, pursuit)
        if progress and len(log.looks) % 250 == 0:
            progress(pursuit.progress / pursuit.path.length)
        vehicle.step(wheel_rates(rover, *command), steps)
    return log.result(pursuit)


def _yaw(rotation: Array) -> float:
    return math.atan2(rotation[1, 0], rotation[0, 0])


@dataclass(kw_only=True)
class _Log:
    """What is seen during a drive, and the watchdog over it."""

    trajectory: Trajectory
    spec: DriveSpec
    tick: float
    looks: list[tuple[float, ...]] = field(default_factory=list)
    rocks: dict[str, float] = field(default_factory=dict)
    reason: str = ""
    completed: bool = False

    def look(self, vehicle: Any, pursuit: PurePursuit) -> None:
        """Note the rover's state and decide whether the drive is over."""
        fault = vehicle.fault()
        if fault:
            self.reason = fault
            if self.looks:
                return
            raise SimulationError(f"the drive of {self.trajectory.name!r} cannot start: {fault}")
        tilt = math.acos(min(max(vehicle.rotation[2, 2], -1.0), 1.0))
        self.looks.append(
            (
                len(self.looks) * self.tick,
                *vehicle.position,
                *vehicle.quaternion,
                pursuit.offset,
                pursuit.heading_error,
                tilt,
                pursuit.progress,
            )
        )
        for name, force in vehicle.rock_forces().items():
            self.rocks[name] = max(self.rocks.get(name, 0.0), force)
        self.completed = pursuit.progress >= pursuit.path.length - ARRIVAL
        self.reason = "arrived" if self.completed else self._trouble(pursuit, tilt)

    def _trouble(self, pursuit: PurePursuit, tilt: float) -> str:
        """Why the drive must end before its time; empty if it need not."""
        time = self.looks[-1][0]
        duration = float(self.trajectory.time[-1] - self.trajectory.time[0])
        where = f"after {pursuit.progress:.1f} m of {pursuit.path.length:.1f} m"
        if tilt > _TIPPED:
            return f"tipped over {where}"
        if abs(pursuit.offset) > _OFF_PATH_FACTOR * self.spec.cross_track_m:
            return f"left the path by {abs(pursuit.offset):.3g} m {where}"
        if self._is_stuck(pursuit.path.speed):
            return f"stuck {where}"
        if time > self.spec.time_factor * duration + _STUCK_TIME:
            return f"out of time {where}"
        return ""

    def _is_stuck(self, speed: float) -> bool:
        """Whether ten seconds brought the rover neither on, as its speed would, nor round."""
        window = round(_STUCK_TIME / self.tick)
        if len(self.looks) <= window:
            return False
        then, now = self.looks[-1 - window], self.looks[-1]
        turned = abs(now[9] - then[9]) > _STUCK_ANGLE
        return now[11] - then[11] < _STUCK_PART * speed * _STUCK_TIME and not turned

    def result(self, pursuit: PurePursuit) -> DriveResult:
        """The drive as it went, thinned to the logging rate (its end kept)."""
        looks = np.array(self.looks)
        every = max(round(1.0 / LOG_RATE / self.tick), 1)
        kept = looks[np.unique(np.r_[np.arange(0, len(looks), every), len(looks) - 1])]
        path = pursuit.path
        return DriveResult(
            path=self.trajectory.name,
            completed=self.completed,
            reason=self.reason,
            planned_time=path.length / path.speed,
            planned_distance=path.length,
            progress=min(pursuit.progress, path.length),
            distance=float(np.linalg.norm(np.diff(kept[:, 1:4], axis=0), axis=1).sum()),
            time=kept[:, 0],
            position=kept[:, 1:4],
            quaternion=kept[:, 4:8],
            cross_track=kept[:, 8],
            heading_error=kept[:, 9],
            tilt=kept[:, 10],
            largest_cross_track=float(np.abs(looks[:, 8]).max()),
            largest_tilt=float(looks[:, 10].max()),
            rocks=tuple(self.rocks),
            largest_rock_force=max(self.rocks.values(), default=0.0),
        )
