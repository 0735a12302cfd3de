"""What `check` says that a build costs."""

import json

import pytest

from terrain_forge.building.cost import pace


def test_pace_is_measured_once_for_each_machine(tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    measured, file = pace(), tmp_path / "pace.json"
    kept = json.loads(file.read_text())
    assert kept["pace"] == pytest.approx(measured, abs=1e-3)
    file.write_text(json.dumps(kept | {"pace": 77.5}))
    assert pace() == 77.5
    for broken in ("", "[]", "{}", json.dumps(kept | {"pace": "x"}), json.dumps({"machine": "b"})):
        file.write_text(broken)
        assert 0.0 < pace() != 77.5
        assert json.loads(file.read_text())["machine"] == kept["machine"]
