"""Programs are not given exports with altered files: an MJCF of few words can ask for anything."""

from __future__ import annotations

from pathlib import Path

import pytest
from terrain_forge.exporters import mjcf

from terrain_forge.model import Export
from terrain_forge.recipe import DriveSpec, ValidateSpec
from terrain_forge.validation import validate
from terrain_forge.validation.suite import conformance, quick_checks
from tests.unit.driving.test_drive import line, plain

ALTERED = ("mjcf/world.xml",)
WHY = "not opened, since altered: mjcf/world.xml"
EXPORTS = [Export(folder="mjcf", kind="mjcf", options={})]


@pytest.fixture(scope="module")
def world():
    return plain(line((-2, 0), (2, 0)))


@pytest.fixture
def folder(world, tmp_path: Path) -> Path:
    (tmp_path / "mjcf").mkdir()
    mjcf.export(world, tmp_path / "mjcf", options=mjcf.Options())
    return tmp_path


def test_its_checks_fail_by_name(world, folder):
    (check,) = quick_checks(world, folder, EXPORTS, points=10, altered=ALTERED)
    assert (check.name, check.passed, check.note) == ("mjcf: reading", False, WHY)
    found = [one for one in conformance(world, folder, EXPORTS, points=10, altered=ALTERED)]
    assert {(one.status, one.note) for one in found if one.export == "mjcf"} == {("fail", WHY)}


def test_nor_does_a_rover_drive_there(world, folder):
    told = {"spec": ValidateSpec(points=10, drive=DriveSpec(path="there")), "exports": EXPORTS}
    checks = validate(world, folder, altered=ALTERED, **told).checks
    notes = {check.name: check.note for check in checks if not check.passed}
    assert notes["drive there"] == notes["mjcf: reading"] == WHY


def test_others_are_opened(world, folder):
    checks = quick_checks(world, folder, EXPORTS, points=10, altered=("mjcf2/world.xml",))
    assert len(checks) > 1
