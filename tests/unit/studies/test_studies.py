"""Studies: what their factors set, which cells there are, how they go on, what they find."""

from __future__ import annotations

import csv
import json
import re
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from terrain_forge import model
from terrain_forge.base import OutputError, RecipeError, StorageError
from terrain_forge.studies import (
    costs_of,
    effect_rows,
    effects_of,
    read_study,
    run_study,
    shipped_studies,
    study_of,
)
from terrain_forge.studies import running as running_file
from terrain_forge.studies import whole as whole_file
from terrain_forge.studies.effects import outcomes_of, write_tables
from terrain_forge.studies.factors import places_of
from terrain_forge.studies.worker import carry_out, lacking, sensors_for
from tests.helpers.command_line import run

RECIPE = """
    schema: 1
    name: plain
    seed: 7
    body: mars
    dtm: {kind: flat, size_m: [16, 8]}
    terrain: {spacing_m: 0.5}
    horizon: {reach_m: 0}
    rocks:
      library: {shapes: 2, seed: 7}
      populations:
        - {name: stones, size_frequency: {kind: golombek, k: 0.01}, diameter_m: [0.3, 0.5]}
        - {name: boulders, size_frequency: {kind: golombek, k: 0.002}, diameter_m: [0.6, 0.8]}
    paths:
      - name: there
        route: {kind: spline, points_m: [[-6, 0], [0, 0.3], [6, 0]]}
        speed_m_s: 1
    sensors:
      - {name: lidar, kind: lidar, horizontal_samples: 90}
      - {name: wheels, kind: odometry}
    dataset: {still_s: 0.5, ramp_s: 0.5}
    exports: []
"""
STUDY = """
    recipe: plain.yaml
    set: {sun.azimuth_deg: 100}
    study:
      sensors.wheels.slip: [0.0, 0.2]
      rocks.k: [0.01, 0.03]
      seeds: 2
    systems: [wheel-odometry]
    score: {drift_over_m: 4}
"""


@pytest.fixture
def written(tmp_path):
    """Writes the recipe, and a study with some changes; returns the study's file."""

    def write(*changes, text=STUDY):
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "plain.yaml").write_text(textwrap.dedent(RECIPE))
        (tmp_path / "slip.yaml").write_text(textwrap.dedent(text))
        return tmp_path / "slip.yaml"

    return write


def test_keys_name_elements_and_what_is_below():
    plain = {
        "sun": {"azimuth_deg": 1},
        "sensors": [{"name": "lidar", "rate_hz": 10}, {"name": "eye", "noise": {"read_e": 6}}],
        "rocks": {"populations": [{"name": "a", "law": {"k": 1}}, {"name": "b", "law": {"k": 2}}]},
    }

    def places(key):
        return [".".join(map(str, place)) for place in places_of(plain, tuple(key.split(".")))]

    assert places("sun.azimuth_deg") == ["sun.azimuth_deg"]
    assert places("sun.elevation_deg") == ["sun.elevation_deg"]  # not there yet
    assert places("sensors.lidar.noise_m") == ["sensors.0.noise_m"]
    assert places("sensors.1.noise.read_e") == ["sensors.1.noise.read_e"]
    assert places("rocks.k") == ["rocks.populations.0.law.k", "rocks.populations.1.law.k"]
    assert places("rocks.b.k") == ["rocks.populations.1.law.k"]
    assert places("rocks.a.buried") == ["rocks.populations.0.buried"]
    assert places("dataset.still_s") == ["dataset.still_s"]


def test_all_levels_with_all_others_or_one_factor_at_a_time(written):
    study = study_of(read_study(written()))
    assert len(study.cells) == 2 * 2 * 2
    recipes = [cell.recipe.recipe for cell in study.cells]
    assert {recipe.seed for recipe in recipes} == {7, 8}
    assert {recipe.sun.azimuth_deg for recipe in recipes} == {100.0}
    covers = {tuple(p.size_frequency.k for p in recipe.rocks.populations) for recipe in recipes}
    assert covers == {(0.01, 0.01), (0.03, 0.03)}
    assert len({cell.digest for cell in study.cells}) == 8
    each = study_of(read_study(written(("study:", "design: each\n    study:"))))
    assert len(each.cells) == 3 * 2
    assert {cell.digest for cell in each.cells} < {cell.digest for cell in study.cells}


def test_recipes_are_a_factor_and_levels_may_set_several_keys(written, tmp_path):
    file = written(
        ("recipe: plain.yaml", "recipes: [plain.yaml, other.yaml]"),
        (
            "sensors.wheels.slip: [0.0, 0.2]",
            "wheels: {calm: {}, rough: {sensors.wheels.slip: 0.3, record.to_s: 4}}",
        ),
        ("rocks.k: [0.01, 0.03]", ""),
    )
    text = (tmp_path / "plain.yaml").read_text().replace("seed: 7", "seed: 70")
    (tmp_path / "other.yaml").write_text(text)
    study = study_of(read_study(file))
    assert [factor.name for factor in study.factors] == ["recipe", "wheels"]
    assert {cell.seed for cell in study.cells} == {7, 8, 70, 71}
    rough = [cell for cell in study.cells if dict(cell.levels)["wheels"] == "rough"]
    assert {cell.job["record"]["to_s"] for cell in rough} == {4}
    assert {cell.recipe.recipe.sensors[1].slip for cell in rough} == {0.3}


def test_recipes_are_compared_by_worlds_of_the_same_seed(written, tmp_path):
    file = written(
        ("recipe: plain.yaml", "recipes: [plain.yaml, other.yaml]"), ("seeds: 2", "seeds: [5, 6]")
    )
    shutil.copy(tmp_path / "plain.yaml", tmp_path / "other.yaml")
    study = study_of(read_study(file))
    results = [
        _result(cell.seed * (3.0 if "other" in dict(cell.levels)["recipe"] else 1.0))
        for cell in study.cells
    ]
    outcomes = outcomes_of(study, results)
    other = next(
        one for one in effects_of(study, outcomes)
        if one.factor == "recipe" and "other" in one.level and one.measure == "ATE"
    )  # fmt: skip
    np.testing.assert_allclose(other.ratios, [3.0] * 8)


def test_a_rig_that_the_rover_brings_has_factors_too(written, tmp_path):
    file = written(
        ("sensors.wheels.slip: [0.0, 0.2]", "sensors.lidar.preset: [vlp-16, os1-64]"),
        ("systems: [wheel-odometry]", "systems: [kiss-icp]"),
        ("seeds: 2", "seeds: [5]"),
        ("rocks.k: [0.01, 0.03]", ""),
    )
    text = (tmp_path / "plain.yaml").read_text()
    (tmp_path / "plain.yaml").write_text(re.sub(r"sensors:\n.*\n.*\n", "", text))
    first, second = study_of(read_study(file)).cells
    lidars = [cell.recipe.recipe.sensors[1] for cell in (first, second)]
    assert [len(lidar.elevations_deg) for lidar in lidars] == [16, 64]
    assert {lidar.position_m for lidar in lidars} == {(0.288, 0.0, 0.88)}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("rocks.k", "rocks.cover"), r"slip.yaml:6: rocks.cover: .* unknown key 'cover'"),
        (("rocks.k", "exports.mjcf.horizon"), r"slip.yaml:6: exports.mjcf.horizon: must not dif"),
        (("sensors.wheels.slip", "sensors.wheel.slip"), r":5: sensors.wheel.slip: plain.yaml: "),
        (("[0.01, 0.03]", "[0.01, -3]"), r":6: rocks.k: .* than or equal to 0\.0+1, found -3"),
        (("[0.01, 0.03]", "0.03"), r":6: rocks.k: must be a list of values, or a mapping"),
        (("[0.01, 0.03]", "[0.01, 0.01]"), r":6: rocks.k: 0.01 is there twice"),
        (("[0.01, 0.03]", "{a: 1}"), r":6: rocks.k: level 'a' must be a mapping"),
        (("seeds: 2", "seeds: 0"), r":7: seeds: must be how many worlds of each"),
        (("seeds: 2", "seeds: [1, 1]"), r":7: seeds: .*found \[1, 1\]"),
        (("wheel-odometry", "wheel-odometer"), r":8: systems: unknown system .*did you mean"),
        (("recipe: plain.yaml", "recipe: none.yaml"), r"slip.yaml:2: no such file: .*none.yaml"),
        (("recipe: plain.yaml", "recipes: [plain.yaml, x.yaml]"), r"slip.yaml:2: no such .*x.yaml"),
        (("recipe: plain.yaml", "recipes: []"), r"a study has a `recipe`, or a list of `recipes`"),
        (
            ("seeds: 2", "seeds: 2\n    record: {from_s: 5, to_s: 5}"),
            r"slip.yaml:8: record.to_s: 5 s, must be after from_s, 5 s",
        ),
        (("score:", "scores:"), r"slip.yaml:9: scores: unknown key.*did you mean 'score'"),
        (("set: {sun.azimuth_deg: 100}", "set: {sun.azimuth: 100}"), r":3: set: .*'azimuth'"),
    ],
)
def test_what_is_wrong_is_told_by_file_and_line(written, change, told):
    with pytest.raises(RecipeError, match=told):
        study_of(read_study(written(change)))


def test_a_cell_that_would_come_out_otherwise_has_another_name(written, tmp_path):
    def digests(*changes):
        return {cell.digest for cell in study_of(read_study(written(*changes))).cells}

    first = digests()
    assert digests(("set:", "about: Slip.\n    set:")) == first
    assert digests(("study:\n", "keep: true\n    study:\n")) == first
    assert digests(("drift_over_m: 4", "drift_over_m: 5")).isdisjoint(first)
    assert digests(("systems:", "record: {to_s: 3}\n    systems:")).isdisjoint(first)


def _result(ate):
    spread = {"rms": ate, "median": ate, "mean": ate, "most": ate, "count": 3}
    score = {"length_m": 12.0, "tracked": 1.0, "ate_m": spread, "drift": spread, "rpe_m": None}
    run_ = {"system": "wheel-odometry", "status": "done", "why": "", "score": score}
    return {"status": "done", "why": "", "results": [run_]}


def test_effects_compare_worlds_that_are_alike_else(written, tmp_path):
    study = study_of(read_study(written()))
    known = {("0.0", 7): 0.1, ("0.0", 8): 0.4, ("0.2", 7): 0.3, ("0.2", 8): 0.8}
    results = []
    for cell in study.cells:
        levels = dict(cell.levels)
        slip = f"{float(levels['sensors.wheels.slip']):.1f}"
        ate = known[slip, cell.seed] * (10.0 if levels["rocks.k"] == "0.03" else 1.0)
        results.append(_result(ate))
    results[0] = {"status": "failed", "why": "no path", "results": []}  # slip 0, k 0.01, seed 7
    outcomes = outcomes_of(study, results)
    assert [one.status for one in outcomes[:2]] == ["failed", "done"]
    effects = [one for one in effects_of(study, outcomes) if one.measure == "ATE"]
    slip = next(e for e in effects if e.factor == "sensors.wheels.slip" and e.level == "0.2")
    assert (len(slip.values), slip.cells) == (4, 4)
    np.testing.assert_allclose(sorted(slip.ratios), [2.0, 2.0, 3.0])
    cover = next(e for e in effects if e.factor == "rocks.k" and e.level == "0.03")
    np.testing.assert_allclose(cover.ratios, [10.0] * 3)
    first = effect_rows(effects)[1]
    assert first[:5] == ["sensors.wheels.slip", "0", "wheel-odometry", "ATE [m]", "3 of 4"]
    tracked = [one for one in effects_of(study, outcomes) if one.measure == "tracked"]
    assert {value for one in tracked for value in one.values} == {100.0}
    lost = {"status": "lost", "why": "", "score": None, "system": "wheel-odometry"}
    results[1] = {"status": "done", "why": "", "results": [lost]}
    tracked = [
        one for one in effects_of(study, outcomes_of(study, results)) if one.measure == "tracked"
    ]
    assert sorted(tracked[0].values) == [0.0, 100.0, 100.0]  # that of no world tells nothing
    assert effect_rows(tracked, "tracked")[1][3:6] == ["tracked [%]", "3 of 4", "100"]
    write_tables(study, outcomes, tmp_path)
    with (tmp_path / "cells.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8
    assert rows[0]["result"] == "failed: no path"
    assert r"\begin{tabular}" in (tmp_path / "effects.tex").read_text()


def test_a_cell_is_made_recorded_and_evaluated(written, tmp_path):
    study = study_of(read_study(written()))
    cell = study.cells[-1]
    found = carry_out({**cell.job, "workers": 1}, tmp_path / "cell")
    assert found["status"] == "done", found["why"]
    (only,) = found["results"]
    assert only["score"]["length_m"] > 10.0
    assert only["score"]["drift"]["median"] > 0.1  # a fifth of the wheels' way is lost
    assert (tmp_path / "cell/slam/wheel-odometry_1/errors.csv").is_file()
    assert not (tmp_path / "cell/dataset/mav0/lidar0").exists()  # no system needs it
    wrong = {**cell.job, "workers": 1, "changes": ["paths.0.speed_m_s=-1"]}
    assert carry_out(wrong, tmp_path / "no")["status"] == "failed"


ONE = ("slip: [0.0, 0.2]", "slip: [0.0]"), ("[0.01, 0.03]", "[0.01]"), ("seeds: 2", "seeds: 1")
MINE = """
    about: fails until it is mended
    input: euroc
    command: "{python} PROGRAM {output}"
    output: "{output}"
    format: tum
    frame: base_link
    needs: [NEED]
"""


@pytest.mark.parametrize(
    ("need", "statuses"),
    [
        ("odometry", ["failed", "lost", "lost"]),
        pytest.param("stereo", ["failed"] * 2, marks=pytest.mark.slow),
    ],
)
def test_a_system_that_failed_is_run_again_unless_it_lacks_sensors(
    written, tmp_path, monkeypatch, need, statuses
):
    monkeypatch.setattr(running_file, "require_served", lambda _: None)  # another rover has them
    program, out = tmp_path / "mine.py", tmp_path / "out"
    text = MINE.replace("PROGRAM", str(program)).replace("NEED", need)
    (tmp_path / "mine.yaml").write_text(textwrap.dedent(text))
    file = written(("[wheel-odometry]", "[mine.yaml]\n    trust: true"), *ONE)
    found, times = [], []
    for ending in ("exit(3)", "", "")[: len(statuses)]:
        program.write_text(ending)
        run_study(file, out, jobs=1)
        (result,) = out.glob("cells/*/result.json")
        found += [row["status"] for row in json.loads(result.read_text())["results"]]
        times.append(result.stat().st_mtime_ns)
    assert found == statuses
    assert times[-1] == times[-2]


def test_what_ended_a_cell_is_told_beside_what_it_did_last(written, tmp_path):
    program, out = tmp_path / "mine.py", tmp_path / "out"
    program.write_text(
        "import os, signal\n"
        "launcher = open(f'/proc/{os.getppid()}/stat').read()\n"
        "os.kill(int(launcher.rpartition(')')[2].split()[1]), signal.SIGKILL)\n"
    )
    text = MINE.replace("PROGRAM", str(program)).replace("NEED", "odometry")
    (tmp_path / "mine.yaml").write_text(textwrap.dedent(text))
    run_study(written(("[wheel-odometry]", "[mine.yaml]\n    trust: true"), *ONE), out, jobs=1)
    (result,) = out.glob("cells/*/result.json")
    told = json.loads(result.read_text())
    assert (told["status"], told["results"]) == ("failed", [])
    assert told["why"] == "its process ended with signal 9: run mine"


def test_a_disk_that_is_too_small_is_refused_before_anything_is_made(
    written, tmp_path, monkeypatch
):
    monkeypatch.setattr(running_file, "SPARE", 2**60)
    with pytest.raises(StorageError, match=r"1 recordings at once need about .* record less by"):
        run_study(written(), tmp_path / "out", jobs=1)
    assert not (tmp_path / "out").exists()


def test_a_folder_of_others_is_left_alone(written, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds no study"):
        run_study(written(), tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("name", ["", "slam", "dataset"])
def test_cells_are_not_written_behind_a_link(written, tmp_path, name):
    study = study_of(read_study(written()))
    (home := tmp_path / "home").mkdir()
    place = tmp_path / "out/cells" / study.cells[0].digest / name
    place.parent.mkdir(parents=True)
    place.symlink_to(home)
    (tmp_path / "out/study.json").write_text('{"study": "slip"}')
    with pytest.raises(OutputError, match=f"{place} is a link"):
        run_study(written(), tmp_path / "out", jobs=1)
    assert not list(home.iterdir())


def test_the_list_tells_worlds_and_costs(written):
    done = run("study", written(), "--list")
    assert done.returncode == 0, done.stderr
    assert "rocks.k 0.03, seed 8: 14 s, 0 measurements" in done.stdout
    assert re.search("8 worlds, [0-9]+ min of recording, 8 runs of systems beside", done.stdout)


@pytest.mark.usefixtures("few_shapes")
@pytest.mark.parametrize("name", ["loam_on_short", "sun_and_flare", "suspension"])
def test_studies_that_ship_are_known_by_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert name in run("study", "--help").stdout
    study = study_of(read_study(name))
    assert len(study.factors) in (1, 3, 4)
    assert costs_of(study.cells[:1])[0].recording is not None


@pytest.mark.parametrize(
    ("was", "now", "line", "why"),
    [
        ("seeds: 2", "sun: {a: {}, b: {sensors.1.slip: 0.2}}", 7,
         "'sun' and 'sensors.wheels.slip' set sensors.1.slip and sensors.wheels.slip"),
        ("seeds: 2", "rocks.stones.k: [0.1, 0.2]", 7,
         "'rocks.stones.k' and 'rocks.k' set rocks.stones.k and rocks.k"),
        ("seeds: 2", "sun: {a: {sun.elevation_deg: 5}}\n      sun.elevation_deg: [1, 2]", 8,
         "'sun.elevation_deg' and 'sun' both set sun.elevation_deg"),
        ("seeds: 2", "sun.elevation_deg: [1, 2]\n      low: {a: {sun.elevation_deg: 3}, b: {}}", 8,
         "'low' and 'sun.elevation_deg' both set sun.elevation_deg"),
        ("seeds: 2", "sun.azimuth_deg: [1, 2]", 7, "'sun.azimuth_deg' and 'set' both set sun.azi"),
        ("seeds: 2", "sun: [{azimuth_deg: 1}]", 7, "'sun' and 'set' set sun and sun.azimuth_deg"),
        ("seeds: 2", "seeds: 2\n      seed: [1, 2]", 8, "'seed' and 'seeds' both set seed"),
        ("seeds: 2", "record.to_s: [1, 2]\n      a: {b: {record.to_s: 4}}", 8,
         "'a' and 'record.to_s' both set record.to_s"),
        ("seeds: 2", "sun.elevation_deg: [1]\n      a: {b: {sun.elevation_deg: 1}}", 0, ""),
    ],
)  # fmt: skip
def test_what_two_would_set_is_refused(was, now, line, why, written):
    """By any names of the place, and where one is a part of the other."""
    done = run("study", written((was, now)), "--list")
    assert (done.returncode, len(done.complaints)) == ((2, 1) if why else (0, 0))
    if why:
        assert f"slip.yaml:{line}: " in done.complaints[0]
        assert why in done.complaints[0]
        assert done.complaints[0].endswith(", of which one would win: leave it to one of them")


@pytest.mark.parametrize(
    ("was", "now", "line"),
    [
        ("systems:", "record: {only: [whels]}\n    systems:", 8),
        ("seeds: 2", "part: {all: {}, one: {record.only: [lidar, whels]}}", 7),
    ],
)
def test_a_sensor_that_is_not_there_is_refused_before_any_work(was, now, line, written, tmp_path):
    for more in (["--list"], ["-o", tmp_path / "out"]):
        done = run("study", written((was, now)), *more)
        assert (done.returncode, len(done.complaints)) == (2, 1)
        why = f"slip.yaml:{line}: record.only: whels: no sensor that is recorded is called so"
        assert f"{why} (did you mean 'wheels'?)" in done.complaints[0]
    assert not (tmp_path / "out").exists()


def test_a_key_within_what_set_gives_may_be_a_factor(written):
    """The rig of all cells and one of its figures, which the rig leaves open."""
    rig = "{name: wheels, kind: odometry}, {name: lidar, kind: lidar, horizontal_samples: 90}"
    file = written(
        ("set: {sun.azimuth_deg: 100}", f"set: {{sensors: [{rig}]}}"),
        ("sensors.wheels.slip", "sensors.0.slip"),
    )
    assert len(study_of(read_study(file)).cells) == 8


def test_a_system_without_its_sensors_is_refused_before_any_work(written, tmp_path):
    path = written(("systems: [wheel-odometry]", "systems: [wheel-odometry, imu]"))
    for words in (("study", path, "--list"), ("study", path, "-o", tmp_path / "out")):
        done = run(*words)
        assert done.returncode == 2
        assert "imu needs imu, which no rover of the study carries" in done.complaints[-1]
    assert not (tmp_path / "out").exists()


def test_an_interrupt_over_the_tables_says_what_is_there(written, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(whole_file, "run_cells", lambda *_, **__: [])
    monkeypatch.setattr(whole_file, "outcomes_of", interrupt)
    with pytest.raises(KeyboardInterrupt, match=r"^0 of 8 cells are in .*goes on from there$"):
        run_study(written(), tmp_path / "out")


@pytest.mark.slow
def test_killed_it_goes_on_and_finds_the_same(written, tmp_path):
    file, out = written(("seeds: 2", "seeds: 1")), tmp_path / "out"
    words = [
        sys.executable,
        "-m",
        "terrain_forge",
        "study",
        str(file),
        "-o",
        str(out),
        "--jobs",
        "1",
    ]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    while len(list(out.glob("cells/*/result.json"))) < 2:
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    time.sleep(1.0)
    here = str(out).encode()
    running = [p for p in Path("/proc").glob("[0-9]*/cmdline") if here in _content(p)]
    assert running == []  # what it had started ended with it
    done = {p: p.stat().st_mtime_ns for p in out.glob("cells/*/result.json")}
    result = run_study(file, out, jobs=2)
    assert {p: p.stat().st_mtime_ns for p in done} == done
    assert all(one.runs == 1 for one in result.outcomes)
    assert list(out.glob("cells/*/dataset")) == []
    whole = run_study(file, tmp_path / "whole", jobs=2)
    figures = [[one.figures for one in found.outcomes] for found in (result, whole)]
    assert figures[0] == figures[1]
    assert json.loads((out / "study.json").read_text())["study"] == "slip"
    assert "<h1>slip</h1>" in (out / "study.html").read_text()
    assert (out / "effect_2.png").is_file()
    assert len(list((out / "cells").iterdir())) == 4


def _content(path):
    try:
        return path.read_bytes()
    except OSError:
        return b""


PROGRAM = "command: touch ran\n"


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (("[wheel-odometry]", "[wheel-odometry, mine.yaml]"), "systems: mine.yaml"),
        (("[wheel-odometry]", "[a-loam]\n    binaries: {a-loam: ./run.sh}"), "binaries: ./run.sh"),
    ],
)
def test_programs_that_a_study_brings_run_by_an_explicit_word(written, tmp_path, change, key):
    (tmp_path / "mine.yaml").write_text(PROGRAM)
    with pytest.raises(RecipeError, match=rf"slip.yaml:\d+: {key} would run a program"):
        read_study(written(change))
    assert read_study(written(change), trust=True).systems
    assert read_study(written(change, ("score:", "trust: true\n    score:"))).systems
    assert run("study", written(change), "--list").returncode == 2
    assert "worlds" in run("study", written(change), "--list", "--trust").stdout


def test_a_program_that_is_not_there_is_told_before_worlds_are_made(written):
    change = ("[wheel-odometry]", "[a-loam]\n    binaries: {a-loam: /no/ws}")
    with pytest.raises(RecipeError, match="systems: a-loam: no such program: /no/ws"):
        read_study(written(change), trust=True)


def test_studies_that_ship_bring_none():
    for name in shipped_studies():
        assert read_study(name).systems


def test_what_serves_a_need_is_recorded(written, tmp_path):
    """Two cameras where no stereo is, and for depth those alone that record it."""
    (tmp_path / "eyes.yaml").write_text("command: x\nneeds: [stereo]\n")
    (tmp_path / "deep.yaml").write_text("command: x\nneeds: [rgbd]\n")

    def chosen(system, sensors):
        change = ("systems: [wheel-odometry]", f"systems: [{system}.yaml]")
        (cell, *_) = study_of(read_study(written(change), trust=True)).cells
        return sensors_for(cell.job, sensors), lacking(cell.job, sensors)

    one, other = (model.CameraSensor(name=name) for name in ("one", "other"))
    pair, deep = (
        model.StereoSensor(name="pair"),
        model.CameraSensor(name="deep", channels=("depth",)),
    )
    assert chosen("eyes", (one, other)) == (("one", "other"), {})
    assert chosen("eyes", (one, pair)) == (("pair",), {})
    assert chosen("eyes", (one,)) == ((), {"eyes": ["stereo"]})
    assert chosen("deep", (one, deep)) == (("deep",), {})
    assert chosen("deep", (one, pair)) == ((), {"deep": ["rgbd"]})
