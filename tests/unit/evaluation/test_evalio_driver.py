"""The driver of evalio, with a module in its place that tells what it is given."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from terrain_forge import evaluation
from tests.helpers.recordings import FIELDS

DRIVER = Path(evaluation.__file__).parent / "drivers" / "evalio_driver.py"
TYPES = """
from types import SimpleNamespace as Told

def told(**keys):
    return Told(**keys)

LidarParams = ImuParams = told
SO3 = told

def SE3(turn, place):
    return Told(rot=turn, trans=place)

class Duration(int):
    from_nsec = classmethod(lambda cls, number: cls(number))

class Stamp(Duration):
    def to_nsec(self):
        return int(self)

def ImuMeasurement(*told):
    return told
"""
LOADERS = """
from types import SimpleNamespace as Told

import numpy as np

DataType = Told(FLOAT32="f4", UINT32="u4")

def Field(**keys):
    return Told(**keys)

PointCloudMetadata = Field

def pc2_to_evalio(about, fields, data):
    kind = {key: [getattr(field, name) for field in fields] for key, name in (
        ("names", "name"), ("formats", "datatype"), ("offsets", "offset"))}
    points = np.frombuffer(data, np.dtype(kind | {"itemsize": about.point_step}))
    assert len(points) == about.width * about.height
    return Told(stamp=about.stamp, points=points, columns=about.width)

def fill_col_row_major(sweep):
    sweep.column = np.arange(len(sweep.points)) % sweep.columns
"""
PIPELINES = """
from evalio import types

class Fake:
    def default_params(self):
        return {}

    def set_params(self, told):
        pass

    set_imu_params = set_imu_T_lidar = add_imu = set_params

    def initialize(self):
        pass

    def set_lidar_params(self, told):
        print(told.num_rows, told.num_columns, told.min_range, told.max_range)

    def add_lidar(self, sweep):
        for n, p in enumerate(sweep.points):
            if p["x"]:
                print(p["ring"], sweep.column[n], n, round(float(p["x"]), 3), p["t"], p["range"])
        self.stamp = sweep.stamp

    def saved_estimates(self):
        turn = types.SO3(qx=0.0, qy=0.0, qz=0.0, qw=1.0)
        return [(self.stamp, types.SE3(turn, (0.0, 0.0, 0.0)))]
"""
PERIODS = {
    "vlp-16": (16, 55.296e-6, 1808),
    "even": (4, 0.1 / 90, 90),
    "look": (4, 0.1 / 90, 90),
    "snapshot": (64, 0.1 / 1800, 1800),
}
"""Rings, time from column to column [s], columns."""


@pytest.mark.parametrize(
    "kind", ["vlp-16", "even", "look", pytest.param("snapshot", marks=pytest.mark.slow)]
)
def test_each_return_lies_in_the_column_that_it_was_fired_in(tmp_path, kind):
    rings, column_s, columns = PERIODS[kind]
    (tmp_path / "evalio").mkdir()
    (tmp_path / "evalio" / "__init__.py").write_text("")
    (tmp_path / "evalio" / "datasets").mkdir()
    (tmp_path / "evalio" / "datasets" / "__init__.py").write_text("")
    (tmp_path / "evalio" / "datasets" / "loaders.py").write_text(LOADERS)
    (tmp_path / "evalio" / "types.py").write_text(TYPES)
    (tmp_path / "evalio" / "pipelines.py").write_text(PIPELINES)
    folder = tmp_path / "mav0" / "lidar1"
    (folder / "data").mkdir(parents=True)
    about = {"rate_hz": 10.0, "rings": rings, "column_period_s": column_s}
    about |= {"range_min_m": 0.9, "range_max_m": 130.0}
    if kind == "look":  # which has every other sweep
        about |= {"rate_hz": 5.0, "sweep_s": 0.1}
    (folder / "sensor.yaml").write_text(json.dumps(about))
    (folder / "data.csv").write_text("#timestamp [ns],filename\n1000,1000.npy\n")
    ring, column = (part.ravel() for part in np.mgrid[:rings, :columns])
    points = np.zeros(ring.size, FIELDS)
    points["ring"] = ring
    if kind == "snapshot":  # all at once, clockwise from behind
        turn = np.pi - 2.0 * np.pi * column / columns
        points["x"], points["y"] = 5.0 * np.cos(turn), 5.0 * np.sin(turn)
    else:
        fired = (ring * 7 % rings) * 2.304e-6 if kind == "vlp-16" else 0.0
        points["time"] = column * column_s + fired
        points["x"] = 1.0 + column
    np.save(folder / "data" / "1000.npy", np.random.default_rng(1).permutation(points))
    # Of "even" the body is an IMU's frame, whose readings were left out.
    index = {"body": "imu0" if kind == "even" else "base_link", "gravity_m_s2": 3.7}
    index["transforms"] = dict.fromkeys(("imu0", "lidar1"), np.eye(4).ravel().tolist())
    (tmp_path / "dataset.json").write_text(json.dumps(index))
    done = subprocess.run(
        [sys.executable, DRIVER, tmp_path, tmp_path / "out.tum", "lidar1", "Fake"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)}, cwd=tmp_path,
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    head, *lines = done.stdout.splitlines()
    assert head.split() == [str(rings), str(columns), "0.9", "130.0"]
    told = np.array([line.split() for line in lines], float)
    assert len(told) == rings * columns if kind != "snapshot" else len(told) > 0
    np.testing.assert_array_equal(told[:, 2], told[:, 0] * columns + told[:, 1])
    if kind == "snapshot":
        turn = np.pi - 2.0 * np.pi * told[:, 1] / columns
        np.testing.assert_allclose(told[:, 3], 5.0 * np.cos(turn), atol=2e-3)
    else:
        np.testing.assert_array_equal(told[:, 3], 1.0 + told[:, 1])
        np.testing.assert_array_equal(told[:, 5], 1000.0 * told[:, 3])
        np.testing.assert_allclose(told[:, 4] / 1e9, told[:, 1] * column_s, atol=40e-6)
    assert float((tmp_path / "own_s.txt").read_text()) > 0.0
