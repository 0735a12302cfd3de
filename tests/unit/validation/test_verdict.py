"""Checks of other packages, which may raise anything."""

from terrain_forge.model import at_most
from terrain_forge.recipe import ValidateSpec
from terrain_forge.validation import Inspection, validate, verdict


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
