"""The driver of RTAB-Map, with a program in its place that writes what kitti_dataset does."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from terrain_forge.evaluation import evaluate_recording
from terrain_forge.evaluation.catalogue import with_binaries

_READS = """
import os, signal, sqlite3, struct, sys, time
words = sys.argv[1:]
assert words[:-1:2] == ["--output", "--Rtabmap/DetectionRate", "--Rtabmap/CreateIntermediateNodes",
                        "--RGBD/LinearUpdate", "--RGBD/AngularUpdate"]
sequence, output = words[-1], words[1]
times = [float(line) for line in open(f"{sequence}/times.txt")]
poses = open(f"{sequence}/../../poses/00.txt").readlines()
"""
_WRITES = """
database = sqlite3.connect(f"{output}/rtabmap.db")
database.execute("CREATE TABLE Node (id INTEGER, weight INTEGER, stamp FLOAT)")
database.execute("CREATE TABLE Link (from_id INTEGER, to_id INTEGER, type INTEGER, transform BLOB)")
kept = [0, 1, 3, 4]  # it is lost in the third frame, which becomes no node
for number, frame in enumerate(kept, 1):
    database.execute("INSERT INTO Node VALUES (?, -1, ?)", (number, times[frame]))
# a metre ahead, half to the left, a quarter up; links are there both ways, of all kinds
there, back = ([1, 0, 0, s, 0, 1, 0, s / 2, 0, 0, 1, s / 4] for s in (1, -1))
for kind, (a, b) in ((0, (1, 2)), (1, (1, 4)), (2, (2, 4))):
    for row in ((a, b, kind, struct.pack("12f", *there)), (b, a, kind, struct.pack("12f", *back))):
        database.execute("INSERT INTO Link VALUES (?, ?, ?, ?)", row)
database.commit()
open(f"{output}/rtabmap_poses.txt", "w").writelines(poses[frame] for frame in kept)
"""
_WAITS = """
def stop(*_):
    time.sleep(0.3)
    sys.exit("saved")

signal.signal(signal.SIGTERM, stop)
signal.pause()
"""


def _run(dataset, tmp_path, does, **changes):
    program = tmp_path / "program"
    program.write_text(f"#!{sys.executable}\n{_READS}{does}")
    program.chmod(0o755)
    (system,) = with_binaries([], [f"rtab-map={program}"])
    return evaluate_recording(dataset, [replace(system, **changes)])[0]


def test_times_and_loop_closures_are_those_of_its_database(dataset, tmp_path):
    result = _run(dataset, tmp_path, _WRITES)
    assert result.run.status == "done", result.run.log
    assert result.score.ate.rms < 1e-9
    assert result.score.poses == 4
    time = result.run.estimate.time
    np.testing.assert_allclose(result.run.loops.time, [[time[0], time[3]]])
    np.testing.assert_allclose(result.run.loops.motion, [[-0.5, -0.25, 1.0]])  # the camera's axes


@pytest.mark.parametrize(
    ("does", "status", "why"),
    [
        ("os.abort()", "failed", "ended with signal 6"),
        ("sys.exit('[ERROR] bad')", "failed", "ended with status 1: [ERROR] bad"),
        ("print('Camera init failed!')", "lost", "wrote no trajectory (rtabmap_poses.txt)"),
        (_WAITS, "timeout", "killed after 3 s"),
    ],
)
def test_it_ends_as_the_program_does(dataset, tmp_path, does, status, why):
    result = _run(dataset, tmp_path, does, timeout_s=3.0)
    assert (result.run.status, result.run.why) == (status, why)
    assert ("saved" in result.run.log) == (status == "timeout")  # it was waited for


def test_a_program_that_cannot_be_started_is_told(dataset, tmp_path):
    (system,) = with_binaries([], [f"rtab-map={tmp_path}"])
    result = evaluate_recording(dataset, [system])[0]
    assert result.run.why == f"ended with status 1: {tmp_path}: permission denied"
