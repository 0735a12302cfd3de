"""The driver of KISS-SLAM, with a module in its place whose closures are known."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from terrain_forge import evaluation
from tests.helpers.recordings import FIELDS

DRIVER = Path(evaluation.__file__).parent / "drivers" / "kiss_slam_driver.py"
CONFIG = """
from types import SimpleNamespace as Some

def load_config(file):
    odometry = Some(preprocessing=Some(), mapping=Some(), registration=Some())
    return Some(odometry=odometry, local_mapper=Some(), loop_closer=Some(detector=Some()))
"""
SLAM = '''
from types import SimpleNamespace as Some
import numpy as np

def at(x, y, yaw):
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:2, 3] = x, y
    return pose

# Out along x, and back beside it. Of three sweeps a local map the last begins the next one.
POSES = [at(x, 0, 0) for x in (0, 2, 4, 6)] + [at(x, y, np.pi) for x, y in ((6, 1), (4, 1), (2, 2))]

class KissSLAM:
    def __init__(self, config):
        assert config.odometry.preprocessing.max_range == 20.0
        assert config.odometry.registration.max_num_threads == 1
        self.seen, self.closer = 0, Some(compute=self.compute)
        self.graph = {0: Some(id=0, keypose=POSES[0], local_trajectory=[])}
        self.local_map_graph = Some(
            graph=self.graph, erase_last_local_map=lambda: self.graph.popitem(),
            local_maps=lambda: iter(self.graph.values()),
        )

    def process_scan(self, places, times):
        assert places.shape == (2, 3) and len(times) == (0 if self.seen else 2)
        part = [*self.graph.values()][-1]
        pose = np.linalg.inv(part.keypose) @ POSES[self.seen]
        part.local_trajectory.append(pose)
        self.seen += 1
        if self.seen in (3, 5):
            self.generate_new_node()

    def generate_new_node(self):
        part = [*self.graph.values()][-1]
        end = part.keypose @ part.local_trajectory[-1]
        points = np.full((1, 3), part.id, np.float32)
        part.pcd = Some(point=Some(positions=Some(numpy=lambda: points)))
        self.graph[part.id + 1] = Some(
            id=part.id + 1, keypose=end, local_trajectory=[np.eye(4)])
        self.closer.compute(part.id, points, self.local_map_graph)

    def compute(self, query, points, graph):
        """The third map closes with the first; the second is asked in vain."""
        motion = np.linalg.inv(self.graph[query].keypose) @ self.graph[0].keypose
        return query == 2, 0, query, motion

    def fine_grained_optimization(self):
        return POSES, None
'''


def test_closures_of_local_maps_are_told_of_their_nearest_sweeps(tmp_path):
    package = tmp_path / "kiss_slam"
    package.mkdir()
    for name, text in {"__init__": "", "config": CONFIG, "slam": SLAM}.items():
        (package / f"{name}.py").write_text(text)
    folder = tmp_path / "mav0" / "lidar0"
    (folder / "data").mkdir(parents=True)
    (folder / "sensor.yaml").write_text(json.dumps({"range_min_m": 0.9, "range_max_m": 20.0}))
    rows = [f"{number}500000000,{number}.npy" for number in range(7)]
    (folder / "data.csv").write_text("\n".join(("#timestamp [ns],filename", *rows)))
    for number in range(7):
        points = np.zeros(2, FIELDS)
        points["time"] = 0.05 if number else (0.0, 0.1)  # all but the first are taken at once
        np.save(folder / "data" / f"{number}.npy", points)
    run = [sys.executable, DRIVER, tmp_path, tmp_path / "out.tum", "lidar0"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    subprocess.run(run, env=environment, cwd=tmp_path, check=True, capture_output=True)
    poses = np.loadtxt(tmp_path / "out.tum")
    np.testing.assert_array_equal(poses[:, 0], np.arange(7) + 0.5)
    np.testing.assert_allclose(poses[:, 1], [0, 2, 4, 6, 6, 4, 2])
    # The sixth sweep is a metre beside the third; it looks back, and that is to its right.
    told = np.loadtxt(tmp_path / "loops.txt")
    np.testing.assert_allclose(told, [5.5, 2.5, 0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_array_equal(np.load(tmp_path / "map.npy").shape, (3, 3))
    assert float((tmp_path / "own_s.txt").read_text()) > 0.0
