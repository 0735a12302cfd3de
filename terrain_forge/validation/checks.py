"""The validation of a built world: every check with its figure and limit, and the verdict."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from terrain_forge.base import Record
from terrain_forge.driving import (
    Driven,
    DriveResult,
    drive_json,
    drive_path,
    drive_starts,
    starts_json,
    write_drives,
)
from terrain_forge.model import Check, World, at_most, exporter
from terrain_forge.recipe import ValidateSpec
from terrain_forge.terrain import TerrainStatistics, terrain_statistics
from terrain_forge.validation.agreement import ground_agreement
from terrain_forge.validation.conformance.entry import Entry
from terrain_forge.validation.craters import crater_checks
from terrain_forge.validation.dynamic import dynamic_checks
from terrain_forge.validation.paths import path_checks
from terrain_forge.validation.replays import replay_checks
from terrain_forge.validation.rocks import rock_checks


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationResult(Record):
    """What a validation found and wrote."""

    checks: tuple[Check, ...]
    """Every check, in the order of the report."""
    drive: DriveResult | None
    """The drive, where one was asked for and could begin."""
    timings: tuple[tuple[str, float], ...]
    """Wall times of the drives [s] and simulated over wall time, for timings.json."""
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
    where a drive is asked for, or rocks are dynamic, and the recipe has none.

    Args:
        world: The world.
        directory: Its built folder.
        spec: What to check.
        altered: Files of the folder that are not as they were built.
        progress: Told the share of the drive that is done, 0 to 1, and then that of the exports.
    """
    folder = directory / "validation"
    _clear_exports(folder)
    checks = rock_checks(world, directory, points=spec.points)
    driven = _drives(world, directory, spec, progress)
    checks += driven.checks
    checks += dynamic_checks(world, directory)
    checks += crater_checks(directory)
    agreed = ground_agreement(world, directory, points=spec.points)
    shown = ", ".join(altered[:3])
    whole = at_most("files: missing or altered", float(len(altered)), 0.0, note=shown)
    entries = _conformance(world, directory, spec, progress)
    measured = [entry.check for entry in entries if entry.check]
    before, paths = path_checks(world)
    checks = [whole, *agreed, *replay_checks(world, directory), *before, *checks, *measured]
    film = spec.drive_spec is not None and spec.drive_spec.film
    _clear_results(folder)
    files = _write(world, folder, checks, driven, entries, paths, film=film)
    return ValidationResult(
        checks=tuple(checks), drive=driven.drive, timings=driven.timings, files=tuple(files)
    )


def _conformance(
    world: World, directory: Path, spec: ValidateSpec, progress: Callable[[float], None] | None
) -> list[Entry]:
    if spec.consumers != "all":
        return []
    from terrain_forge.validation.conformance.suite import conformance

    return conformance(world, directory, points=spec.points, progress=progress)


def _clear_exports(folder: Path) -> None:
    """Remove what an earlier validation of ours exported for itself."""
    folder.mkdir(exist_ok=True)
    for name in ("mjcf", "consumers"):
        shutil.rmtree(folder / name, ignore_errors=True)


def _clear_results(folder: Path) -> None:
    """Remove an earlier validation's results, once there are new ones; other files stay."""
    for pattern in ("report.json", "terrain.png", "drive_*", "drives.*"):
        for file in folder.glob(pattern):
            file.unlink()


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


def _drives(
    world: World, directory: Path, spec: ValidateSpec, progress: Callable[[float], None] | None
) -> Driven:
    """The drives that are asked for, one result after the other."""
    drive, starts = spec.drive_spec, spec.starts_spec
    if drive is None and starts is None:
        return Driven(checks=())
    scene = _scene(world, directory)
    one = drive_path(world, scene, drive, progress) if drive else Driven(checks=())
    many = drive_starts(world, scene, starts, progress) if starts else Driven(checks=())
    return Driven(
        checks=one.checks + many.checks,
        drive=one.drive,
        starts=many.starts,
        timings=one.timings + many.timings,
    )


def _write(
    world: World,
    folder: Path,
    checks: list[Check],
    driven: Driven,
    entries: list[Entry],
    paths: list[dict[str, Any]],
    *,
    film: bool,
) -> list[Path]:
    """Write the report, the ground's statistics, and the drives' tables and pictures."""
    from terrain_forge.terrain import write_terrain_figure

    statistics = terrain_statistics(site=world.site, ground=world.ground)
    files = [folder / "report.json", folder / "terrain.png"]
    text = _report(world, checks, statistics, driven, entries, paths)
    files[0].write_text(text, encoding="utf-8")
    write_terrain_figure(statistics, files[1])
    return files + write_drives(world, folder, driven, film=film)


def _report(
    world: World,
    checks: list[Check],
    statistics: TerrainStatistics,
    driven: Driven,
    entries: list[Entry],
    paths: list[dict[str, Any]],
) -> str:
    passed = all(check.passed for check in checks)
    report: dict[str, Any] = {
        "format": 1,
        "world": world.site.name,
        "verdict": "pass" if passed else "fail",
        "passed": passed,
        "checks": [vars(check) for check in checks],
        "conformance": [vars(entry) for entry in entries],
        "paths": paths,
        "terrain": statistics.as_json(),
    }
    if driven.drive:
        report["drive"] = drive_json(driven.drive)
    if driven.starts:
        report["drives"] = starts_json(driven.starts)
    return json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
