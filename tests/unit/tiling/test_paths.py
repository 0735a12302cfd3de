"""Paths across tiles, and the drive along one, against the same site as one world."""

from __future__ import annotations

import csv
import json
import shutil

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.base import RecipeError
from terrain_forge.paths import write_trajectories
from terrain_forge.tiling import load_order
from terrain_forge.tiling.routing import Land
from terrain_forge.truth import rate_world
from tests.helpers.places import ROOT

TEXT = f"""
name: corridor
seed: 5
body: mars
dtm: {{source: {ROOT}/dtm_samples/gale_floor_synthetic.tif, size_m: [40, 14], level: plane}}
terrain: {{spacing_m: 0.125, layers: [{{kind: fractal}}]}}
rocks:
  library: {{shapes: 4}}
  populations:
    - name: rocks
      size_frequency: {{kind: golombek, k: 0.06}}
      diameter_m: [0.3, 1.0]
paths:
  - name: there
    speed_m_s: 0.5
    route: {{kind: planned, start_m: [-17, -4], goal_m: [17, 4]}}
  - name: line
    speed_m_s: 0.5
    shake: {{rms_deg: 1}}
    route: {{kind: polyline, points_m: [[-17, 2], [0, -3], [16, 3]], corner_radius_m: 2}}
validate: {{drive: there}}
tiles: {{size_m: 14}}
exports: []
"""


@pytest.fixture(scope="module")
def recipe(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "corridor.yaml"
    path.write_text(TEXT)
    return tf.load_recipe(path).recipe


@pytest.fixture(scope="module")
def driven(recipe, tmp_path_factory):
    """The site, built and driven in scenes of some 8 m."""
    out = tmp_path_factory.mktemp("site") / "corridor"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("terrain_forge.tiling.routing.AHEAD", 8.0)
        result = tf.build(recipe, out, workers=0)
    assert result.passed
    return out


def table(path):
    rows = list(csv.DictReader(path.read_text().splitlines()))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.mark.slow
def test_the_drive_goes_on_from_scene_to_scene(driven):
    told = json.loads((driven / "validation/drive.json").read_text())
    assert told["drive"]["reason"] == "arrived"
    assert told["scenes"] >= 5
    track = table(driven / "validation/drive_there.csv")
    place = np.stack([track[f"{axis}_m"] for axis in "xyz"], -1)
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    assert steps.max() < 0.07  # 0.5 m/s at ten looks a second: no jump
    assert np.abs(track["cross_track_m"]).max() < 0.1
    assert tf.validate(driven)
    report = json.loads((driven / "validation/report.json").read_text())
    assert "drive there: progress" in {check["name"] for check in report["checks"]}


@pytest.mark.slow
def test_a_damaged_drive_is_named_and_driven_anew(driven, recipe, tmp_path):
    out = shutil.copytree(driven, tmp_path / "corridor")
    (out / "validation/drive_there.csv").write_text("")
    (out / "validation/drive_there.tum").unlink()
    (out / "validation/drive.json").write_text("{")
    assert not tf.validate(out)
    told = json.loads((out / "validation/report.json").read_text())["damaged"]
    assert told == [
        "validation/drive.json is damaged",
        "validation/drive_there.csv is damaged",
        "validation/drive_there.tum is missing",
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("terrain_forge.tiling.routing.AHEAD", 8.0)
        assert tf.build(recipe, out, workers=0).passed
    for path in driven.glob("validation/drive*"):
        assert path.read_bytes() == (out / path.relative_to(driven)).read_bytes()
    assert json.loads((out / "validation/report.json").read_text())["damaged"] == []


@pytest.mark.slow
def test_paths_are_those_of_one_world(driven, recipe, tmp_path):
    whole = tf.realise(tf.plan(recipe))
    write_trajectories(whole.trajectories, tmp_path)
    mine, wanted = table(driven / "paths/line.csv"), table(tmp_path / "line.csv")
    for name, values in wanted.items():
        assert np.allclose(mine[name], values, rtol=0, atol=2e-9), name
    field, planned = rate_world(whole), table(driven / "paths/there.csv")
    length, shortest = (
        np.linalg.norm(np.diff(np.stack([one["x_m"], one["y_m"]]), axis=1), axis=0).sum()
        for one in (planned, table(tmp_path / "there.csv"))
    )
    assert length < 1.05 * shortest
    column, row = (
        np.rint((planned[name] - first) / 0.125).astype(int)
        for name, first in zip(("x_m", "y_m"), field.origin, strict=True)
    )
    assert field.cost[row, column].max() < 1.0
    met = table(driven / "truth/paths/there.csv")
    assert np.allclose(met["cost"], field.cost[row, column], atol=1e-4)
    assert met["gap_m"].min() > 0.0


@pytest.mark.slow
def test_a_part_has_the_sites_paths_that_lie_in_it(driven, tmp_path):
    """A planned one too; a part without the driven path is not driven."""
    whole = tf.cut(driven, tmp_path / "whole", centre=(0, 0), size=(38, 14), only=())
    names = ["there.csv", "line.csv"]
    for name in names:
        mine, wanted = table(tmp_path / "whole/paths" / name), table(driven / "paths" / name)
        assert all(np.allclose(mine[key], wanted[key], rtol=0, atol=2e-9) for key in wanted)
    assert whole.passed
    assert (tmp_path / "whole/validation/drive_there.csv").is_file()
    part = tf.cut(driven, tmp_path / "part", centre=(0, 0), size=(12, 10), only=())
    assert part.passed
    assert list((tmp_path / "part/paths").iterdir()) == []
    assert tf.World.load(tmp_path / "part").site.recipe.driven_path is None


@pytest.mark.slow
def test_windows_know_all_costs_that_are_asked_for(driven):
    land = Land(load_order(driven))
    bounds = -9.0, -2.0, -3.0, 4.0
    field = land.field(bounds)
    low, high = field.node(bounds[:2]), field.node(bounds[2:])
    assert (field.cost[low[0] : high[0] + 1, low[1] : high[1] + 1] >= 0.0).all()


def test_a_blocked_goal_is_told_before_any_tile_is_made(tmp_path):
    path = tmp_path / "corridor.yaml"
    path.write_text(TEXT.replace("goal_m: [17, 4]", "goal_m: [17, 6.9]"))
    with pytest.raises(RecipeError, match="would stand out over the border") as error:
        tf.build(tf.load_recipe(path).recipe, tmp_path / "out")
    assert error.value.key == ("paths", 0, "route", "goal_m")
    assert not (tmp_path / "out").exists()
