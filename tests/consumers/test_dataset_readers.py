"""Datasets in the hands of evo, KISS-ICP and evalio, each in a Python of its own.

They are looked for beside the Python that TERRAIN_FORGE_SLAM_PYTHON names.
"""

from __future__ import annotations

import re
import subprocess

import numpy as np
import pytest

from terrain_forge.datasets import open_recording, write_dataset
from tests.helpers.places import ROOT
from tests.helpers.recordings import write_recording

pytestmark = pytest.mark.consumer

EVALIO = """
import sys
from functools import partial
from pathlib import Path
from evalio.datasets.loaders import RosbagIter
from evalio.types import LidarParams
params = LidarParams(num_rows=4, num_columns=90, min_range=0.5, max_range=100.0)
for path in map(Path, sys.argv[1:]):
    column = partial(by_time, column_s=0.1 / 90)
    bag = RosbagIter(path, "/velodyne_points", "/imu0", params, custom_col_func=column)
    scans, samples = list(bag.lidar_iter()), len(list(bag.imu_iter()))
    told = [(p.row, p.col) for p in scans[0].points if p.x or p.y or p.z]
    print(len(scans), samples, *(f"{row}:{column}" for row, column in told))
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A recording, and its formats beside it."""
    place = tmp_path_factory.mktemp("readers")
    write_recording(place / "dataset", seconds=2.0)
    for kind in ("tum", "kitti", "rosbag1", "rosbag2"):
        write_dataset(place / "dataset", kind, place / kind)
    write_dataset(place / "dataset", "clouds", place / "bin", {"encoding": "bin"})
    return place


def run(python, *command, cwd, name=""):
    program = python.parent / name if name else python
    if not program.exists():
        pytest.skip(f"{program} is not installed")
    done = subprocess.run([program, *command], cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_evo_reads_the_truth(python, written, tmp_path):
    def ape(*files):
        text = run(python, *files, cwd=tmp_path, name="evo_ape")
        return float(next(line for line in text.splitlines() if "max" in line).split()[1])

    truth = written / "dataset" / "truth" / "cam0.tum"
    assert ape("tum", truth, written / "tum" / "groundtruth.txt") == 0.0
    poses = written / "kitti" / "poses" / "00.txt"
    assert ape("kitti", poses, poses) == 0.0
    euroc = written / "dataset" / "mav0" / "state_groundtruth_estimate0" / "data.csv"
    assert ape("euroc", euroc, written / "dataset" / "truth" / "imu0.tum") == 0.0


@pytest.mark.parametrize("source", ["rosbag1", "rosbag2", "bin/lidar0"])
def test_kiss_icp_reads_sweeps(python, written, tmp_path, source):
    run(python, written / source, cwd=tmp_path, name="kiss_icp_pipeline")
    (poses,) = tmp_path.glob("results/latest/*_poses_tum.txt")
    assert len(poses.read_text().splitlines()) == 19


def test_evalio_reads_bags(python, written, tmp_path):
    if subprocess.run([python, "-c", "import evalio"], capture_output=True).returncode:
        pytest.skip("evalio is not installed")
    page = (ROOT / "docs" / "datasets.md").read_text(encoding="utf-8")
    (function,) = re.findall(r"^```python\n(def by_time.*?)^```", page, re.M | re.S)
    program = function + EVALIO
    text = run(python, "-c", program, written / "rosbag1", written / "rosbag2", cwd=tmp_path)
    sweep = open_recording(written).lidars[0].sweep(0)
    columns = np.rint(sweep["time"] * 900).astype(int).tolist()
    cells = {f"{ring}:{column}" for ring, column in zip(sweep["ring"], columns, strict=True)}
    for line in text.splitlines():
        scans, samples, *told = line.split()
        assert (scans, samples) == ("19", "401")
        assert len(told) == len(cells)
        assert set(told) == cells


DEBIAN = "/usr/bin/python3"
TOPICS = """
import sys, rosbag
with rosbag.Bag(sys.argv[1]) as bag:
    for topic, one in sorted(bag.get_type_and_topic_info().topics.items()):
        print(topic, one.message_count)
    print("messages", sum(1 for _ in bag.read_messages()))
"""


def test_ros_itself_reads_the_bag(written):
    """By Debian's python3-rosbag; all its messages are deserialised."""
    if subprocess.run([DEBIAN, "-c", "import rosbag"], capture_output=True).returncode:
        pytest.skip("Debian's python3-rosbag is not installed")
    bag = written / "rosbag1" / "recording.bag"
    done = subprocess.run([DEBIAN, "-c", TOPICS, bag], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    counts = {topic: int(count) for topic, count in map(str.split, done.stdout.splitlines())}
    assert counts["/velodyne_points"] > 0
    assert counts["/cam0/image_raw"] == counts["/cam1/image_raw"] > 0
    assert counts["/imu0"] > 100
    assert counts.pop("messages") == sum(counts.values())
