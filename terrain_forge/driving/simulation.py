"""The validation drive: a rover follows a path through the exported scene, in MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import SimulationError, load_model, quaternion_from_rpy
from terrain_forge.driving.controller import (
    PurePursuit,
    SkidGain,
    eased,
    lookahead_of,
    wheel_rates,
    wheels_turn_rate,
)
from terrain_forge.driving.drive_log import Watch
from terrain_forge.driving.planar_path import PlanarPath
from terrain_forge.driving.result import DriveResult
from terrain_forge.model import Rover, Trajectory
from terrain_forge.recipe import DriveSpec

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
    pursuit = PurePursuit(PlanarPath.of(trajectory), lookahead=lookahead_of(rover))
    skid = SkidGain()
    steps = max(round(1.0 / CONTROL_RATE / model.opt.timestep), 1)
    watch = Watch(trajectory=trajectory, spec=spec, tick=steps * model.opt.timestep)
    rates = np.zeros(len(rover.wheels))
    while not watch.reason:
        turn = vehicle.rotation
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        speed, turn_rate = pursuit.command(vehicle.position[:2], yaw)
        watch.look(vehicle, pursuit)
        if progress and len(watch.looks) % 250 == 0:
            progress(pursuit.progress / pursuit.path.length)
        wanted = wheel_rates(rover, speed, turn_rate, gain=skid.value)
        rates = eased(rover, wanted, rates, time=watch.tick)
        vehicle.step(rates, steps)
        turned = wheels_turn_rate(rover, vehicle.wheel_rates)
        skid.note(wheels=turned, rover=vehicle.turn_rate, time=watch.tick)
    return watch.result(vehicle, pursuit, skid_gain=skid.value)
