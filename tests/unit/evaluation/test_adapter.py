"""Running a system: a program of any kind, what it writes, and what it does wrong."""

from __future__ import annotations

import signal
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from terrain_forge.base import DataError
from terrain_forge.evaluation.adapter import Adapter, run_system
from terrain_forge.evaluation.poses import read_kitti_poses

TRUTH = "".join(f"{0.1 * n:.1f} {n} 0 0 0 0 0 1\n" for n in range(50))


def _system(tmp_path, body, **more):
    """A program that gets its input and its output, as whoever brings a binary writes one."""
    program = tmp_path / "program.py"
    program.write_text(
        "import os, sys, time\nsource, target = sys.argv[1:3]\n" + textwrap.dedent(body)
    )
    (tmp_path / "gt.tum").write_text(TRUTH)
    adapter = Adapter(
        name="fake", command=f"{sys.executable} {program} {{input}} {{output}}", **more
    )
    return run_system(adapter, {"input": str(tmp_path / "gt.tum")}, keep=tmp_path / "kept")


COPY = "open(target, 'w').write(open(source).read())\nprint('tracked all')\n"


def test_what_it_writes_is_read_and_its_cost_told(tmp_path):
    run = _system(tmp_path, COPY + "x = bytearray(60_000_000)\nsum(range(3_000_000))\n")
    assert run.status == "done"
    assert len(run.estimate.time) == 50
    assert run.estimate.position[-1] == pytest.approx([49, 0, 0])
    assert 0.0 < run.processor_s <= run.seconds + 0.1
    assert 60e6 < run.memory < 90e6  # its own, not that of these tests
    assert "tracked all" in run.log
    assert (tmp_path / "kept" / "output.txt").read_text() == "tracked all\n"
    assert (tmp_path / "kept" / "fake.tum").read_text() == TRUTH


def test_it_may_choose_the_name_of_its_file_and_kittis_format(tmp_path):
    body = """
    os.makedirs('results/today')
    with open('results/today/poses_00.txt', 'w') as file:
        for n in range(9):
            file.write(f'0 -1 0 {n} 1 0 0 0 0 0 1 0\\n')
    """
    run = _system(tmp_path, body, output="results/*/poses_*.txt", format="kitti")
    assert run.status == "done", run.why
    assert run.estimate.time.tolist() == list(range(9))
    assert np.abs(run.estimate.quaternion[3]) == pytest.approx([0.5**0.5, 0, 0, 0.5**0.5])


WRONG = {
    "print('no vocabulary'); sys.exit(3)": ("failed", "ended with status 3: no vocabulary"),
    r"print('\x1b[31mno\t\x1b[1mvocabulary\x07\n\x1b[0m'); sys.exit(3)": (
        "failed",
        "3: no vocabulary",
    ),
    "os.abort()": ("failed", f"ended with signal {signal.SIGABRT.value}"),
    "pass": ("lost", "wrote no trajectory (fake.tum)"),
    "open(target, 'w').write('0 0 0 0 0 0 0 1')": (
        "lost",
        "a trajectory has at least 2 poses, found 1",
    ),
    "open(target, 'w').write('0 nan 0 0 0 0 0 1\\n1 0 0 0 0 0 0 1')": (
        "lost",
        "fake.tum:1: a value",
    ),
}


@pytest.mark.parametrize("body", WRONG)
def test_what_goes_wrong_is_a_result(tmp_path, body):
    run = _system(tmp_path, body)
    assert run.status == WRONG[body][0]
    assert WRONG[body][1] in run.why
    assert run.estimate is None


def test_a_missing_program_is_a_result_too():
    run = run_system(Adapter(name="orb", command="/nowhere/stereo_euroc {input}"), {"input": "x"})
    assert (run.status, run.why) == ("failed", "/nowhere/stereo_euroc: no such file or directory")


def test_it_and_all_that_it_started_are_killed_at_the_timeout(tmp_path):
    body = f"""
    import subprocess
    child = subprocess.Popen([{sys.executable!r}, '-c', 'import time; time.sleep(60)'])
    open({str(tmp_path / "child")!r}, 'w').write(str(child.pid))
    time.sleep(60)
    """
    run = _system(tmp_path, body, timeout_s=1.0)
    assert (run.status, run.why) == ("timeout", "killed after 1 s")
    child = int((tmp_path / "child").read_text())
    for _ in range(100):
        if not _lives(child):
            break
        time.sleep(0.05)
    assert not _lives(child)


def _lives(number):
    try:
        with Path(f"/proc/{number}/stat").open(encoding="utf-8") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="sessions of their own end on Linux alone")
@pytest.mark.parametrize("sleeps", [0, 60])
def test_what_it_left_in_a_session_of_its_own_ends_with_it(tmp_path, sleeps):
    body = f"""
    import subprocess
    child = subprocess.Popen(
        [{sys.executable!r}, '-c', 'import time; time.sleep(60)'], start_new_session=True
    )
    open({str(tmp_path / "child")!r}, 'w').write(str(child.pid))
    time.sleep({sleeps})
    """
    run = _system(tmp_path, body + COPY.replace("\n", "\n    "), timeout_s=1.5)
    assert run.status == ("timeout" if sleeps else "done")
    assert not _lives(int((tmp_path / "child").read_text()))


def test_a_trajectory_outside_its_folder_is_none_of_its_own(tmp_path):
    (tmp_path / "old.tum").write_text(TRUTH)
    run = _system(tmp_path, "pass", output=str(tmp_path / "old.tum"))
    assert run.status == "lost"
    run = _system(tmp_path, f"os.symlink({str(tmp_path / 'old.tum')!r}, target)")
    assert run.status == "lost"
    assert not (tmp_path / "kept" / "fake.tum").exists()


@pytest.mark.parametrize("linked", [False, True])
def test_a_name_that_two_files_have_tells_no_trajectory(tmp_path, linked):
    """A link to the other one, as to the latest result, is no second one."""
    second = "os.symlink('one', 'r/two')" if linked else "os.makedirs('r/two')"
    body = f"""
    os.makedirs('r/one')
    {second}
    for place in ('r/one', 'r/two'):
        open(f'{{place}}/a.txt', 'w').write(open(source).read())
    """
    run = _system(tmp_path, body, output="r/*/a.txt")
    wanted = "wrote 2 files of its trajectory (r/*/a.txt): r/one/a.txt, r/two/a.txt"
    assert (run.status, run.why) == (("done", "") if linked else ("lost", wanted))
    assert (tmp_path / "kept" / "fake.tum").exists() == linked


def test_a_command_that_cannot_be_filled_in_is_told():
    for command, told in {
        "run {inptu}": "command has {inptu}, known: {input}, {output}",
        "run 'x": "command: no closing quotation",
    }.items():
        with pytest.raises(DataError, match="fake: ") as error:
            run_system(Adapter(name="fake", command=command), {"input": "x"})
        assert told in str(error.value)


@pytest.mark.parametrize("y", [2, -1])
def test_a_matrix_that_is_no_rotation_is_told(tmp_path, y):
    path = tmp_path / "poses.txt"
    path.write_text(f"1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 {y} 0 0 0 0 1 0\n")
    with pytest.raises(DataError, match=r"poses\.txt:2: its matrix is no rotation"):
        read_kitti_poses(path)


def test_little_is_kept_of_what_is_too_much(tmp_path):
    run = _system(tmp_path, "print('a' * 99999)\nsys.exit(1)")
    assert run.why == "ended with status 1: " + "a" * 300
    run = _system(tmp_path, "open(target, 'w').truncate(2**30 + 1)")
    assert run.why == "fake.tum has 1,024.0 MiB, at most 1,024 MiB"
    assert not (tmp_path / "kept" / "fake.tum").exists()


def test_a_script_without_its_interpreter_says_so(tmp_path):
    script = tmp_path / "program"
    script.write_bytes(b"#!/nowhere/python3 -u\r\n")
    script.chmod(0o755)
    run = run_system(Adapter(name="fake", command=f"{script} {{input}}"), {"input": "x"})
    assert run.status == "failed"
    assert run.why == f"{script}: its interpreter '/nowhere/python3' is not there"
    script.write_bytes(b"#!/bin/sh\r\n")
    run = run_system(Adapter(name="fake", command=f"{script} {{input}}"), {"input": "x"})
    assert run.why == f"{script}: its interpreter '/bin/sh\\r' is not there"
