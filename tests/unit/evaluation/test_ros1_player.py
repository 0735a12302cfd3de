"""Systems of ROS 1 through the player, with programs of ROS that only look like it."""

from __future__ import annotations

import json
import os
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from terrain_forge.evaluation import chosen_systems, evaluate_recording, read_poses
from tests.helpers.recordings import write_recording

pytest.importorskip("rosbags", reason="rosbags is not installed")

_FAKE = """
import os, signal, sys, time
sys.path[:] = {path!r}
name = os.path.basename(sys.argv[0])
open({log!r}, "a").write(" ".join([name, *sys.argv[1:]]) + "\\n")
class Interrupted(Exception):
    pass
def interrupt(*_):
    open({log!r}, "a").write(name + " was interrupted\\n")
    raise Interrupted
signal.signal(signal.SIGINT, interrupt)
if name in ("roscore", "roslaunch", "alone"):
    try:
        time.sleep(60)
    except Interrupted:
        sys.exit(0)
elif name == "rosbag" and sys.argv[1] == "record":
    final, wanted = sys.argv[3], [word for word in sys.argv if word[0] == '/'][2:]
    child = os.fork()  # as rosbag does, which ends before it
    try:
        time.sleep(60)
    except Interrupted:  # only a recorder that is interrupted writes its bag
        if child:
            sys.exit(0)
        time.sleep(1)
        target = final + ".active"
        exec(open({writer!r}).read())
        os.rename(target, final)
"""
_WRITER = """
import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
store = get_typestore(Stores.ROS1_NOETIC)
make = lambda kind, *values: store.types[kind](*values)
Time = store.types["builtin_interfaces/msg/Time"]
def pose_of(row):
    place = make("geometry_msgs/msg/Point", *row[:3])
    turn = make("geometry_msgs/msg/Quaternion", *row[3:])
    return make("geometry_msgs/msg/Pose", place, turn)
twist = make("geometry_msgs/msg/Twist", *[make("geometry_msgs/msg/Vector3", 0, 0, 0)] * 2)
none = np.zeros(36)
with Writer(target) as bag:
    kind = "nav_msgs/msg/Odometry"
    odometry = bag.add_connection(wanted[0], kind, typestore=store)
    rows = [l.split() for l in open(truth) if l[0] != "#"]
    for number, (stamp, *row) in enumerate(rows):
        row = np.array(row, float)
        when = int(stamp.split(".")[0]), int(stamp.split(".")[1])
        header = make("std_msgs/msg/Header", number, Time(*when), "map")
        nano = when[0] * 10**9 + when[1]
        if len(wanted) > 1 and number == 3:  # from here on its odometry is 1 m off in x
            moved = make("geometry_msgs/msg/Vector3", -1.0, 0.0, 0.0)
            turn = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
            moved = make("geometry_msgs/msg/Transform", moved, turn)
            told = "geometry_msgs/msg/TransformStamped"
            correction = bag.add_connection(wanted[1], told, typestore=store)
            moved = make(told, header, "odom", moved)
            bag.write(correction, nano, store.serialize_ros1(moved, told))
        if len(wanted) > 1 and number >= 3:
            row[0] += 1.0
        if z_forward:
            row = row[[1, 2, 0, 4, 5, 3, 6]]  # z forward, x left, y up, as LeGO-LOAM's are
        pose = make("geometry_msgs/msg/PoseWithCovariance", pose_of(row), none)
        moving = make("geometry_msgs/msg/TwistWithCovariance", twist, none)
        message = make(kind, header, moves, pose, moving)
        bag.write(odometry, nano + 10**7, store.serialize_ros1(message, kind))
"""


@pytest.fixture
def ros(tmp_path, monkeypatch):
    """A recording, and programs of ROS first on the PATH that tell what they were given."""
    dataset = write_recording(tmp_path / "dataset")
    about = json.loads((dataset / "mav0/lidar0/sensor.yaml").read_text())
    (dataset / "mav0/lidar0/sensor.yaml").write_text(json.dumps(about | {"rings": 16}))
    programs = tmp_path / "ros"
    programs.mkdir()
    writer, log = tmp_path / "writer.py", tmp_path / "log"
    body = textwrap.dedent(_FAKE).format(path=sys.path, log=str(log), writer=str(writer))
    for name in ("roscore", "rosparam", "rosbag", "roslaunch", "alone"):
        (programs / name).write_text(f"#!{sys.executable} -S\n{body}")
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")

    def run(name, binary, *, z_forward=False, moves="lidar0", **changes):
        told = tmp_path / "told.tum"  # of the frame that the system moves, when the lidar measured
        lidar, rows = (
            (dataset / "truth" / f"{frame}.tum").read_text().splitlines()
            for frame in ("lidar0", moves)
        )
        stamps = {row.split()[0] for row in lidar}
        told.write_text("\n".join(row for row in rows if row.split()[0] in stamps))
        what = f"truth, z_forward, moves = {str(told)!r}, {z_forward}, {moves!r}\n"
        writer.write_text(what + _WRITER)
        (adapter,) = chosen_systems(name, dataset, [f"{name}={binary}"])
        quick = adapter.command + " --delay 0 --settle 1"
        (result,) = evaluate_recording(dataset, [replace(adapter, command=quick, **changes)])
        return result, log.read_text().splitlines() if log.exists() else []

    return run, tmp_path


def _workspace(folder: Path) -> Path:
    (folder / "devel").mkdir(parents=True)
    (folder / "devel" / "setup.bash").write_text("export SOURCED=yes\n")
    return folder


def _require_truth(run, place):
    """Each pose, place and rotation, is the lidar's true one."""
    assert run.status == "done", run.log
    truth = read_poses(place / "dataset" / "truth" / "lidar0.tum")
    np.testing.assert_allclose(run.estimate.time, truth.time, atol=1e-6)
    np.testing.assert_allclose(run.estimate.position, truth.position, atol=1e-7)
    alike = np.abs((run.estimate.quaternion * truth.quaternion).sum(axis=1))
    np.testing.assert_allclose(alike, 1.0, atol=1e-9)
    assert np.ptp(truth.quaternion, axis=0).min() > 1e-4  # it turns about all axes


@pytest.mark.slow
def test_a_workspace_is_sourced_launched_and_played_to(ros):
    run, place = ros
    result, log = run("a-loam", _workspace(place / "my catkin"))
    _require_truth(result.run, place)
    assert any(line.startswith("roscore -p ") for line in log)  # beside the others: in any place
    launch = "roslaunch aloam_velodyne aloam_velodyne_VLP_16.launch rviz:=false"
    assert log.index("rosparam set /use_sim_time true") < log.index(launch)
    (record,) = [line for line in log if line.startswith("rosbag record")]
    assert record.endswith("--buffsize=0 --chunksize=1 /aft_mapped_to_init")
    (play,) = [line for line in log if line.startswith("rosbag play --clock")]
    assert "recording.bag --topics /tf_static /velodyne_points /imu0" in play


@pytest.mark.slow
def test_axes_with_z_forward_are_turned(ros):
    run, place = ros
    result, log = run("lego-loam", place / "ros" / "alone", z_forward=True)
    _require_truth(result.run, place)
    assert "alone" in log


@pytest.mark.slow
def test_corrections_of_the_graph_are_applied_from_when_they_came(ros):
    run, place = ros
    (place / "mine.launch").write_text("<launch/>")
    result, log = run("hdl-graph-slam", place / "mine.launch")
    _require_truth(result.run, place)
    assert f"roslaunch {place / 'mine.launch'}" in log
    assert any(line.endswith("/odom /hdl_graph_slam/odom2pub") for line in log)


@pytest.mark.slow
def test_a_system_that_moves_base_link_is_taken_for_the_lidars_motion(ros):
    run, place = ros
    (place / "mine.launch").write_text("<launch/>")
    result, _ = run("hdl-graph-slam", place / "mine.launch", moves="base_link")
    _require_truth(result.run, place)


def _linger(place):
    """The bag is played for longer than anyone waits."""
    play = place / "ros" / "rosbag"
    play.write_text(play.read_text() + "\nif 'play' in sys.argv:\n    time.sleep(20)\n")


@pytest.mark.slow
def test_playing_and_reading_are_not_the_systems_processor_time(ros):
    run, place = ros
    play, busy = place / "ros" / "rosbag", "time.process_time() < 1.0"
    play.write_text(f"{play.read_text()}\nwhile 'play' in sys.argv and {busy}:\n    pass\n")
    alone, work = place / "ros" / "alone", "sum(range(9_000_000)), time.sleep(60)"
    alone.write_text(alone.read_text().replace("time.sleep(60)", work, 1))
    result, _ = run("a-loam", alone)
    assert result.run.status == "done", result.run.log
    assert 0.1 < result.run.processor_s < 1.0


@pytest.mark.slow
def test_a_system_that_is_behind_the_bag_is_waited_for(ros):
    run, place = ros
    rosbag = place / "ros" / "rosbag"
    late = (
        "for _ in range(20):\n            time.sleep(0.2)\n"
        "            open(final + '.active', 'a').write('a pose')\n"
        "        open(sys.argv[0] + '.log', 'w').write('all')\n        time.sleep(60)"
    )
    core, record = rosbag.read_text().rsplit("time.sleep(60)", 1)
    rosbag.write_text(f"{core}{late}{record.replace('.active', '.writing')}")
    result, _ = run("a-loam", place / "ros" / "alone")
    assert result.run.status == "done", result.run.log
    assert (place / "ros" / "rosbag.log").exists()  # it was interrupted after the last pose


@pytest.mark.slow
def test_a_launch_whose_programs_all_ended_is_not_played_to(ros):
    run, place = ros
    _linger(place)
    (place / "mine.launch").write_text("<launch/>")
    (place / "ros" / "roslaunch").write_text("#!/bin/sh\nexit 0\n")
    result, _ = run("a-loam", place / "mine.launch")
    assert result.run.status == "failed"
    assert "mine.launch ended with status 0 while the bag was played" in result.run.why


@pytest.mark.slow
def test_none_of_its_programs_outlives_the_timeout(ros):
    run, place = ros
    _linger(place)
    result, log = run("a-loam", place / "ros" / "alone", timeout_s=2.0)
    assert (result.run.status, result.run.why) == ("timeout", "killed after 2 s")
    ended = sorted(line.split()[0] for line in log if line.endswith("was interrupted"))
    assert ended == ["alone", *["rosbag"] * 3, "roscore"]  # the recorder has a child


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("exit 3", "ended with status 3 while the bag was played"),
        ("folder", "has no devel/setup.bash, install/setup.bash or setup.bash"),
    ],
)
@pytest.mark.slow
def test_what_goes_wrong_is_told(ros, program, why):
    run, place = ros
    binary = place / "program"
    if program == "folder":
        binary.mkdir()
    else:
        binary.write_text(f"#!/bin/sh\n{program}\n")
        binary.chmod(0o755)
        _linger(place)
    result, _ = run("a-loam", binary)
    assert result.run.status == "failed"
    assert why in result.run.why


@pytest.mark.parametrize(
    ("status", "how"), [(5, "roscore ended with status 5"), (127, "roscore was not found")]
)
@pytest.mark.slow
def test_a_master_that_does_not_start_is_told_at_once(ros, status, how):
    run, place = ros
    for name in ("roscore", "rosparam"):
        (place / "ros" / name).write_text(f"#!/bin/sh\nexit {status}\n")
    result, _ = run("a-loam", place / "ros" / "alone", timeout_s=20.0)
    assert result.run.why == f"ended with status 1: {how}"


@pytest.mark.slow
def test_a_launch_file_without_ros_on_the_path_is_told_as_a_workspace_without_it(ros, monkeypatch):
    run, place = ros
    (place / "mine.launch").write_text("<launch/>")
    monkeypatch.setenv("PATH", str(place))
    result, _ = run("a-loam", place / "mine.launch", timeout_s=20.0)
    assert result.run.why == "ended with status 1: roscore was not found"
