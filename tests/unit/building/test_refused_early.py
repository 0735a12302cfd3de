"""What recipe and arguments alone tell is refused before kernels are compiled and heights read."""

from dataclasses import replace

import pytest

from terrain_forge import pipeline
from terrain_forge.base import OutputError, TerrainForgeError
from terrain_forge.cli import main
from terrain_forge.recipe import load_recipe
from terrain_forge.recording import record as recording

RECIPE = """\
name: early
body: mars
dtm: {kind: flat, size_m: [8, 8]}
terrain: {spacing_m: 0.1}
paths:
  - {name: track, speed_m_s: 0.1, route: {kind: spline, points_m: [[-3, 0], [3, 0]]}}
exports: [geotiff]
"""


@pytest.fixture
def recipe(tmp_path, monkeypatch):
    """A recipe's file; to compile or to read heights is an error."""

    def forbidden(*_args, **_options):
        raise AssertionError("work has begun")

    monkeypatch.setattr("terrain_forge.pipeline.compile_ahead", forbidden)
    monkeypatch.setattr("terrain_forge.base.compile_ahead", forbidden)
    monkeypatch.setattr("terrain_forge.making.planning.survey", forbidden)
    path = tmp_path / "early.yaml"
    path.write_text(RECIPE)
    return path


CASES = [
    ((), {"workers": 2}, "--workers, --scheduler and --exchange are for sites in tiles"),
    (("tiles.size_m=3.33",), {}, "3.33 m is not a whole number"),
    (("dtm.size_m=[1.0e9, 8]",), {}, r"1e\+09 m: a site is at most as long as the radius of mars"),
    (("tiles={}", "exports=[mjcf]"), {}, "mjcf is not written tile by tile"),
    (("tiles={}", "validate.drives=3"), {}, "drives from random starts are for one world"),
    (("validate.drive=none",), {}, "no path is called 'none'"),
    (("dataset.formats=[kitti]", "sensors=[]"), {}, "format 'kitti' needs"),
    (("sun.time=1800-01-01",), {}, "orbits are known from 1950"),
    (("paths.0.route.points_m=[[-30, 0], [3, 0]]",), {}, "track"),
]


@pytest.mark.parametrize(("changes", "how", "told"), CASES)
def test_a_build_is_refused_before_any_work(recipe, tmp_path, changes, how, told):
    file = load_recipe(recipe, changes=changes)
    with pytest.raises(TerrainForgeError, match=told):
        pipeline.build(file.recipe, tmp_path / "out", folder=file.folder, **how)
    assert not (tmp_path / "out").exists()


def test_a_preview_is_refused_before_any_work(recipe, tmp_path, capsys):
    out = str(tmp_path / "one.png")
    command = ["preview", str(recipe), "-o", out, "--set", "validate.drive=none"]
    assert main(command) == 2
    assert "no path is called 'none'" in capsys.readouterr().err


def test_a_recording_of_no_sensor_is_refused_before_any_work(small_world, tmp_path, monkeypatch):
    def forbidden(*_args, **_options):
        raise AssertionError("work has begun")

    monkeypatch.setattr(recording, "compile_ahead", forbidden)
    with pytest.raises(OutputError, match=r"--only camara: no sensor .*there are: "):
        pipeline.record(small_world, tmp_path, only=("camara",))


def test_without_a_mistake_work_begins(recipe, tmp_path):
    file = load_recipe(recipe)
    with pytest.raises(AssertionError, match="work has begun"):
        pipeline.build(replace(file.recipe, name="other"), tmp_path / "out")
