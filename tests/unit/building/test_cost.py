"""What `check` says that a build costs."""

import json
import re
from dataclasses import replace

import pytest

from terrain_forge.building.calibration import FARTHEST, learn, pace
from terrain_forge.building.cost import (
    DETOUR,
    DRIVING,
    FILMING,
    cost_line,
    drive_seconds,
    exported_bytes,
    stage_seconds,
)
from terrain_forge.dtm import FlatDtm, HorizonSpec
from terrain_forge.making import plan
from terrain_forge.paths import PathSpec, Planned
from terrain_forge.pipeline import check
from terrain_forge.recipe import (
    DriveSpec,
    TilesSpec,
    ValidateSpec,
    export_orders,
)
from terrain_forge.rocks import LibrarySpec
from tests.helpers.recipes import flat


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


def test_builds_teach_how_long_their_stages_take(tmp_path, monkeypatch):
    """A stage that always takes four times its rate is soon expected to; others stay as they were.

    What was too short to measure, the library, which may be in the cache, and a build that compiled
    teach nothing.
    """
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    file = tmp_path / "pace.json"

    def known():
        return json.loads(file.read_text())["stages"]

    learn({"writing": 2.0}, {"writing": 8.0, "compile": 9.0}, {"writing": 8.0})
    assert known() == {}
    factor = 1.0
    for _ in range(6):
        expected = {"writing": 2.0 * factor, "ground": 1.0, "rock library": 1.0}
        taken = {"writing": 8.0, "ground": 0.01, "rock library": 9.0, "paths": 3.0}
        learn(expected, taken, taken)
        assert set(known()) == {"writing"}
        factor = known()["writing"]
    assert factor == pytest.approx(4.0, rel=0.05)
    learn({"writing": 2.0}, {"writing": 8e6}, {"writing": 8e6})
    assert known() == {"writing": FARTHEST}
    assert pace() == json.loads(file.read_text())["pace"]
    for broken in ({"writing": 1e9}, {"writing": "x"}, [], None):
        file.write_text(json.dumps(json.loads(file.read_text()) | {"stages": broken}))
        assert 0.0 < pace()
        assert known() == {}


def test_a_busy_machine_teaches_nothing_of_its_waiting(tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    learn({"writing": 2.0}, {"writing": 10.0}, {"writing": 2.0})
    assert json.loads((tmp_path / "pace.json").read_text())["stages"] == {"writing": 1.0}


def test_checks_and_drives_teach_apart(tmp_path, monkeypatch):
    """Small worlds, whose checks take less than expected, do not make a long drive seem short."""
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    for _ in range(6):
        learn({"validation": 2.0}, {"validation": 0.5}, {"validation": 0.5})
    site = plan(replace(planned(0.1), validate=ValidateSpec(drive=DriveSpec(path="0"))))
    driven = drive_seconds(site)
    checks = stage_seconds(site, [])["validation"] - driven
    rate = pace() * (DRIVING * 90.0 * DETOUR + FILMING)
    assert driven == pytest.approx(rate, rel=0.1)
    expected, taken = {"validation": checks + driven}, {"validation": checks + 4.0 * driven}
    early = {"validation": checks + 0.3 * driven}
    learn(expected, early, early, driven=driven, passed=False)
    assert drive_seconds(site) == driven
    learn(expected, taken, taken, driven=driven)
    assert drive_seconds(site) == pytest.approx(2.0 * driven, rel=0.01)  # half of it is believed
    assert stage_seconds(site, [])["validation"] - 2.0 * driven == pytest.approx(checks, rel=0.01)


def test_disk_of_a_small_world_without_horizon(tmp_path, monkeypatch):
    """12 × 12 m, 2 shapes, MJCF: 8.3 MB were written; with the usual 16 and a horizon 19."""
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    recipe = flat((12.0, 12.0), 0.1)
    recipe = replace(
        recipe,
        horizon=HorizonSpec(reach_m=0.0),
        rocks=replace(recipe.rocks, library=LibrarySpec(shapes=2)),
        exports=("mjcf",),
    )
    orders = export_orders(recipe)
    told = re.search(r"([\d,]+) MB on disk", cost_line(plan(recipe), orders))[1]
    assert 8.3 / 1.5 < float(told) < 8.3 * 1.5


def planned(*speeds):
    """A recipe with planned paths of some speeds, called by their numbers."""
    route = Planned(start_m=(-4.0, 0.0), goal_m=(5.0, 0.0))
    paths = (PathSpec(name=str(n), route=route, speed_m_s=s) for n, s in enumerate(speeds))
    return flat((16.0, 12.0), 0.1, paths=tuple(paths))


def test_the_drive_of_a_planned_path_is_in_the_estimate(tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    alone, driven = (
        stage_seconds(plan(replace(planned(0.1), validate=ValidateSpec(drive=one))), [])
        for one in (None, DriveSpec(path="0", film=False))
    )
    more = driven["validation"] - alone["validation"]
    assert more == pytest.approx(pace() * 90.0 * DETOUR * DRIVING, rel=0.1)


def test_a_path_faster_than_the_rover_is_warned_of():
    told = check(planned(100.0, 0.1))
    warned = [line.split(maxsplit=1)[1] for line in told if "warning" in line]
    assert warned == ["0: 100 m/s, the rover morpheus drives at 1 m/s at most"]


@pytest.mark.parametrize(
    ("goal", "tiles", "seconds", "megabytes"),
    [
        ((9.0, 0.0), None, 0.5, 0.8),  # 0.6 m beside 16 m, in pixels of 4 mm
        ((490.0, 0.0), None, 7.1, 12.0),  # 2^24 pixels
        ((490.0, 0.0), 20.0, 25.0, 31.0),  # all of the ground's 4 mm, and each tile made again
        ((490.0, 0.0), 4000.0, 11.0, 12.0),
    ],
)
def test_what_is_drawn_near_paths_is_in_the_estimate(
    goal, tiles, seconds, megabytes, tmp_path, monkeypatch
):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    route = Planned(start_m=(-4.0, 0.0), goal_m=goal)
    recipe = replace(
        planned(),
        dtm=FlatDtm(size_m=(1000.0, 20.0)),
        paths=(PathSpec(name="far", route=route, speed_m_s=0.1),),
        tiles=TilesSpec(size_m=tiles) if tiles else None,
    )
    site = plan(recipe)
    found = []
    for within in (0.0, 0.6):
        orders = export_orders(replace(recipe, exports={"usd": {"close_within_m": within}}))
        size = exported_bytes(orders, site)
        found.append((sum(stage_seconds(site, orders).values()) / pace(), size))
    (none, before), (near, after) = found
    assert near - none == pytest.approx(seconds, rel=0.3)
    assert after - before == pytest.approx(1e6 * megabytes, rel=0.3)
