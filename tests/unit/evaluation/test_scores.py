"""Scores of trajectories against closed forms and evo."""

from __future__ import annotations

import csv
import json
import math
import os

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from terrain_forge.base import DataError
from terrain_forge.evaluation import (
    Run,
    ScoreOptions,
    TimedPoses,
    aligned,
    associate,
    latex_table,
    read_poses,
    score_poses,
)
from terrain_forge.evaluation.files import score_files
from terrain_forge.evaluation.results import Result, result_lines, result_rows
from terrain_forge.evaluation.tables import write_table
from tests.helpers.command_line import run


def _yaw(angle):
    return Rotation.from_rotvec(np.stack([0 * angle, 0 * angle, angle], axis=-1))


def _circle(radius=10.0, *, turns=2.0, count=2400, rate=10.0) -> TimedPoses:
    angle = np.linspace(0.0, 2 * np.pi * turns, count)
    place = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=-1)
    turn = _yaw(angle + 0.5 * np.pi)
    return _poses(np.arange(count) / rate, place, turn)


def _poses(time, place, turn, name="ours"):
    quaternion = np.roll(turn.as_quat(), 1, axis=-1)
    return TimedPoses(name=name, time=time, position=place, quaternion=quaternion)


def _turned(poses, turn, shift, scale=1.0):
    rotation = turn * Rotation.from_quat(np.roll(poses.quaternion, -1, axis=-1))
    return _poses(poses.time, scale * turn.apply(poses.position.copy()) + shift, rotation)


TURN = Rotation.from_euler("xyz", [0.3, -0.2, 1.1])


@pytest.mark.parametrize("part", ["first_third", "all", "origin"])
def test_truth_turned_and_shifted_scores_nothing(part):
    truth = _circle()
    found = score_poses(truth, _turned(truth, TURN, [5, 6, 7]), ScoreOptions(align=part))
    assert found.ate.most < 1e-9
    assert found.drift.most < 1e-9
    assert found.rpe.most < 1e-9
    assert found.rpe_angle.most < 1e-6
    assert found.tracked == pytest.approx(1.0)
    assert found.length == pytest.approx(40 * np.pi, rel=1e-4)


def test_a_shift_is_the_error_without_alignment():
    truth = _circle()
    found = score_poses(
        truth, _turned(truth, Rotation.identity(), [3, 4, 0]), ScoreOptions(align="none")
    )
    assert found.ate.rms == pytest.approx(5.0)
    assert found.rpe.most < 1e-9


@pytest.mark.parametrize("stations", [0.0, 0.5])
def test_an_error_of_scale_is_the_drift(stations):
    truth = _circle()
    told = _turned(truth, TURN, [1, 2, 3], scale=1.03)
    found = score_poses(truth, told, ScoreOptions(stations_m=stations))
    assert found.drift.median == pytest.approx(0.03, rel=1e-9)
    assert found.drift.rms == pytest.approx(0.03, rel=1e-9)
    # All of it is found by an alignment with scale; without, rms = (s - 1) r about the middle.
    plain = score_poses(truth, told, ScoreOptions(align="all"))
    assert plain.ate.rms == pytest.approx(0.3, rel=2e-3)
    scaled = score_poses(truth, told, ScoreOptions(align="all", scale=True))
    assert scaled.scale == pytest.approx(1 / 1.03)
    assert scaled.ate.most < 1e-9


def test_a_constant_drift_of_the_heading():
    """Straight on, the estimate turns by k per metre: it drives a circle of radius 1/k."""
    count, k = 4000, 0.01
    s = np.linspace(0.0, 100.0, count)
    truth = _poses(s, np.stack([s, 0 * s, 0 * s], axis=-1), _yaw(0 * s))
    place = np.stack([np.sin(k * s) / k, (1 - np.cos(k * s)) / k, 0 * s], axis=-1)
    found = score_poses(truth, _poses(s, place, _yaw(k * s)))
    assert found.yaw_drift.median == pytest.approx(k * 10.0, rel=1e-2)
    assert found.rpe_angle.median == pytest.approx(k * 10.0, rel=1e-2)
    arc = 10.0 * k  # chord of the arc against the straight line
    chord = math.hypot(math.sin(arc) / k - 10.0, (1 - math.cos(arc)) / k)
    assert found.rpe.median == pytest.approx(chord, rel=2e-2)
    assert found.drift.most < 1e-4


def test_jitter_inflates_the_path_at_full_rate_but_not_between_stations():
    truth = _circle(count=9600, rate=40.0)
    noise = np.random.default_rng(1).normal(scale=0.01, size=truth.position.shape)
    told = truth.replace(position=truth.position + noise)
    raw = score_poses(truth, told, ScoreOptions(stations_m=0.0))
    stations = score_poses(truth, told)
    assert raw.drift.median > 0.2
    assert stations.drift.median < 0.01


def test_stations_without_number_are_refused():
    truth = _circle()
    for options, told in (
        (ScoreOptions(stations_m=1e-9), "drift_over_m 10 with stations each 1e-09 m on a path"),
        (ScoreOptions(drift_over_m=1e-9), "drift_over_m 1e-09 with stations each 1e-09 m on"),
    ):
        with pytest.raises(DataError, match=told):
            score_poses(truth, truth, options)


def test_thirds_are_counted_by_index_time_or_length():
    time = np.arange(300.0)
    x = np.where(time < 100, 0.0, time - 100)
    truth = _poses(time, np.stack([x, 0 * x, 0 * x], -1), _yaw(0 * x))
    told = truth.replace(position=truth.position + np.stack([0 * x, (x > 1) * 1.0, 0 * x], -1))
    by_time = score_poses(truth, told, ScoreOptions(third_by="time"))
    by_length = score_poses(truth, told, ScoreOptions(third_by="length"))
    assert by_time.ate.median == pytest.approx(1.0, abs=1e-6)  # nothing had happened yet
    assert by_length.ate.median < 1.0


def test_a_lost_system_tells_its_share():
    truth = _circle(count=1000)
    kept = np.r_[0:300, 600:1000]
    found = score_poses(truth, truth.select(kept))
    assert found.tracked == pytest.approx(1 - 30.1 / 99.9, abs=0.003)
    assert found.poses == 700


@pytest.mark.parametrize("stations", [0.0, 0.5])
def test_pieces_with_a_gap_are_not_scored(stations):
    """Each piece that is scored is as wrong as the rest, and none is a line across the gap."""
    truth = _circle(count=2400)
    told = _turned(truth, Rotation.identity(), [0, 0, 0], scale=1.02)
    options = ScoreOptions(stations_m=stations)
    whole = score_poses(truth, told, options)
    kept = np.r_[0:800, 1200:2400]  # a turn of 120 degrees is missing, 21 m of it
    found = score_poses(truth, told.select(kept), options)
    assert found.drift.most == pytest.approx(0.02, rel=1e-6)
    assert found.rpe.rms == pytest.approx(whole.rpe.rms, rel=1e-3)
    lost = 20.9 + 10.0  # pieces begin there that lie in it, or end after its begin
    left_out = whole.drift.count - found.drift.count
    share = left_out / whole.drift.count
    assert share == pytest.approx(lost / (whole.length - 10.0), rel=0.02)
    assert whole.rpe.count - found.rpe.count == pytest.approx(left_out, rel=0.04)
    assert found.rpe.count == found.yaw_drift.count
    patient = ScoreOptions(stations_m=stations, gap_s=41.0)
    assert score_poses(truth, told.select(kept), patient).drift.count > found.drift.count


def test_kittis_pieces_have_no_gap_either():
    s = np.linspace(0.0, 250.0, 2501)
    truth = _poses(s, np.stack([s, 0 * s, 0 * s], axis=-1), _yaw(0 * s))
    told = truth.replace(position=truth.position + 0.1 * (s[:, None] > 125.0))
    late = told.select(np.r_[0:1200, 1300:2501])
    assert score_poses(truth, told).kitti[0] > 1e-4
    assert score_poses(truth, late).kitti[0] == pytest.approx(0.0, abs=1e-12)
    assert score_poses(truth, told.select(np.r_[0:900, 920:1800, 1900:2501])).kitti is None


def test_a_system_that_was_lost_in_each_piece_has_no_drift():
    truth = _circle(count=240, rate=1.0)
    scored = score_poses(truth, truth, ScoreOptions(gap_s=0.5))
    assert scored.drift is scored.rpe is scored.yaw_drift is None
    assert scored.note == "no TDr: no 10 m of the path are without a gap longer than gap_s, 0.5 s"


@pytest.mark.parametrize("begin", [0.0, 0.1, 0.3, 5.7, 1.7e9])
def test_poses_just_as_far_apart_as_the_gap_are_no_gap(begin):
    """Whatever the last bit of their times."""
    truth = _circle(count=240, rate=1.0)
    truth = truth.replace(time=truth.time + begin)
    scored = score_poses(truth, truth)
    assert scored.tracked == pytest.approx(1.0)
    assert scored.drift.count == score_poses(truth, truth, ScoreOptions(gap_s=50.0)).drift.count


def test_a_sparse_truth_is_no_gap_of_the_system():
    told = _circle(count=2400)
    truth = told.select(np.arange(0, 2400, 30))  # each 3 s
    assert score_poses(truth, told).drift.count > 50
    lost = truth.select(np.r_[0:20, 40:80])
    assert score_poses(lost, told).drift.count < score_poses(truth, told).drift.count


def test_a_gap_of_the_truth_is_no_loss_of_the_system():
    """Of a recording of two parts; what is told in between is not asked for, what lacks is."""
    whole = _circle()
    kept = np.flatnonzero((whole.time < 60.0) | (whole.time >= 180.0))
    truth = whole.select(kept)
    assert score_poses(truth, truth).tracked == 1.0
    assert score_poses(truth, whole).tracked == 1.0
    late = whole.select(np.flatnonzero(whole.time >= 60.0))
    assert score_poses(truth, late).tracked == pytest.approx(0.5, abs=0.002)


def test_truth_is_not_interpolated_across_its_gaps():
    truth = _circle(count=2400)
    told = truth.replace(time=truth.time + 0.05)
    gap = truth.select(np.r_[0:800, 1200:2400])
    options = ScoreOptions(association="interpolated", align="none")
    found = score_poses(gap, told, options)
    assert found.poses == score_poses(truth, told, options).poses - 401
    assert found.ate.most == pytest.approx(score_poses(truth, told, options).ate.most, rel=1e-6)
    patient = ScoreOptions(association="interpolated", align="none", gap_s=50.0)
    assert score_poses(gap, told, patient).ate.most > 1.0
    with pytest.raises(DataError, match=r"found 0: .*, and gap_s is 0\.05 s"):
        score_poses(truth, told, ScoreOptions(association="interpolated", gap_s=0.05))
    at_its_poses, _ = associate(truth, truth, association="interpolated", gap=0.05)
    assert len(at_its_poses.time) == 2400


def test_a_delay_of_a_tenth_of_a_second_is_a_shift_along_the_path():
    truth = _circle(radius=1000.0, turns=0.01, count=2000, rate=20.0)
    speed = 1000.0 * 0.01 * 2 * np.pi / truth.time[-1]
    told = truth.replace(time=truth.time + 0.1)
    found = score_poses(truth, told, ScoreOptions(align="none", association="interpolated"))
    assert found.ate.median == pytest.approx(0.1 * speed, rel=1e-2)


def test_a_sensor_on_the_rover_is_compared_with_its_own_truth():
    truth = _circle()
    arm, turn = np.array([0.3, 0.0, 0.8]), Rotation.from_euler("y", 0.2).as_matrix()
    camera = truth.moved(arm, turn)
    back = camera.moved(-turn.T @ arm, turn.T)
    assert back.position == pytest.approx(truth.position, abs=1e-12)
    assert score_poses(camera, camera).ate.most < 1e-12
    assert score_poses(truth, camera).ate.rms > 1e-3


def test_errors_equal_those_of_evo(tmp_path):
    """Alignment over the first N poses and all of APE and RPE, to the ninth digit."""
    pytest.importorskip("evo", reason="evo is not installed (extra `oracle`)")
    from evo.core import metrics
    from evo.core.trajectory import PoseTrajectory3D

    truth = _circle(count=500)
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(scale=0.01, size=truth.position.shape), axis=0)
    told = _turned(truth, TURN, [1, 2, 3])
    told = told.replace(position=told.position + walk)
    ours = score_poses(truth, told, ScoreOptions(third_by="index", stations_m=0))
    theirs = [
        PoseTrajectory3D(
            positions_xyz=p.position.copy(),
            orientations_quat_wxyz=p.quaternion.copy(),
            timestamps=p.time.copy(),
        )
        for p in (truth, told)
    ]
    theirs[1].align(theirs[0], n=500 // 3)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(theirs)
    assert ours.ate.rms == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), abs=1e-9)
    assert ours.errors == pytest.approx(ape.error, abs=1e-9)
    for relation, mine in (
        (metrics.PoseRelation.translation_part, ours.rpe),
        (metrics.PoseRelation.rotation_angle_rad, ours.rpe_angle),
    ):
        rpe = metrics.RPE(
            relation, 10.0, metrics.Unit.meters, all_pairs=True, pairs_from_reference=True
        )
        rpe.process_data(theirs)
        assert mine.count == len(rpe.error)
        assert mine.rms == pytest.approx(rpe.get_statistic(metrics.StatisticsType.rmse), abs=1e-7)


def test_of_all_poses_motions_over_the_length_nearest_to_the_wanted_one_count():
    """As evo's `all_pairs`: within a tenth of it; of a stop the first pose."""
    stations = [0.0, 3.0, 7.0, 7.0, 9.2, 14.0, 23.5]
    at = np.array([[x, 0.0, 0.0] for x in stations])
    truth = TimedPoses(
        name="truth", time=np.arange(7.0), position=at, quaternion=np.tile([1.0, 0, 0, 0], (7, 1))
    )
    off = np.array([0.0, 0.001, 0.01, 0.1, 1.0, 10.0, 100.0])
    told = truth.replace(position=at + off[:, None] * [0, 0, 1])
    found = score_poses(truth, told, ScoreOptions(align="none", stations_m=0))
    # 0 to 9.2, 3 to 14 (11 is a tenth more), 14 to 23.5; 7 has nothing near, nor has 9.2
    assert found.rpe.count == 3
    assert found.rpe.most == pytest.approx(90.0)
    assert found.rpe.median == pytest.approx(9.999)


WRONG = {
    "1 2 3": ":1: 3 numbers, must be 8",
    "1 0 0 0 0 1 0 0 0 0 1 0": ":1: 12 numbers, must be 8 (KITTI's form needs --stamps)",
    "0 0 0 0 0 0 0 1\n1 0 0 x 0 0 0 1": ":2: '1 0 0 x 0 0 0 1', must be 8 numbers",
    "0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1": ":2: its time is not after the one before",
    "# t\n0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1": ":3: a value is not a finite number",
    "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 2": ":2: its quaternion is not of length one",
    "0 0 0 0 0 0 0 1": "a trajectory has at least 2 poses, found 1",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_file_is_told_by_line(tmp_path, text):
    path = tmp_path / "a.tum"
    path.write_text(text)
    with pytest.raises(DataError) as error:
        read_poses(path)
    assert WRONG[text] in str(error.value)
    assert str(path) in str(error.value)


def test_tum_and_euroc_are_read(tmp_path):
    tum, csv = tmp_path / "a.tum", tmp_path / "data.csv"
    tum.write_text("# time\n0 1 2 3 0 0 0.6 0.8\n1 1 2 3 0 0 0 1\n")
    csv.write_text("#timestamp,…\n0,1,2,3,0.8,0,0,0.6,9,9,9\n1000000000,1,2,3,1,0,0,0,9,9,9\n")
    one, other = read_poses(tum), read_poses(csv)
    assert one.replace(name="") == other.replace(name="")
    assert one.quaternion[0] == pytest.approx([0.8, 0, 0, 0.6])


def test_no_common_time_is_told():
    truth = _circle()
    later = truth.replace(time=truth.time + 1e4)
    with pytest.raises(
        DataError, match=r"found 0: .*, the truth from 0\.000 to 239\.900 s.* its own begin\?"
    ):
        score_poses(truth, later)
    assert aligned(truth, later, part="none")[0] is later
    with pytest.raises(DataError, match="stamps are in seconds; are some nanoseconds"):
        score_poses(truth, truth.replace(time=1e9 * truth.time))
    aside = truth.replace(time=truth.time + 0.04)
    with pytest.raises(DataError, match=r"found 0: .*, and most_apart_s is 0\.01 s$"):
        score_poses(truth, aside)
    with pytest.raises(DataError, match=r"at least 3 poses .* needed, found 2: "):
        score_poses(truth, aside.select(np.arange(2)), ScoreOptions(association="interpolated"))


def test_what_is_no_poses_is_refused():
    with pytest.raises(DataError, match=r"truth must be a TimedPoses, found .a.tum"):
        score_poses("a.tum", "b.tum")


@pytest.mark.parametrize("association", ["nearest", "interpolated"])
def test_no_poses_at_all_are_told(association):
    truth = _circle()
    none = truth.select(np.arange(0)).replace(name="mine")
    with pytest.raises(DataError, match="the truth has no poses"):
        associate(none, truth, association=association)
    with pytest.raises(DataError, match="mine has no poses"):
        associate(truth, none, association=association)


def _write_tum(path, poses):
    rows = np.column_stack([poses.time, poses.position, np.roll(poses.quaternion, -1, axis=-1)])
    np.savetxt(path, rows, fmt="%.9f")
    return path


def test_the_command_scores_files_and_goes_on_after_a_wrong_one(tmp_path):
    truth = _circle()
    files = [
        _write_tum(tmp_path / "gt.tum", truth),
        _write_tum(tmp_path / "good.tum", _turned(truth, TURN, [1, 2, 3])),
        _write_tum(tmp_path / "big.tum", _turned(truth, TURN, [1, 2, 3], scale=1.05)),
    ]
    (tmp_path / "bad.tum").write_text("1 2 3\n")
    out = tmp_path / "scores"
    done = run(
        *("evaluate", "--truth", files[0], "--estimate", files[1]),
        *("--estimate", tmp_path / "bad.tum", files[2]),
        *("--set", "align=all", "-o", out),
    )
    assert done.returncode == 2
    assert "bad.tum:1: 3 numbers, must be 8" in done.stderr
    head, good, big = done.stdout.splitlines()[:3]
    assert head.split()[0] == "trajectory"
    assert good.split()[:2] == ["good", "100"]
    assert "KITTI t [%]" in head
    assert big.split()[5] == "5"
    told = json.loads((out / "evaluation.json").read_text())
    assert [one["trajectory"] for one in told["scores"]] == ["good", "big"]
    assert told["scores"][0]["options"]["align"] == "all"
    assert told["scores"][1]["drift"]["median"] == pytest.approx(0.05, rel=1e-6)
    assert told["failed"][0]["trajectory"] == "bad"
    assert (out / "evaluation.csv").read_text().count("\n") == 3
    assert r"big & 100 &" in (out / "evaluation.tex").read_text()


def test_files_of_one_name_are_told_apart_by_their_paths(tmp_path):
    truth = _circle()
    (tmp_path / "a").mkdir()
    paths = [_write_tum(tmp_path / name, truth) for name in ("mine.tum", "a/mine.tum", "other.tum")]
    scores, failures = score_files(tmp_path / "mine.tum", paths)
    assert [one.name for one in scores] == [str(paths[0]), str(paths[1]), "other"]
    assert failures == []
    with pytest.raises(DataError, match=r"--estimate .*other\.tum: is given twice"):
        score_files(tmp_path / "mine.tum", [paths[2], paths[2]])


def test_a_place_that_cannot_be_written_is_told_before_the_scores(tmp_path) -> None:
    truth, file = _write_tum(tmp_path / "gt.tum", _circle()), tmp_path / "file"
    file.write_text("mine")
    asked = "evaluate", "--truth", truth, "--estimate", truth
    for out, status, told in (
        (file / "x", 3, f"{file}/x cannot be written: Not a directory"),
        ("/proc/x", 3, "/proc/x cannot be written: No such file or directory"),
        ("", 2, "--out is empty: name a file or folder (see terrain-forge evaluate --help)"),
    ):
        done = run(*asked, "-o", out)
        assert (done.returncode, done.stdout) == (status, "")
        assert done.stderr == f"terrain-forge: {told}\n"
    assert run(*asked[:-1], tmp_path / "none.tum", "-o", tmp_path / "new" / "out").returncode == 2


def test_names_are_written_as_latex_has_them():
    rows = latex_table([["a"], ["~x^\n2_"], ["[a]"], ["*<b|"]]).splitlines()[4:7]
    assert rows[0] == r"\textasciitilde{}x\textasciicircum{} 2\_ \\"
    assert rows[1:] == [r"{}[a] \\", r"{}*\textless{}b\textbar{} \\"]


def test_tables_are_not_written_over_files_that_are_there(tmp_path) -> None:
    mine = tmp_path / "maps.csv"
    mine.write_text("mine")
    asked = "evaluate", "--truth", tmp_path / "a.tum", "--estimate", tmp_path / "b.tum"
    done = run(*asked, "-o", tmp_path)
    assert done.returncode == 2
    assert "holds maps.csv; move them away" in done.stderr
    assert "a.tum" in run(*asked, "-o", tmp_path, "--force").stderr
    assert mine.read_text() == "mine"


def test_options_without_effect_are_refused(tmp_path):
    files = "--truth", tmp_path / "a.tum", "--estimate", tmp_path / "b.tum"
    for words, told in (
        ((*files, "--systems", "imu"), "--systems has no effect beside --truth and --estimate"),
        ((*files, "--runs", "1"), "--runs has no effect beside --truth and --estimate"),
        ((*files, "--map", "a.ply"), "--map has no effect beside --truth and --estimate"),
        ((tmp_path, "--stamps", "a.txt"), "--stamps has no effect without --estimate"),
        ((tmp_path, "--cell", "0.15"), "--cell has no effect without --map"),
        ((tmp_path, "--map", "a.ply", "--runs", "2"), "--runs has no effect without --systems"),
        (("--list", "--force"), "--force has no effect beside --list"),
    ):
        done = run("evaluate", *words)
        assert done.returncode == 2
        assert done.stderr.startswith(f"terrain-forge: {told}: leave it out (see ")
        assert done.stderr.count("\n") == 1


def test_a_path_that_is_too_short_for_a_drift_says_so(tmp_path):
    truth = _circle(radius=1.0, turns=1.0, count=100)
    path = _write_tum(tmp_path / "gt.tum", truth)
    note = "no TDr: the path of 6.28 m is shorter than drift_over_m, 10 m"
    done = run("evaluate", "--truth", path, "--estimate", path, "-o", tmp_path)
    head, row = csv.reader((tmp_path / "evaluation.csv").read_text().splitlines())
    assert dict(zip(head, row, strict=True))["TDr rms [%]"] == ""
    assert (head[-1], row[-1]) == ("note", note)
    assert note in done.stdout
    done = run("evaluate", "--truth", path, "--estimate", path, "--set", "drift_over_m=5")
    assert "note" not in done.stdout
    score = score_poses(truth, truth)
    one = Run(system="kiss-icp", status="done", seconds=1.0, processor_s=1.0, memory=1.0, log="")
    result = Result(run=one, number=1, score=score, frame="base_link", world="mini")
    assert result_rows([result])[1][-1] == note
    assert result_lines([result])[-1] == f"kiss-icp: {note}"
    assert result_rows([result.replace(score=score_poses(_circle(), _circle()))])[1][-1] == "done"


def test_an_unknown_option_is_told(tmp_path):
    path = _write_tum(tmp_path / "gt.tum", _circle(count=50))
    for change, told in {
        "aline=all": "unknown key 'aline' (did you mean 'align'?), allowed: align",
        "align=some": "'first_third', 'all', 'origin' or 'none'",
        "align": "must be key=value",
        "scale=maybe": 'scale: must be true or false, found "maybe"',
    }.items():
        done = run("evaluate", "--truth", path, "--estimate", path, "--set", change)
        assert done.returncode == 2
        assert told in done.stderr
        assert done.stderr.count("\n") == 1


def test_a_pipe_or_a_link_in_a_tables_place_is_not_written_to(tmp_path):
    mine, folder = tmp_path / "mine.txt", tmp_path / "out"
    mine.write_text("precious")
    folder.mkdir()
    os.mkfifo(folder / "evaluation.csv")
    (folder / "evaluation.tex").symlink_to(mine)
    paths = write_table([["system"], ["a"]], {}, folder)
    assert mine.read_text() == "precious"
    assert all(path.is_file() and not path.is_symlink() for path in paths)
    assert sorted(folder.iterdir()) == sorted(paths)
