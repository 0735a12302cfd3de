"""Checks: of rocks, of exports by what reads them, of other packages, of a report that was kept."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from terrain_forge.model import Export, at_most
from terrain_forge.recipe import ValidateSpec
from terrain_forge.validation import Consumer, Inspection, NotRun, failed_checks, validate, verdict
from terrain_forge.validation.checks.rocks import Resting
from terrain_forge.validation.probe import read_answer
from terrain_forge.validation.sample import draw_sample
from terrain_forge.validation.suite import read
from tests.helpers import worlds


class Broken(Inspection):
    kind = "boom"

    def checks(self, built):
        raise ValueError("no idea")


class Whole(Inspection):
    kind = "whole"
    group = "mine"

    def checks(self, built):
        return [at_most("whole: figure", 0.5, 1.0)]


class Late(Inspection):
    kind = "late"

    def checks(self, built):
        yield at_most("late: figure", 0.5, 1.0)
        yield at_most("late: other", 2.0, 1.0)
        raise OSError("no more")


def test_a_foreign_check_that_raises_has_failed(small_world, tmp_path, monkeypatch):
    real = verdict.inspections()
    monkeypatch.setattr(verdict, "inspections", lambda: (*real, Broken, Whole, Late))
    result = validate(small_world, tmp_path, spec=ValidateSpec(), exports=())
    found = {check.name: check for check in result.checks}
    assert found["whole: figure"].group == "mine"
    assert not found["boom: check"].passed
    assert "no idea" in found["boom: check"].note
    late = {name: check.passed for name, check in found.items() if name.startswith("late: ")}
    assert late == {"late: figure": True, "late: other": False, "late: check": False}
    assert "no more" in found["late: check"].note
    assert not result.passed


CHECK = {"name": "ground", "figure": 2.0, "unit": "m", "limit": 1.0, "passed": False, "note": ""}


@pytest.mark.parametrize(
    "checks",
    [[[]], [{**CHECK, "limit": "one"}], [{"name": "ground"}], {"ground": CHECK}, None, 3],
)
def test_a_damaged_report_tells_nothing(tmp_path, checks):
    (tmp_path / "validation").mkdir()
    report = tmp_path / "validation" / "report.json"
    report.write_text(json.dumps({"checks": [CHECK]}), encoding="utf-8")
    assert [check.name for check in failed_checks(tmp_path)] == ["ground"]
    report.write_text(json.dumps({"checks": checks}), encoding="utf-8")
    assert failed_checks(tmp_path) == []


UP = np.array([0.0, 0.0, 3.0])


def resting_checks(world):
    return Resting().checks(SimpleNamespace(world=world))


def test_of_many_rocks_a_sample_is_looked_at():
    many = worlds.world(rocks=6000)
    checks = resting_checks(many)
    counted = {int(check.note.split(",")[0].removeprefix("of ")) for check in checks[:1]}
    assert 1000 < counted.pop() < 6000
    assert resting_checks(many) == checks
    raised = many.replace(field=many.field.replace(position=many.field.position + UP))
    assert not (daylight := resting_checks(raised)[0]).passed
    assert "stay where they are" in daylight.note
    assert "stay where they are" not in checks[0].note
    sunk = many.replace(field=many.field.replace(position=many.field.position - UP))
    assert not resting_checks(sunk)[1].passed


def test_rocks_that_hang_are_named():
    world = worlds.world(rocks=60)
    up = np.zeros((len(world.field), 3))
    up[[4, 9, 11], 2] = 20.0, 60.0, 200.0
    raised = world.replace(field=world.field.replace(position=world.field.position + up))
    named = ", ".join(map(str, world.field.id[[11, 9, 4]].tolist()))
    assert f"most beneath {named}: " in resting_checks(raised)[0].note


@pytest.fixture(scope="module")
def sample():
    return draw_sample(worlds.world(), points=3, quick=True)


def read_with(error, sample, folder):
    """What is told of an export whose consumer raises an error."""

    def fails(*_):
        raise error

    consumer = Consumer(name="theirs", read=fails, quick=True)
    export = Export(folder="xyz", kind="xyz", options={})
    (entry,), reading = read(sample, folder, export, consumer, None, folder)
    assert reading is None
    return entry.status, entry.note


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ValueError("a\nb"), ("fail", "cannot be read: a b")),
        (MemoryError(), ("fail", "cannot be read: MemoryError")),
        (
            SystemExit(3),
            ("fail", "cannot be read: it would end the process (SystemExit: 3)"),
        ),
        (NotRun("not here"), ("not run", "not here")),
    ],
)
def test_a_consumer_that_fails_fails_the_check(sample, tmp_path, error, told):
    assert read_with(error, sample, tmp_path) == told


def test_an_interrupt_is_the_user_s(sample, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        read_with(KeyboardInterrupt(), sample, tmp_path)


CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
PLACED = np.array([2.0, 3.0, 4.0])
PLACE = "1\t0\t0\t2\t0\t1\t0\t3\t0\t0\t1\t4"
ANSWER = f"""consumer\tNewton 1
mesh\t3\t1
mesh\t3\t1
shape\ttouched\trock_7\tcollision\t0\t{PLACE}
shape\tseen\trock_7\tvisual\t1\t{PLACE}
shape\tseen\trock_8\tvisual\t1\t{PLACE}
shape\ttouched\tworld\tground_0\t0\t{PLACE}
"""


def test_what_is_touched_and_what_is_seen_are_told_apart(tmp_path):
    binary = tmp_path / "meshes.bin"
    faces = np.array([[0, 1, 2]], np.int32).tobytes()
    binary.write_bytes(CORNERS.tobytes() + faces + (2.0 * CORNERS).tobytes() + faces)
    reading = read_answer(SimpleNamespace(rocks=(7,)), ANSWER, binary)
    assert reading.touched.rock == reading.seen.rock == [7]
    assert np.array_equal(reading.touched.vertices, CORNERS + PLACED)
    assert np.array_equal(reading.seen.vertices, 2.0 * CORNERS + PLACED)
    (ground,) = reading.ground
    assert np.array_equal(ground.vertices, CORNERS + PLACED)
