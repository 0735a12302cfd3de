"""What formats are said to take, and what they take: recordings of small pictures and sweeps."""

from __future__ import annotations

import re
import shutil
from functools import partial

import pytest

import terrain_forge as tf
from terrain_forge.base import StorageError
from terrain_forge.model import sensor_kinds
from tests.helpers import worlds
from tests.helpers.rovers import morpheus

_MAST = {"position_m": (0.3, 0.0, 0.9), "rpy_deg": (0.0, 20.0, 0.0)}
_PAIR = {"name": "pair", "rate_hz": 5.0, "width_px": 160, "height_px": 120, **_MAST}
_FORMATS = {
    "kitti": {},
    "tum": {},
    "lusnar": {},
    "clouds": {},
    "rosbag1": {},
    "rosbag2": {"depth": True},
}


def _world(**more):
    kinds = sensor_kinds()
    sensors = (
        kinds["stereo"](**_PAIR, channels=("depth", "class"), **more),
        kinds["lidar"](name="lidar", rate_hz=2.0, horizontal_samples=600, position_m=(0, 0, 1)),
        kinds["imu"](name="imu", rate_hz=100.0),
        kinds["odometry"](name="wheels"),
    )
    return worlds.world(rocks=3, rover=morpheus().replace(sensors=sensors))


def _size(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


_OTHERS = {
    "kitti": {"scans": False},
    "clouds": {"encoding": "laz", "lidar": "lidar"},
    "rosbag1": {"sensors": ("imu", "lidar"), "cloud": "ouster", "truth": "both"},
    "rosbag2": {"storage": "sqlite3"},
}


slow = partial(pytest.param, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("more", "every"),
    [
        slow({}, _FORMATS),
        slow({"bits": 12}, _FORMATS),
        slow({"colour": True}, _FORMATS),
        slow({"depth_factor": None}, _FORMATS),
        ({"images": ("raw", "rectified")}, _OTHERS),
        ({}, {"clouds": {"map": True}, "rosbag2": {"compression": "zstd"}}),
    ],
)
def test_a_disk_is_asked_for_what_formats_take(more, every, tmp_path, monkeypatch):
    world, usage, told = _world(**more), shutil.disk_usage(tmp_path), {}
    span = {"begin": 4.0, "end": 7.0, "still_s": 0.0}
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=0))
        for name in ("euroc", *every):
            formats = {name: every.get(name, {})}
            with pytest.raises(StorageError, match="needs about") as refused:
                tf.record(world, tmp_path / name, formats=formats, **span)
            number, unit = re.search(r"needs about ([\d.]+) (k|M)?B", str(refused.value)).groups()
            told[name] = float(number) * {"k": 1e3, "M": 1e6, None: 1.0}[unit]
    done = tf.record(world, tmp_path, formats=every, **span)
    for name in every:
        taken = _size(done.folder / name)
        assert taken / 1.3 < told[name] - told["euroc"] < 1.3 * taken, name
