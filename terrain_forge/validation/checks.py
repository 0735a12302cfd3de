"""The validation of a built world: every check with its figure and limit, and the verdict."""

from __future__ import annotations

import json
import math
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.driving.drive import ARRIVAL, DriveResult, drive, load_scene
from terrain_forge.errors import SimulationError
from terrain_forge.records import Record
from terrain_forge.registry import exporter
from terrain_forge.terrain.statistics import TerrainStatistics, terrain_statistics
from terrain_forge.validation.agreement import ground_agreement
from terrain_forge.validation.check import Check, at_most, failed
from terrain_forge.validation.conformance.entry import Entry
from terrain_forge.validation.craters import crater_checks
from terrain_forge.validation.loose import loose_checks
from terrain_forge.validation.replays import replay_checks
from terrain_forge.validation.rocks import rock_checks
from terrain_forge.validation.spec import DriveSpec, ValidateSpec
from terrain_forge.world import World


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationResult(Record):
    """What a validation found and wrote."""

    checks: tuple[Check, ...]
    """Every check, in the order of the report."""
    drive: DriveResult | None
    """The drive, where one was asked for and could begin."""
    timings: tuple[tuple[str, float], ...]
    """Wall time of the drive [s] and simulated over wall time, for timings.json."""
    files: tuple[Path, ...]
    """Files written."""

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)


def validate(
    world: World,
    directory: Path,
    *,
    spec: ValidateSpec,
    altered: tuple[str, ...] = (),
    progress: Callable[[float], None] | None = None,
) -> ValidationResult:
    """Check the world and what was exported of it; write the report into `directory`/validation.

    A check that fails is a result, not an error. The MJCF is exported into the validation folder
    where a drive is asked for, or rocks are loose, and the recipe has none.

    Args:
        world: The world.
        directory: Its built folder.
        spec: What to check.
        altered: Files of the folder that are not as they were built.
        progress: Told the share of the drive that is done, 0 to 1.
    """
    folder = directory / "validation"
    _clear(folder)
    checks = rock_checks(world, directory, points=spec.points)
    result: DriveResult | None = None
    timings: tuple[tuple[str, float], ...] = ()
    if spec.drive_spec:
        scene = _scene(world, directory)
        driven, result, timings = _drive(world, scene, spec.drive_spec, progress)
        checks += driven
    checks += loose_checks(world, directory)
    checks += crater_checks(directory)
    agreed = ground_agreement(world, directory, points=spec.points)
    shown = ", ".join(altered[:3])
    whole = at_most("files: missing or altered", float(len(altered)), 0.0, note=shown)
    entries = _conformance(world, directory, spec)
    measured = [entry.check for entry in entries if entry.check]
    checks = [whole, *agreed, *replay_checks(world, directory), *checks, *measured]
    files = _write(world, folder, checks, result, entries)
    return ValidationResult(checks=tuple(checks), drive=result, timings=timings, files=tuple(files))


def _conformance(world: World, directory: Path, spec: ValidateSpec) -> list[Entry]:
    if spec.consumers != "all":
        return []
    from terrain_forge.validation.conformance.suite import conformance

    return conformance(world, directory, points=spec.points)


def _clear(folder: Path) -> None:
    """Remove what an earlier validation of ours wrote; other things in the folder stay."""
    folder.mkdir(exist_ok=True)
    for name in ("mjcf", "consumers"):
        shutil.rmtree(folder / name, ignore_errors=True)
    for name in ("report.json", "terrain.png", "drive.png", "drive.csv", "drive.tum"):
        (folder / name).unlink(missing_ok=True)


def _scene(world: World, directory: Path) -> Path:
    """The exported scene.xml; exported for the validation alone where there is none."""
    found = sorted(directory.glob("*/scene.xml"))
    if found:
        return found[0]
    folder = directory / "validation" / "mjcf"
    folder.mkdir()
    mjcf = exporter("mjcf")
    mjcf.export(world, folder, options=mjcf.Options())
    return folder / "scene.xml"


def _drive(
    world: World, scene: Path, spec: DriveSpec, progress: Callable[[float], None] | None
) -> tuple[list[Check], DriveResult | None, tuple[tuple[str, float], ...]]:
    """Drive through the exported scene; checks, result and timings."""
    from terrain_forge.validation.mujoco_agreement import rover_mass_check

    title = f"drive {spec.path}"
    trajectory = next((t for t in world.trajectories if t.name == spec.path), None)
    if trajectory is None:
        return [failed(title, "the path does not lie within this world")], None, ()
    try:
        model = load_scene(scene)
        begin = time.perf_counter()
        result = drive(
            scene=model, trajectory=trajectory, rover=world.rover, spec=spec, progress=progress
        )
    except SimulationError as error:
        return [failed(title, str(error))], None, ()
    wall = time.perf_counter() - begin
    checks = [
        rover_mass_check(world, model, scene.parent.name),
        *drive_checks(result, spec),
    ]
    timings = (("drive_wall_time_s", wall), ("drive_real_time_factor", result.duration / wall))
    return checks, result, timings


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
    cross_track, heading = np.abs(result.cross_track), np.abs(result.heading_error)
    roll, pitch = np.abs(result.rpy[:, :2]).max(axis=0)
    slowest = spec.time_factor * result.planned_time
    return [
        arrived,
        at_most(f"{title}: time", result.duration, slowest, unit="s"),
        at_most(f"{title}: largest cross-track error", result.largest_cross_track,
                spec.cross_track_m, unit="m"),
        at_most(f"{title}: largest tilt", math.degrees(result.largest_tilt),
                spec.tilt_deg, unit="deg"),
        at_most(f"{title}: distance", result.distance, None, unit="m"),
        at_most(f"{title}: mean cross-track error", float(cross_track.mean()), None, unit="m"),
        at_most(f"{title}: 95 % cross-track error", float(np.quantile(cross_track, 0.95)), None,
                unit="m"),
        at_most(f"{title}: 95 % heading error", math.degrees(np.quantile(heading, 0.95)), None,
                unit="deg"),
        at_most(f"{title}: largest heading error", math.degrees(heading.max()), None, unit="deg"),
        at_most(f"{title}: largest roll", math.degrees(roll), None, unit="deg"),
        at_most(f"{title}: largest pitch", math.degrees(pitch), None, unit="deg"),
        at_most(f"{title}: rocks touched", float(len(result.rocks)), None),
        at_most(f"{title}: largest force at a rock", result.largest_rock_force, None, unit="N"),
    ]  # fmt: skip


def _write(
    world: World,
    folder: Path,
    checks: list[Check],
    result: DriveResult | None,
    entries: list[Entry],
) -> list[Path]:
    """Write the report, the ground's statistics, and the drive's track and picture."""
    from terrain_forge.terrain.evidence import write_terrain_figure

    statistics = terrain_statistics(site=world.site, ground=world.ground)
    files = [folder / "report.json", folder / "terrain.png"]
    text = _report(world, checks, statistics, result, entries)
    files[0].write_text(text, encoding="utf-8")
    write_terrain_figure(statistics, files[1])
    if result:
        from terrain_forge.driving.files import write_figure, write_track

        files += write_track(result, folder)
        files.append(write_figure(world, result, folder / "drive.png"))
    return files


def _report(
    world: World,
    checks: list[Check],
    statistics: TerrainStatistics,
    result: DriveResult | None,
    entries: list[Entry],
) -> str:
    passed = all(check.passed for check in checks)
    report: dict[str, Any] = {
        "format": 1,
        "world": world.site.name,
        "verdict": "pass" if passed else "fail",
        "passed": passed,
        "checks": [vars(check) for check in checks],
        "conformance": [vars(entry) for entry in entries],
        "terrain": statistics.as_json(),
    }
    if result:
        report["drive"] = {
            "path": result.path,
            "completed": result.completed,
            "reason": result.reason,
            "time_s": result.duration,
            "planned_time_s": result.planned_time,
            "distance_m": result.distance,
            "planned_distance_m": result.planned_distance,
            "rocks_touched": list(result.rocks),
        }
    return json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
