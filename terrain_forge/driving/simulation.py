"""The validation drive: a rover follows a path through the exported scene, under a watchdog."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from terrain_forge.base import SimulationError, load_model, quaternion_from_rpy, silent_mujoco
from terrain_forge.driving.controller import (
    PlanarPath,
    PurePursuit,
    SkidGain,
    eased,
    lookahead_of,
    wheel_rates,
    wheels_turn_rate,
)
from terrain_forge.driving.result import DriveResult, RockContact
from terrain_forge.model import Rover, Trajectory
from terrain_forge.recipe import DriveSpec

if TYPE_CHECKING:
    from terrain_forge.driving.log import Logger
    from terrain_forge.driving.snapshot import Snapshot
    from terrain_forge.driving.vehicle import Vehicle


LOG_RATE = 10.0
"""Poses kept per second [Hz]."""
ARRIVAL = 0.05
"""How much of the path may be left where the rover has arrived [m]."""
_STUCK_TIME, _STUCK_PART, _STUCK_ANGLE = 10.0, 0.1, math.radians(5.0)
_TIPPED = math.radians(70.0)
_OFF_PATH_FACTOR = 3.0
_STRAINED = 0.5
"""Torque limits explain why a rover is stuck where they were reached in half of the last looks."""
CONTROL_RATE = 50.0
"""Commands, and looks at the state, per second [Hz]; as near as whole time steps come."""


def load_scene(path: Path) -> Any:
    """The MuJoCo model of an exported scene.

    Raises:
        SimulationError: if MuJoCo cannot load it.
    """
    try:
        return load_model(path)
    except ValueError as error:
        raise SimulationError(f"{path}: MuJoCo cannot load it: {error}") from None


@silent_mujoco()
def drive(
    *,
    scene: Path | Any,
    trajectory: Trajectory,
    rover: Rover,
    spec: DriveSpec,
    progress: Callable[[float], None] | None = None,
    logger: Logger | None = None,
    onward: Callable[[float], Any | None] | None = None,
) -> DriveResult:
    """Set the rover on the start of a path and follow it to its end, or until a watchdog stops it.

    Args:
        scene: The exported scene.xml, or what `load_scene` made of it.
        trajectory: The path.
        rover: The rover in the scene.
        spec: Limits; the drive goes on beyond them as long as it makes sense.
        progress: Told the share of the path that is done, 0 to 1, now and then.
        logger: Keeps the motion at hundreds of looks a second.
        onward: Asked at each look, by how far along the path the rover is [m], for the model of
            another scene in which it goes on; None as long as it stays where it is.

    Raises:
        SimulationError: if the scene cannot be loaded, lacks the rover, or its start is not free.
    """
    from terrain_forge.driving.vehicle import Vehicle

    model = load_scene(scene) if isinstance(scene, Path) else scene
    vehicle = Vehicle(model, rover)
    vehicle.set_down(trajectory.position[0], quaternion_from_rpy(trajectory.rpy[0]))
    if logger is not None:
        vehicle.logger = logger
        logger.begin(vehicle)
    pursuit = PurePursuit(PlanarPath.of(trajectory), lookahead=lookahead_of(rover))
    skid = SkidGain()
    steps = max(round(1.0 / CONTROL_RATE / model.opt.timestep), 1)
    watch = Watch(trajectory=trajectory, spec=spec, tick=steps * model.opt.timestep)
    rates = np.zeros(len(rover.wheels))
    while not watch.reason:
        yaw, tilt = vehicle.attitude
        speed, turn_rate = pursuit.command(vehicle.place, yaw)
        watch.look(vehicle, pursuit, tilt)
        if onward is not None and (following := onward(pursuit.progress)) is not None:
            vehicle = vehicle.moved_to(following)
        if progress and len(watch.ticks) % 250 == 0:
            progress(pursuit.progress / pursuit.path.length)
        wanted = wheel_rates(rover, speed, turn_rate, gain=skid.value)
        rates = eased(rover, wanted, rates, time=watch.tick)
        vehicle.step(rates, steps)
        turned = wheels_turn_rate(rover, vehicle.wheel_rates)
        skid.note(wheels=turned, rover=vehicle.turn_rate, time=watch.tick)
    return watch.result(vehicle, pursuit, skid_gain=skid.value)


class Tick(NamedTuple):
    """How far the rover is at a look, and what the watchdog compares with earlier ones."""

    progress: float
    """Along the path [m]."""
    cross_track: float
    """[m]."""
    heading_error: float
    """[rad]."""
    tilt: float
    """[rad]."""
    saturated: int
    """Looks until now at which a motor was at its torque limit."""


@dataclass(kw_only=True)
class Watch:
    """Follows a drive look by look."""

    trajectory: Trajectory
    spec: DriveSpec
    tick: float
    """Time between looks [s]."""
    ticks: list[Tick] = field(default_factory=list)
    """All looks."""
    looks: list[tuple[int, Snapshot]] = field(default_factory=list)
    """The rover at those at the logging rate, and at the last one, by their numbers."""
    contacts: dict[str, RockContact] = field(default_factory=dict)
    touched: dict[str, float] = field(default_factory=dict)
    """When each of those rocks was last touched [s]."""
    scraped: dict[str, float] = field(default_factory=dict)
    """The same of those that more than wheels touched, by that."""
    reason: str = ""
    """Why the drive is over; empty as long as it is not."""
    completed: bool = False

    def __post_init__(self) -> None:
        self._duration = float(self.trajectory.time[-1] - self.trajectory.time[0])
        self._kept = max(round(1.0 / LOG_RATE / self.tick), 1)

    def look(self, vehicle: Vehicle, pursuit: PurePursuit, tilt: float) -> None:
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
        now = Tick(
            progress=pursuit.progress,
            cross_track=pursuit.offset,
            heading_error=pursuit.heading_error,
            tilt=tilt,
            saturated=vehicle.saturated_steps,
        )
        number = len(self.ticks)
        self.ticks.append(now)
        self._note_rocks(vehicle)
        self.completed = pursuit.progress >= pursuit.path.length - ARRIVAL
        trouble = self._trouble(pursuit)
        if number % self._kept == 0 or self.completed or trouble:
            self.looks.append((number, vehicle.snapshot()))
        if self.completed:
            self.reason = "arrived"
        elif trouble:
            where = f"after {pursuit.progress:.1f} m of {pursuit.path.length:.1f} m"
            self.reason = trouble.format(where=where, causes=self._causes(vehicle))

    @property
    def time(self) -> float:
        """Time of the last look [s]."""
        return (len(self.ticks) - 1) * self.tick

    def _note_rocks(self, vehicle: Vehicle) -> None:
        """Note the rocks that the rover touches."""
        for name, (force, by_body) in vehicle.rock_forces().items():
            first = self.contacts.get(name) or RockContact(
                rock=name, time=self.time, position=vehicle.place, force=0.0, duration=0.0,
                by_body=False,
            )  # fmt: skip
            self.contacts[name] = first.replace(
                force=max(first.force, force),
                duration=first.duration + self.tick,
                by_body=first.by_body or by_body,
            )
            self.touched[name] = self.time
            if by_body:
                self.scraped[name] = self.time

    def _trouble(self, pursuit: PurePursuit) -> str:
        """Why the drive must end before its time, without the place; empty if it need not."""
        now = self.ticks[-1]
        if now.tilt > _TIPPED:
            return "tipped over {where}"
        if abs(pursuit.offset) > _OFF_PATH_FACTOR * self.spec.cross_track_m:
            return f"left the path by {abs(pursuit.offset):.3g} m {{where}}{{causes}}"
        window = round(_STUCK_TIME / self.tick)
        if len(self.ticks) > window:  # which must bring it on, as its speed would, or round
            then, wanted = self.ticks[-1 - window], pursuit.path.speed * _STUCK_TIME
            turned = abs(now.heading_error - then.heading_error) > _STUCK_ANGLE
            if now.progress - then.progress < _STUCK_PART * wanted and not turned:
                return "stuck {where}{causes}"
        if self.time > self.spec.time_factor * self._duration + _STUCK_TIME:
            return "out of time {where}"
        return ""

    def _causes(self, vehicle: Vehicle) -> str:
        """What held the rover in the last ten seconds, as far as it can be told."""
        window = min(round(_STUCK_TIME / self.tick), len(self.ticks) - 1)
        strained = (self.ticks[-1].saturated - self.ticks[-1 - window].saturated) / max(window, 1)
        begin = self.time - window * self.tick
        reasons = []
        if strained > _STRAINED:
            reasons.append("motors at their torque limit")
        # The median passes over the last metre before the obstacle, which is in the window too.
        late = [taken for number, taken in self.looks if number * self.tick >= begin]
        slip = np.median(vehicle.states(late)["wheel_slip"].mean(axis=1))
        if slip > _STRAINED:
            reasons.append(f"wheels slip by {slip:.0%}")
        if held := [rock for rock, last in self.scraped.items() if last > begin]:
            reasons.append(f"its body against {', '.join(held[:3])}")
        elif met := [rock for rock, last in self.touched.items() if last > begin]:
            reasons.append(f"its wheels against {', '.join(met[:3])}")
        if not reasons:
            tilt = math.degrees(self.ticks[-1].tilt)
            reasons.append(
                f"no rock touched, tilt {tilt:.0f}°, wheels slip by {slip:.0%}, motors at their "
                f"torque limit {strained:.0%} of the time"
            )
        if vehicle.rover.steering:
            reasons.append(f"joints that steer are held ({', '.join(vehicle.rover.steering)})")
        return f": {', '.join(reasons)}"

    def result(self, vehicle: Vehicle, pursuit: PurePursuit, *, skid_gain: float) -> DriveResult:
        """The drive as it went, at the logging rate (its end kept)."""
        path, numbers = pursuit.path, [number for number, _ in self.looks]
        ticks = [self.ticks[number] for number in numbers]
        poses = vehicle.states([taken for _, taken in self.looks])
        return DriveResult(
            **poses,
            time=np.array(numbers) * self.tick,
            cross_track=np.array([tick.cross_track for tick in ticks]),
            heading_error=np.array([tick.heading_error for tick in ticks]),
            tilt=np.array([tick.tilt for tick in ticks]),
            path=self.trajectory.name,
            completed=self.completed,
            reason=self.reason,
            planned_time=self._duration,
            planned_distance=path.length,
            progress=min(pursuit.progress, path.length),
            distance=float(np.linalg.norm(np.diff(poses["position"], axis=0), axis=1).sum()),
            largest_cross_track=max(abs(tick.cross_track) for tick in self.ticks),
            largest_tilt=max(tick.tilt for tick in self.ticks),
            wheels=tuple(wheel.link for wheel in vehicle.rover.wheels),
            joints=vehicle.joints,
            clearance=np.empty(0),
            saturated=vehicle.saturated_steps / max(vehicle.steps, 1),
            skid_gain=skid_gain,
            energy=vehicle.audit.balance(),
            rock_contacts=tuple(self.contacts.values()),
        )
