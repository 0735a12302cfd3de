"""Whether a rover can drive the world, in MuJoCo."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from terrain_forge.driving import (
    Driven,
    drive_json,
    drive_path,
    drive_starts,
    starts_json,
    write_drives,
)
from terrain_forge.model import Check
from terrain_forge.validation.inspection import BuiltFolder, Inspection


class Drives(Inspection):
    """The drives that are asked for, one after the other, with their tables and pictures."""

    kind = "drives"
    group = "drive"

    def __init__(self) -> None:
        self.driven = Driven(checks=())

    def checks(self, built: BuiltFolder) -> tuple[Check, ...]:
        """What the drives must keep, and what was measured of them."""
        drive, starts = built.spec.drive_spec, built.spec.starts_spec
        none = self.driven
        if built.mjcf is None or (drive is None and starts is None):
            return ()
        scene = built.mjcf / "scene.xml"
        one = drive_path(built.world, scene, drive, built.progress) if drive else none
        many = drive_starts(built.world, scene, starts, built.progress) if starts else none
        self.driven = Driven(
            checks=one.checks + many.checks,
            drive=one.drive,
            starts=many.starts,
            timings=one.timings + many.timings,
        )
        return self.driven.checks

    def report(self) -> dict[str, Any]:
        """The drives' figures."""
        one = {"drive": drive_json(self.driven.drive)} if self.driven.drive else {}
        many = {"drives": starts_json(self.driven.starts)} if self.driven.starts else {}
        return {**one, **many}

    def timings(self) -> tuple[tuple[str, float], ...]:
        """Wall times of the drives [s] and simulated over wall time."""
        return self.driven.timings

    def write(self, built: BuiltFolder, folder: Path) -> Iterable[Path]:
        """Tables, figures and pictures of the drives."""
        spec = built.spec.drive_spec
        return write_drives(built.world, folder, self.driven, film=spec is not None and spec.film)
