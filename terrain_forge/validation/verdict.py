"""The validation of a built world: every check with its figure and limit, and the verdict."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from math import isfinite
from pathlib import Path
from typing import Any

from terrain_forge.base import (
    FOREIGN_FAILURES,
    Record,
    failure_words,
    is_ours,
    parts,
    place_of,
)
from terrain_forge.driving import DriveResult
from terrain_forge.model import Check, Export, World, exporter, failed, plain_options
from terrain_forge.recipe import ValidateSpec
from terrain_forge.terrain import terrain_statistics
from terrain_forge.validation.checks.drives import Drives
from terrain_forge.validation.inspection import BuiltFolder, Inspection, content_of, leaving

GROUPS = ("files", "exports", "paths", "rocks", "truth", "drive", "craters", "other programs")
"""The order of the groups; those of other packages' checks follow."""
_TAKEN = {"format", "world", "verdict", "passed", "checks", "terrain"}
"""Keys of report.json that are our own."""
_EXPORTED = "validation/mjcf/", "validation/consumers/"
"""What a validation exports and keeps for itself."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationResult(Record):
    """What a validation found and wrote."""

    checks: tuple[Check, ...]
    """Every check, in the order of the report."""
    drive: DriveResult | None
    """The drive, where one was asked for, could begin, and was not kept."""
    timings: tuple[tuple[str, float], ...]
    """Wall times of the drives [s] and simulated over wall time, for timings.json."""
    files: tuple[Path, ...]
    """Files written."""
    exports: tuple[Export, ...]
    """The exports in the folder, with one that was made for the checks alone."""

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)


@cache
def inspections() -> tuple[type[Inspection], ...]:
    """All kinds of checks, of ours and of other packages."""
    return parts(Inspection, "terrain_forge.validation.checks", "terrain_forge.checks")


def validate(
    world: World,
    directory: Path,
    *,
    spec: ValidateSpec,
    exports: Sequence[Export] = (),
    altered: tuple[str, ...] = (),
    foreign: tuple[str, ...] = (),
    earlier: Sequence[str] = (),
    keep_drives: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> ValidationResult:
    """Check the world and what was exported of it; write the report into `directory`/validation.

    A check that fails is a result, not an error. The MJCF is exported into the validation folder
    where a drive is asked for, or rocks are dynamic, and there is none.

    Args:
        world: The world.
        directory: Its built folder.
        spec: What to check.
        exports: What was exported into the folder.
        altered: Files of the folder that are not as they were built.
        foreign: Files of the folder that are not the world's.
        earlier: Files that an earlier validation wrote, which go.
        keep_drives: Whether its drives hold: they went through the same scene with the same spec.
        progress: Told which checks are made, and the share of long ones that is done, 0 to 1.
    """
    folder = directory / "validation"
    driven = _driven(folder, earlier) if keep_drives else None
    earlier = [name for name in earlier if not driven or name not in driven["files"]]
    exported = [name for name in earlier if name.startswith(_EXPORTED)]
    _remove(directory, exported)
    folder.mkdir(exist_ok=True)
    built = BuiltFolder(
        world=world,
        directory=directory,
        exports=_with_mjcf(world, directory, exports, spec),
        spec=spec,
        altered=altered,
        foreign=foreign,
        driven=driven,
    )
    made = [kind() for kind in inspections()]
    found = [
        c.replace(group=c.group or one.group) for one in made for c in _checks(one, built, progress)
    ]
    more: dict[str, Any] = {}
    for one in made:
        found += _reported(one, more)
    order = {group: place for place, group in enumerate(GROUPS)}
    checks = tuple(sorted(found, key=lambda check: order.get(check.group, len(order))))
    _remove(directory, [name for name in earlier if name not in exported])
    folder.mkdir(exist_ok=True)
    files = _write(built, folder, checks, made, more)
    return ValidationResult(
        checks=checks,
        drive=next(one.drive for one in made if isinstance(one, Drives)),
        timings=tuple(timing for one in made for timing in one.timings()),
        files=tuple(files),
        exports=built.exports,
    )


def _driven(folder: Path, earlier: Sequence[str]) -> dict[str, Any] | None:
    """An earlier report and the files of its drives, where there is one."""
    report = content_of(folder / "report.json")
    if not report:
        return None
    files = [name for name in earlier if name.startswith(f"{folder.name}/drive")]
    return {**report, "files": files}


def _checks(
    inspection: Inspection, built: BuiltFolder, progress: Callable[[str, float], None] | None
) -> list[Check]:
    """What an inspection finds; one of another package that raises has failed."""
    if progress:
        built = replace(built, progress=partial(progress, inspection.kind))
        progress(inspection.kind, 0.0)
    found: list[Check] = []
    with _leaving(inspection, built.directory):
        try:
            found.extend(map(_judged, inspection.checks(built)))  # what came before a fault stays
        except FOREIGN_FAILURES as error:
            found.append(_at_fault(inspection, "check", error))
    return found


def _leaving(inspection: Inspection, folder: Path) -> AbstractContextManager[None]:
    """Refuse an inspection of another package that changes or removes files which are there."""
    module = type(inspection).__module__
    return leaving(f"check {inspection.kind!r} ({module})", module, folder)


def _judged(check: Check) -> Check:
    """A check as JSON can hold it; one with a number that is none has failed."""
    if not isinstance(check, Check):
        raise TypeError(f"found {type(check).__name__}, not a Check")
    numbers = {name: getattr(check, name) for name in ("figure", "limit")}
    plain = {name: None if one is None else float(one) for name, one in numbers.items()}
    odd = [
        f"{name} {one:g}" for name, one in plain.items() if one is not None and not isfinite(one)
    ]
    if odd:
        note = f"{' and '.join(odd)}, not finite{'; ' * bool(check.note)}{check.note}"
        return failed(check.name, note).replace(group=check.group)
    return check.replace(**plain, passed=bool(check.passed))


def _reported(inspection: Inspection, more: dict[str, Any]) -> list[Check]:
    """Add what an inspection reports; one of another package that cannot be added has failed."""
    try:
        told = inspection.report()
        json.dumps(told, allow_nan=False)
        if taken := [key for key in told if key in more or key in _TAKEN]:
            raise ValueError(f"{', '.join(taken)} of validation/report.json is another's")
        more |= told
    except FOREIGN_FAILURES as error:
        return [_at_fault(inspection, "report", error).replace(group=inspection.group)]
    return []


def _at_fault(inspection: Inspection, what: str, error: BaseException) -> Check:
    """A check that says what is wrong with one of another package; an error of ours goes on."""
    if is_ours(type(inspection).__module__):
        raise error
    where, why = place_of(type(inspection), error), failure_words(error)
    return failed(f"{inspection.kind}: {what}", f"cannot be made ({where}): {why}")


def _remove(directory: Path, names: Sequence[str]) -> None:
    """Remove files of the folder, and the folders that are empty then."""
    for name in names:
        (directory / name).unlink(missing_ok=True)
        for above in list((directory / name).parents)[: name.count("/")]:
            with suppress(OSError):
                above.rmdir()


def _with_mjcf(
    world: World, directory: Path, exports: Sequence[Export], spec: ValidateSpec
) -> tuple[Export, ...]:
    """The exports, and an MJCF in the validation's folder if the checks need one more."""
    mine = "validation/mjcf"
    others = [export for export in exports if export.folder != mine]
    driven = spec.drive_spec or spec.starts_spec or world.field.dynamic.any()
    if driven and all(export.kind != "mjcf" for export in others):
        (directory / mine).mkdir(exist_ok=True)
        mjcf = exporter("mjcf")
        options = mjcf.Options()
        losses = mjcf.export(world, directory / mine, options=options).losses
        plain = plain_options(options)
        others.append(Export(folder=mine, kind="mjcf", options=plain, losses=losses))
    return tuple(sorted(others, key=lambda export: export.folder))


def _write(
    built: BuiltFolder,
    folder: Path,
    checks: tuple[Check, ...],
    made: list[Inspection],
    more: dict[str, Any],
) -> list[Path]:
    """Write the report, the ground's statistics, and what else the checks have."""
    from terrain_forge.terrain import write_terrain_figure

    statistics = terrain_statistics(site=built.world.site, ground=built.world.ground)
    passed = all(check.passed for check in checks)
    report = {
        "format": 1,
        "world": built.world.site.name,
        "verdict": "pass" if passed else "fail",
        "passed": passed,
        "checks": [vars(check) for check in checks],
        "terrain": statistics.as_json(),
        **more,
    }
    text = json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False)
    files = [folder / "report.json", folder / "terrain.png"]
    files[0].write_text(text + "\n", encoding="utf-8")
    write_terrain_figure(statistics, files[1])
    for one in made:
        with _leaving(one, built.directory):
            files += one.write(built, folder)
    return files
