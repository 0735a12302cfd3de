"""What is told of a report that was written before."""

import json

import pytest

from terrain_forge.validation import failed_checks

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
