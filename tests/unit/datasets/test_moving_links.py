"""Sensors on a link that moves against base_link: the body itself, a lidar, cameras."""

from __future__ import annotations

import json

import numpy as np
import pytest

from terrain_forge.base import ExportError
from terrain_forge.datasets import open_recording, write_dataset
from tests.helpers.recordings import (
    EPOCH,
    LEFT,
    LIDAR,
    ON_ROVER,
    SPEED,
    TURN,
    base_pose,
    rocking_pose,
    write_recording,
)
from tests.unit.datasets.test_bags import pose_of, read_bag
from tests.unit.datasets.test_plain_formats import lifted, read_laz

CAMERAS = ("cam0", "cam1")


@pytest.fixture(scope="module")
def rocked(tmp_path_factory):
    """A recording whose sensors of some folders rock."""
    made = {}

    def recording(*keys):
        if keys not in made:
            folder = tmp_path_factory.mktemp("rocked")
            made[keys] = open_recording(write_recording(folder, rocking=keys))
        return made[keys]

    return recording


def transforms(bag, topic):
    return [one for name, _, m in bag if name == topic for one in m.transforms]


def stamp_of(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec - EPOCH


@pytest.mark.parametrize("kind", ["rosbag1", "rosbag2"])
def test_base_link_is_its_own_truth_where_the_body_rocks(kind, rocked, tmp_path):
    write_dataset(rocked("imu0"), kind, tmp_path / "bag", {"truth": "both"})
    bag = read_bag(tmp_path / "bag", kind == "rosbag1")
    odometry = [m for topic, _, m in bag if topic == "/ground_truth/odometry"]
    base = [one for one in transforms(bag, "/tf") if one.child_frame_id == "base_link"]
    assert len(odometry) == len(base) == 201
    for number in range(0, 201, 20):
        expected = base_pose(number * 0.005)
        pose, moved = odometry[number].pose.pose, base[number].transform
        for place, turn in (
            (pose.position, pose.orientation),
            (moved.translation, moved.rotation),
        ):
            np.testing.assert_allclose(pose_of(place, turn), expected, atol=1e-12)
    twist = odometry[100].twist.twist
    assert np.linalg.norm([getattr(twist.linear, a) for a in "xyz"]) == pytest.approx(
        SPEED, abs=1e-7
    )
    assert twist.angular.z == pytest.approx(TURN, abs=2e-3)


def test_frames_that_move_are_on_tf_alone(rocked, tmp_path):
    write_dataset(rocked("cam0", "imu0"), "rosbag2", tmp_path / "bag", {"truth": "none"})
    bag = read_bag(tmp_path / "bag", False)
    static = {one.child_frame_id for one in transforms(bag, "/tf_static")}
    assert static == {"stereo_right_optical", "lidar"}
    moving = transforms(bag, "/tf")
    assert {one.child_frame_id for one in moving} == {"stereo_left_optical", "imu"}
    stamps = [stamp_of(one.header) for one in moving]
    assert stamps == sorted(stamps)
    cameras = [one for one in moving if one.child_frame_id == "stereo_left_optical"]
    assert len(cameras) == 5
    for one in cameras:
        expected = rocking_pose(stamp_of(one.header) * 1e-9) @ LEFT
        found = pose_of(one.transform.translation, one.transform.rotation)
        np.testing.assert_allclose(found, expected, atol=1e-7)


@pytest.mark.parametrize("keys", [("imu0",), ("imu0", "lidar0"), CAMERAS])
def test_points_lie_on_the_plane_whatever_rocks(keys, rocked, tmp_path):
    """A lidar is fixed to base_link, to the body, or to both."""
    recording = rocked(*keys)
    write_dataset(recording, "clouds", tmp_path / "map", {"map": True, "encoding": "laz"})
    assert np.abs(read_laz(tmp_path / "map" / "lidar0.laz")["z"]).max() < 1e-4
    losses = write_dataset(recording, "kitti", tmp_path / "kitti").losses
    apart = ("lidar0" in keys) != ("cam0" in keys)
    assert any("moves against stereo_left" in loss for loss in losses) == apart
    place = tmp_path / "kitti"
    rows = (place / "sequences/00/calib.txt").read_text().splitlines()
    tr = np.array(rows[-1].split()[1:], float).reshape(3, 4)
    np.testing.assert_allclose(tr, (np.linalg.inv(LEFT) @ LIDAR)[:3], atol=1e-9)
    poses = np.loadtxt(place / "poses/00.txt").reshape(-1, 3, 4)
    first = recording.truth_of(recording.cameras[0]).matrices[0]
    for number, pose in enumerate(poses):
        scan = np.fromfile(place / f"sequences/00/velodyne/{number:06d}.bin", "<f4").reshape(-1, 4)
        own = np.abs(scan[:, :3] - np.float32(ON_ROVER)).max(axis=1) < 1e-6
        seen = first @ np.vstack([pose, [0, 0, 0, 1]]) @ np.vstack([tr, [0, 0, 0, 1]])
        assert np.abs(lifted(scan[~own, :3].astype(float), seen)[:, 2]).max() < 1e-5


@pytest.mark.parametrize("options", [{"map": True}, {"deskew": True}])
def test_a_lidar_that_rocks_without_the_body_is_refused(options, rocked, tmp_path):
    with pytest.raises(ExportError, match=r"'lidar' cannot be followed .* it sits on 'rocker'"):
        write_dataset(rocked("lidar0"), "clouds", tmp_path / "out", options)
    assert write_dataset(rocked("lidar0"), "clouds", tmp_path / "raw").files


def test_two_eyes_that_move_against_each_other_are_no_pair(rocked):
    assert len(rocked(*CAMERAS).pairs) == 1
    assert rocked("cam0").pairs == ()


def test_calibration_says_what_moves_against_the_body(rocked, tmp_path):
    """By as much as the link rocks, at the camera's own stamps."""
    losses = write_dataset(rocked("cam0"), "calibration", tmp_path / "out").losses
    off = [np.linalg.inv(LEFT) @ rocking_pose(0.2 * n) @ LEFT for n in range(5)]
    far = max(np.linalg.norm(one[:3, 3]) for one in off)
    turned = max(np.degrees(0.2 * np.sin(0.4 * n)) for n in range(5))
    told = f"cam0 moves against imu0 by up to {far:.3f} m, {turned:.1f}°: its calibration is that"
    assert losses == (f"{told} at rest.",)
    text = (tmp_path / "out" / "README.txt").read_text()
    assert told in " ".join(text.split())
    every = write_dataset(rocked("imu0"), "calibration", tmp_path / "all").losses
    assert [loss.split()[0] for loss in every] == ["cam0", "cam1", "lidar0"]


def test_links_of_recordings_that_do_not_list_them(rocked, tmp_path):
    """Those of earlier versions tell a link in the recipe's sensors, a pair's under one name."""
    folder = write_recording(tmp_path, seconds=0.2, lidar=False)
    about = json.loads((folder / "dataset.json").read_text())
    del about["links"]
    about["sensors"] = [{"name": "stereo", "link": "rocker"}, {"name": "imu", "link": "base_link"}]
    about["moving_links"] = ["rocker"]
    (folder / "dataset.json").write_text(json.dumps(about))
    recording = open_recording(folder)
    links = [recording.link_of(key) for key in (*CAMERAS, "imu0", "none")]
    assert links == ["rocker", "rocker", "base_link", "base_link"]
