"""The drives of a validation: carried out, judged, written."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Array, Record, SimulationError, matrix_from_quaternion, portable
from terrain_forge.driving.simulation import ARRIVAL, DriveResult, drive, load_scene
from terrain_forge.driving.starts import StartsResult, drive_from_many_starts
from terrain_forge.model import Check, Rover, World, at_least, at_most, failed
from terrain_forge.recipe import DriveSpec, StartsSpec
from terrain_forge.scene import open_scene

Progress = Callable[[float], None] | None

_BELLY = (7, 5)
_ABOVE = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven(Record):
    """What the drives of a validation gave."""

    checks: tuple[Check, ...]
    """What was checked."""
    drive: DriveResult | None = None
    """The drive along the path, where it could begin."""
    starts: StartsResult | None = None
    """The drives from many starts, where they were asked for."""
    timings: tuple[tuple[str, float], ...] = ()
    """Wall times [s] and simulated over wall time, for timings.json."""


def drive_path(world: World, scene: Path, spec: DriveSpec, progress: Progress) -> Driven:
    """Drive a path through the exported scene; what fails is a result, not an error.

    Args:
        world: the world.
        scene: its exported scene.xml.
        spec: the path and the limits.
        progress: told the share of the drive that is done, 0 to 1.
    """
    title = f"drive {spec.path}"
    trajectory = next((t for t in world.trajectories if t.name == spec.path), None)
    if trajectory is None:
        return Driven(checks=(failed(title, "the path does not lie within this world"),))
    try:
        model = load_scene(scene)
        begin = time.perf_counter()
        result = drive(
            scene=model, trajectory=trajectory, rover=world.rover, spec=spec, progress=progress
        )
    except SimulationError as error:
        return Driven(checks=(failed(title, str(error)),))
    wall = time.perf_counter() - begin
    result = measure_clearance(world, result)
    return Driven(
        checks=(rover_mass_check(world, model, scene.parent.name), *drive_checks(result, spec)),
        drive=result,
        timings=(("drive_wall_time_s", wall), ("drive_real_time_factor", result.duration / wall)),
    )


def drive_starts(world: World, scene: Path, spec: StartsSpec, progress: Progress) -> Driven:
    """Drive straight on from many starts; what fails is a result, not an error.

    Args:
        world: the world.
        scene: its exported scene.xml.
        spec: how many, how far.
        progress: told the share of the drives that are done, 0 to 1.
    """
    begin = time.perf_counter()
    try:
        result = drive_from_many_starts(world, scene, spec, progress=progress)
    except SimulationError as error:
        return Driven(checks=(failed("drives from many starts", str(error)),))
    wall = time.perf_counter() - begin
    simulated = sum(start.drive.duration for start in result.starts if start.drive)
    return Driven(
        checks=(
            at_least("drives: part that arrives", result.share, spec.arrive),
            at_most("drives: mean slip of the wheels", result.mean_slip, None),
        ),
        starts=result,
        timings=(("drives_wall_time_s", wall), ("drives_real_time_factor", simulated / wall)),
    )


def measure_clearance(world: World, result: DriveResult) -> DriveResult:
    """The result with the free height under the rover's belly over ground and rocks at each pose.

    The belly is the level rectangle between the wheels at the rover's own clearance. A height is
    negative where a rock or the ground reaches above it.
    """
    belly = belly_points(world.rover)
    rotation = matrix_from_quaternion(result.quaternion)
    points = result.position[:, None, :] + portable.product(belly, rotation.transpose(0, 2, 1))
    starts = points.reshape(-1, 3) + np.array([0.0, 0.0, _ABOVE])
    down = np.broadcast_to((0.0, 0.0, -1.0), starts.shape)
    with open_scene(world) as scene:
        distance = scene.cast(starts, down).distance.astype(np.float64)
    free = np.where(np.isfinite(distance), distance - _ABOVE, np.inf).reshape(points.shape[:2])
    lowest = free.min(axis=1)
    return result.replace(clearance=np.where(np.isfinite(lowest), lowest, world.rover.clearance))


def belly_points(rover: Rover) -> Array:
    """Points of the belly in base_link's frame [m], shape [points, 3]."""
    centres = rover.wheel_centres
    inner = np.abs(centres[:, 1]).max() - max(wheel.width for wheel in rover.wheels) / 2
    x = np.linspace(centres[:, 0].min(), centres[:, 0].max(), _BELLY[0])
    y = np.linspace(-inner, inner, _BELLY[1])
    east, north = np.meshgrid(x, y)
    return np.column_stack([east.ravel(), north.ravel(), np.full(east.size, rover.clearance)])


def rover_mass_check(world: World, model: Any, name: str) -> Check:
    """The difference of the masses in a scene [kg] to the rover's."""
    root = model.body(world.rover.links[0].name).id
    off = abs(float(model.body_subtreemass[root]) - world.rover.mass)
    return at_most(f"{name}: rover's mass", off, 1e-6, unit="kg", note="difference to the rover's")


def drive_checks(result: DriveResult, spec: DriveSpec) -> list[Check]:
    """A drive against its limits; figures without a limit are there to be read."""
    title = f"drive {result.path}"
    arrived = Check(
        name=f"{title}: progress",
        figure=result.progress,
        unit="m",
        limit=result.planned_distance - ARRIVAL,
        passed=result.completed,
        note=result.reason,
    )
    slowest = spec.time_factor * result.planned_time
    return [
        arrived,
        at_most(f"{title}: time", result.duration, slowest, unit="s"),
        at_most(f"{title}: largest cross-track error", result.largest_cross_track,
                spec.cross_track_m, unit="m"),
        at_most(f"{title}: largest tilt", math.degrees(result.largest_tilt),
                spec.tilt_deg, unit="deg"),
        *(
            at_most(f"{title}: {name}", figure, None, unit=unit)
            for name, (figure, unit) in drive_figures(result).items()
        ),
    ]  # fmt: skip


def drive_figures(result: DriveResult) -> dict[str, tuple[float, str]]:
    """What was measured and has no limit, by name: figure and unit."""
    cross_track, heading = np.abs(result.cross_track), np.degrees(np.abs(result.heading_error))
    roll, pitch = np.degrees(np.abs(result.rpy[:, :2])).max(axis=0).tolist()
    energy = result.energy
    figures = {
        "distance": (result.distance, "m"),
        "mean cross-track error": (float(cross_track.mean()), "m"),
        "95 % cross-track error": (float(np.quantile(cross_track, 0.95)), "m"),
        "95 % heading error": (float(np.quantile(heading, 0.95)), "deg"),
        "largest heading error": (float(heading.max()), "deg"),
        "largest roll": (roll, "deg"),
        "largest pitch": (pitch, "deg"),
        "mean slip of the wheels": (result.mean_slip, ""),
        "95 % slip of the wheels": (result.high_slip, ""),
        "largest motor torque": (float(np.abs(result.wheel_torque).max()), "N m"),
        "part of the time at a torque limit": (result.saturated, ""),
        "work of the motors": (energy.driving, "J"),
        "braking work of the motors": (energy.braking, "J"),
        "energy dissipated": (energy.dissipated, "J"),
        "energy that nothing explains": (energy.unexplained, "J"),
        "rocks touched": (float(len(result.rocks)), ""),
        "largest force at a rock": (result.largest_rock_force, "N"),
    }
    if result.joints:
        angle = float(np.degrees(np.abs(result.joint_angle)).max())
        figures["largest angle of a passive joint"] = (angle, "deg")
    if len(result.clearance):
        figures["least free height under the belly"] = (float(result.clearance.min()), "m")
    return figures


def drive_json(result: DriveResult) -> dict[str, Any]:
    """A drive for report.json."""
    return {
        "path": result.path,
        "completed": result.completed,
        "reason": result.reason,
        "time_s": result.duration,
        "planned_time_s": result.planned_time,
        "distance_m": result.distance,
        "planned_distance_m": result.planned_distance,
        "rocks_touched": list(result.rocks),
        "rock_contacts": [vars(contact) for contact in result.rock_contacts],
        "wheels": {
            name: {
                "mean_slip": float(np.abs(result.wheel_slip[:, n]).mean()),
                "largest_torque_n_m": float(np.abs(result.wheel_torque[:, n]).max()),
            }
            for n, name in enumerate(result.wheels)
        },
        "energy": {f"{name}_j": value for name, value in _energies(result).items()},
        "skid_gain": result.skid_gain,
    }


def _energies(result: DriveResult) -> dict[str, float]:
    return {**vars(result.energy), "dissipated": result.energy.dissipated}


def starts_json(result: StartsResult) -> dict[str, Any]:
    """The drives from many starts for report.json."""
    return {
        "count": len(result.starts),
        "length_m": result.length,
        "share_arrived": result.share,
        "mean_slip": result.mean_slip,
        "failures": [
            {"number": n, "reason": start.reason}
            for n, start in enumerate(result.starts)
            if not start.arrived
        ],
    }


def write_drives(world: World, folder: Path, driven: Driven, *, film: bool) -> list[Path]:
    """Write what belongs to the drives into a folder: tables, figures, pictures; returns them.

    Args:
        world: the world.
        folder: where to write.
        driven: the drives.
        film: whether to make an animated picture of the drive along the path.
    """
    files = list[Path]()
    if result := driven.drive:
        from terrain_forge.driving.files import stem, write_figure, write_tables
        from terrain_forge.driving.film import write_end, write_film

        name = stem(result)
        files += write_tables(result, folder)
        files.append(write_figure(world, result, folder / f"{name}.png"))
        if film:
            files.append(write_film(world, result, folder / f"{name}.webp"))
        if not result.completed:
            files.append(write_end(world, result, folder / f"{name}_end.png"))
    if starts := driven.starts:
        from terrain_forge.driving.files import write_starts_figure, write_starts_table

        files.append(write_starts_table(starts, folder / "drives.csv"))
        files.append(write_starts_figure(world, starts, folder / "drives.png"))
    return files
