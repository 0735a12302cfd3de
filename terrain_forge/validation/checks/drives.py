"""Whether a rover can drive the world, in MuJoCo: the drives carried out, judged and written."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Array, SimulationError, matrix_from_quaternion, portable
from terrain_forge.driving import (
    ARRIVAL,
    DriveResult,
    StartsResult,
    drive,
    drive_from_many_starts,
    load_scene,
)
from terrain_forge.model import Check, Rover, World, at_least, at_most, failed
from terrain_forge.recipe import DriveSpec, StartsSpec
from terrain_forge.scene import open_scene
from terrain_forge.validation.inspection import BuiltFolder, Inspection, content_of

_REPORTED = "drive", "drives"
"""Parts of the report."""
_TIMED = "wall_time_s", "real_time_factor"
_SCENE = "scene.xml"
_BELLY = (7, 5)
_ABOVE = 1.0
_TOLD = 3
"""Drives of which a check says why they did not arrive."""


class Drives(Inspection):
    """The drives that are asked for, one after the other, with their tables and pictures."""

    kind = "drives"
    group = "drive"

    def __init__(self) -> None:
        self.drive: DriveResult | None = None
        """The drive along the path, where it could begin."""
        self._starts: StartsResult | None = None
        self._kept: dict[str, Any] = {}
        self._timings: list[tuple[str, float]] = []

    def checks(self, built: BuiltFolder) -> Iterable[Check]:
        """What the drives must keep, and what was measured of them."""
        one, many = built.spec.drive_spec, built.spec.starts_spec
        if built.driven is not None:
            yield from self._keep(built, built.driven)
            return
        if one:
            try:
                yield from self._drive(built, one)
            except SimulationError as error:
                yield failed(f"drive {one.path}", str(error))
        if many:
            try:
                yield from self._start(built, many)
            except SimulationError as error:
                yield failed("drives from many starts", str(error))

    def _keep(self, built: BuiltFolder, driven: Mapping[str, Any]) -> Iterable[Check]:
        """The checks of drives that hold; their figures and files stay too."""
        self._kept = {name: driven[name] for name in _REPORTED if name in driven}
        told = content_of(built.directory / "timings.json")
        names = [f"{one}_{what}" for one in _REPORTED for what in _TIMED]
        self._timings = [(name, told[name]) for name in names if name in told]
        for check in driven["checks"]:
            if check["group"] == self.group:
                yield Check(**check)

    def _drive(self, built: BuiltFolder, spec: DriveSpec) -> list[Check]:
        """Drive a path through the exported scene."""
        world = built.world
        if (folder := built.mjcf) is None:
            return []
        path = next((t for t in world.trajectories if t.name == spec.path), None)
        if path is None:
            return [failed(f"drive {spec.path}", "the path does not lie within this world")]
        model = load_scene(folder / _SCENE)
        begin = time.perf_counter()
        result = drive(
            scene=model, trajectory=path, rover=world.rover, spec=spec, progress=built.progress
        )
        self._note_time("drive", begin, result.duration)
        self.drive = measure_clearance(world, result)
        return [rover_mass_check(world, model, folder.name), *drive_checks(self.drive, spec)]

    def _start(self, built: BuiltFolder, spec: StartsSpec) -> list[Check]:
        """Drive straight on from many starts."""
        begin = time.perf_counter()
        if (folder := built.mjcf) is None:
            return []
        scene = folder / _SCENE
        result = drive_from_many_starts(built.world, scene, spec, progress=built.progress)
        simulated = sum(start.drive.duration for start in result.starts if start.drive)
        self._note_time("drives", begin, simulated)
        self._starts = result
        lost = [start.reason for start in result.starts if not start.arrived]
        arrived = f"{len(result.starts) - len(lost)} of {len(result.starts)}"
        note = "; ".join([arrived, *dict.fromkeys(lost[:_TOLD])])
        return [
            at_least("drives: part that arrives", result.share, spec.arrive, note=note),
            at_most("drives: mean slip of the wheels", result.mean_slip, None),
        ]

    def _note_time(self, name: str, begin: float, simulated: float) -> None:
        wall = time.perf_counter() - begin
        self._timings += [
            (f"{name}_wall_time_s", wall), (f"{name}_real_time_factor", simulated / wall)
        ]  # fmt: skip

    def report(self) -> dict[str, Any]:
        """The drives' figures."""
        one = {"drive": drive_json(self.drive)} if self.drive else {}
        many = {"drives": _starts_json(self._starts)} if self._starts else {}
        return {**self._kept, **one, **many}

    def timings(self) -> tuple[tuple[str, float], ...]:
        """Wall times of the drives [s] and simulated over wall time."""
        return tuple(self._timings)

    def write(self, built: BuiltFolder, folder: Path) -> Iterable[Path]:
        """Tables, figures and pictures of the drives."""
        from terrain_forge import driving

        world, spec = built.world, built.spec.drive_spec
        if built.driven is not None:
            yield from (built.directory / name for name in built.driven["files"])
        if result := self.drive:
            name = driving.stem(result)
            yield from driving.write_tables(result, folder)
            yield driving.write_figure(world, result, folder / f"{name}.png")
            if spec and spec.film:
                yield driving.write_film(world, result, folder / f"{name}.webp")
            if not result.completed:
                yield driving.write_end(world, result, folder / f"{name}_end.png")
        if starts := self._starts:
            yield driving.write_starts_table(starts, folder / "drives.csv")
            yield driving.write_starts_figure(world, starts, folder / "drives.png")


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
            for name, (figure, unit) in _figures(result).items()
        ),
    ]  # fmt: skip


def _figures(result: DriveResult) -> dict[str, tuple[float, str]]:
    """What was measured and has no limit, by name: figure and unit."""
    cross_track, heading = np.abs(result.cross_track), np.degrees(np.abs(result.heading_error))
    roll, pitch = np.degrees(np.abs(result.rpy[:, :2])).max(axis=0).tolist()
    energy, slips = result.energy, result.slips
    figures = {
        "distance": (result.distance, "m"),
        "mean cross-track error": (float(cross_track.mean()), "m"),
        "95 % cross-track error": (float(np.quantile(cross_track, 0.95)), "m"),
        "95 % heading error": (float(np.quantile(heading, 0.95)), "deg"),
        "largest heading error": (float(heading.max()), "deg"),
        "largest roll": (roll, "deg"),
        "largest pitch": (pitch, "deg"),
        "mean slip of the wheels": (result.mean_slip, ""),
        "95 % slip of the wheels": (float(np.quantile(slips, 0.95)) if slips.size else 0.0, ""),
        "largest motor torque": (float(np.abs(result.wheel_torque).max()), "N m"),
        "part of the time at a torque limit": (result.saturated, ""),
        "work of the motors": (energy.driving, "J"),
        "braking work of the motors": (energy.braking, "J"),
        "energy dissipated": (energy.dissipated, "J"),
        "energy that nothing explains": (energy.unexplained, "J"),
        "rocks touched": (float(len(result.rocks)), ""),
        "largest force at a rock": (max((c.force for c in result.rock_contacts), default=0.0), "N"),
    }
    if result.joints:
        angle = float(np.degrees(np.abs(result.joint_angle)).max())
        figures["largest angle of a passive joint"] = (angle, "deg")
    if len(result.clearance):
        figures["least free height under the belly"] = (float(result.clearance.min()), "m")
    return figures


def drive_json(result: DriveResult) -> dict[str, Any]:
    """A drive for report.json."""
    energy = {**vars(result.energy), "dissipated": result.energy.dissipated}
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
        "energy": {f"{name}_j": value for name, value in energy.items()},
        "skid_gain": result.skid_gain,
    }


def _starts_json(result: StartsResult) -> dict[str, Any]:
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
