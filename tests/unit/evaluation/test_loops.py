"""Loop closures, on a circle that is driven twice and a straight way back."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from terrain_forge.base import DataError
from terrain_forge.evaluation import (
    ScoreOptions,
    TimedPoses,
    evaluate_recording,
    find_system,
    made_loops,
    read_loops,
    result_lines,
    score_loops,
)
from tests.helpers.recordings import write_recording

RADIUS, LAP = 5.0, 60.0


def _laps(laps=2.0):
    """Laps of a minute; the heading is along the path."""
    time = np.arange(0.0, laps * LAP + 0.05, 0.1)
    angle = 2.0 * np.pi * time / LAP
    place = RADIUS * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    turn = np.roll(Rotation.from_euler("z", angle[:, None] + np.pi / 2).as_quat(), 1, axis=-1)
    return TimedPoses(time=time, position=place, quaternion=turn)


def _loops(*pairs):
    rows = np.array([[*pair, *[np.nan] * (5 - len(pair))] for pair in pairs])
    return made_loops(rows.reshape(-1, 5))


def test_near_places_that_are_far_apart_by_the_path_are_right():
    truth = _laps()
    step = 2.0 * np.pi * RADIUS / LAP  # in a second
    found = score_loops(truth, _loops((10, 70), (75, 15), (10, 70 + 1.5 / step), (10, 40)))
    assert (found.found, found.right) == (4, 3)
    assert (found.revisits, found.closed) == (1, 1)
    assert found.told == "3 of 4, 1 of 1 revisits"
    near = ScoreOptions(loop_m=1.0)
    assert score_loops(truth, _loops((10, 70 + 1.5 / step)), near).right == 0
    assert score_loops(truth, _loops((10, 13))).right == 0  # it has only just been there
    assert score_loops(truth, _loops((10, 500))).right == 0


def test_a_motion_that_is_told_must_be_the_true_one():
    truth = _laps()
    ahead = 3.0  # seconds on the second lap
    angle = 2.0 * np.pi * ahead / LAP
    there = RADIUS * np.sin(angle), RADIUS * (1.0 - np.cos(angle)), 0.0  # x is along the path
    back = -there[0], there[1], 0.0
    pairs = [(10, 70 + ahead, *there), (70 + ahead, 10, *back), (10, 70 + ahead, *back)]
    assert [score_loops(truth, _loops(pair)).right for pair in pairs] == [1, 1, 0]


def test_revisits_are_stretches():
    there = np.linspace(0.0, 40.0, 401)
    x = np.concatenate([there, there[::-1][1:]])
    y = np.concatenate([0.0 * there, np.where((there < 10) | (there > 25), 1.0, 5.0)[::-1][1:]])
    quaternion = np.tile([1.0, 0.0, 0.0, 0.0], (len(x), 1))
    place = np.column_stack([x, y, 0.0 * x])
    truth = TimedPoses(time=np.arange(len(x)) * 0.1, position=place, quaternion=quaternion)
    found = score_loops(truth, _loops((5.0, 75.0)))
    assert (found.revisits, found.right, found.closed) == (2, 1, 1)
    none = _loops()
    assert score_loops(truth, none).told == "0 of 0, 0 of 2 revisits"
    assert score_loops(_laps(0.5), none).revisits == 0


def test_loops_are_read_by_line(tmp_path):
    file = tmp_path / "loops.txt"
    file.write_text("# of two places\n1 2\n3.5, 4.5, 1, 2, 3, 0, 0, 0, 1\n")
    found = read_loops(file)
    np.testing.assert_array_equal(found.time, [[1, 2], [3.5, 4.5]])
    assert found.told.tolist() == [False, True]
    np.testing.assert_array_equal(found.motion, [[0, 0, 0], [1, 2, 3]])
    file.write_text("")
    assert len(read_loops(file).time) == 0
    for text, told in (("1\n", ":1: 1 numbers"), ("1 x\n", ":1: '1 x'"), ("nan 1\n", "finite")):
        file.write_text(text)
        with pytest.raises(DataError, match=told):
            read_loops(file)


def test_a_system_may_tell_its_loops(tmp_path):
    dataset = write_recording(tmp_path / "dataset")
    (tmp_path / "mine.py").write_text(
        "import shutil, sys\n"
        "shutil.copy(f'{sys.argv[1]}/truth/cam0.tum', sys.argv[2])\n"
        "open('closures.txt', 'w').write(sys.argv[3])\n"
    )
    for name, content in (("good", "0 4"), ("bad", "0 9"), ("broken", "0")):
        (tmp_path / f"{name}.yaml").write_text(
            f"command: \"{{python}} {tmp_path}/mine.py {{input}} {{output}} '{content}'\"\n"
            "frame: cam0\nloops: closures.txt\nloops_in: frames\n"
        )
    options = ScoreOptions(align="none", loop_m=100.0, loop_apart_m=0.01)
    systems = [find_system(str(tmp_path / f"{name}.yaml")) for name in ("good", "bad", "broken")]
    good, bad, broken = evaluate_recording(dataset, systems, options=options)
    assert good.loops.told == "1 of 1, 1 of 1 revisits"
    assert "1 of 1, 1 of 1 revisits" in result_lines([good])[1]
    assert (bad.run.status, bad.loops) == ("done", None)
    assert bad.run.why == "loop closures: bad: stamp 9 is no frame of 0 to 4"
    for one in (bad, broken):
        assert result_lines([one])[-1].startswith(f"{one.run.system}: {one.run.why}; no TDr")
    assert broken.run.status == "done"
    assert broken.run.why == "loop closures: closures.txt:1: 1 numbers, must be 2"
    good = tmp_path / "good.yaml"
    good.write_text(good.read_text().replace("loops: closures", "loops: clozures"))
    (lost,) = evaluate_recording(dataset, [find_system(str(good))], options=options)
    assert (lost.run.status, lost.loops) == ("done", None)
    assert lost.run.why == "wrote no loop closures (clozures.txt) in its folder"
