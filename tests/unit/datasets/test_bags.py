"""ROS bags, read back by the libraries that others read them with."""

from __future__ import annotations

import json
import re
from collections import Counter

import numpy as np
import pytest

from terrain_forge.base import ExportError, placed
from terrain_forge.datasets import write_dataset
from tests.helpers.recordings import (
    BASELINE,
    FOCAL,
    GRAVITY,
    IMU,
    LEFT,
    LIDAR,
    SPEED,
    TURN,
    base_pose,
    write_recording,
)

KINDS = {
    "rosbag1": ("rosbag1", {"depth": True, "truth": "both"}),
    "mcap": ("rosbag2", {"truth": "both", "depth": True}),
    "zstd": ("rosbag2", {"truth": "both", "depth": True, "compression": "zstd"}),
    "sqlite3": ("rosbag2", {"storage": "sqlite3", "truth": "both", "depth": True}),
}
COUNTS = {
    "/tf_static": 1, "/cam0/camera_info": 5, "/cam0/image_raw": 5, "/cam0/depth/image_raw": 5,
    "/cam1/camera_info": 5, "/cam1/image_raw": 5, "/cam1/depth/image_raw": 5,
    "/cam0/depth/camera_info": 5, "/cam1/depth/camera_info": 5,
    "/velodyne_points": 9, "/imu0": 201, "/ground_truth/odometry": 201, "/tf": 201,
}  # fmt: skip


def read_bag(folder, first):
    """(topic, time, message) of all messages, by rosbags' own reader."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    path = folder / "recording.bag" if first else folder
    with AnyReader([path], default_typestore=store) as bag:
        return [
            (one.topic, time, bag.deserialize(data, one.msgtype))
            for one, time, data in bag.messages()
        ]


@pytest.fixture(scope="module", params=KINDS)
def bag(request, recording, tmp_path_factory):
    """A bag's messages, and its folder."""
    kind, options = KINDS[request.param]
    folder = tmp_path_factory.mktemp("bags") / "bag"
    write_dataset(recording, kind, folder, options)
    return read_bag(folder, kind == "rosbag1"), folder, kind, options


def test_ros_may_write_the_header_of_a_bag_anew(recording, tmp_path):
    """It does when it appends to a bag or reindexes it: 4096 bytes and two lengths, before all."""
    write_dataset(recording, "rosbag1", tmp_path / "bag", {"pictures": False})
    data = (tmp_path / "bag" / "recording.bag").read_bytes()
    start = len(b"#ROSBAG V2.0\n")
    size = int.from_bytes(data[start : start + 4], "little")
    padding = start + 4 + size
    assert size + int.from_bytes(data[padding : padding + 4], "little") == 4096
    assert not data[padding + 4 : start + 8 + 4096].strip(b" ")
    chunk = start + 8 + 4096
    header = data[chunk + 4 : chunk + 4 + int.from_bytes(data[chunk : chunk + 4], "little")]
    assert b"op=\x05" in header
    assert b"compression=none" in header


def messages(bag, topic):
    return [message for name, _, message in bag[0] if name == topic]


def seconds(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def pose_of(place, turn):
    from scipy.spatial.transform import Rotation

    found = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    return placed([place.x, place.y, place.z], found)


def points_of(cloud):
    kinds = {2: "u1", 4: "<u2", 6: "<u4", 7: "<f4"}
    kind = np.dtype(
        {
            "names": [f.name for f in cloud.fields],
            "formats": [kinds[f.datatype] for f in cloud.fields],
            "offsets": [f.offset for f in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    return np.frombuffer(cloud.data.tobytes(), kind)


def test_all_messages_are_there_in_the_order_of_their_stamps(bag):
    found, *_ = bag
    assert Counter(topic for topic, _, _ in found) == COUNTS
    assert found[0][0] == "/tf_static"
    assert [time for _, time, _ in found] == sorted(time for _, time, _ in found)
    for topic, time, message in found:
        header = message.transforms[0].header if "tf" in topic else message.header
        assert seconds(header.stamp) == time


def test_pictures_and_clouds_are_the_recorded_ones(bag, recording):
    for number, message in enumerate(messages(bag, "/cam1/image_raw")):
        assert (message.encoding, message.step) == ("mono8", message.width)
        pixels = message.data.reshape(message.height, message.width)
        np.testing.assert_array_equal(pixels, recording.cameras[1].image(number))
    depth = messages(bag, "/cam0/depth/image_raw")[3]
    metres = np.nan_to_num(depth.data.view("<f4").reshape(depth.height, depth.width))
    np.testing.assert_allclose(metres, recording.cameras[0].depth(3), rtol=1e-7)
    for number, message in enumerate(messages(bag, "/velodyne_points")):
        layout = [(f.name, f.offset) for f in message.fields]
        assert layout == [
            *(("x", 0), ("y", 4), ("z", 8), ("intensity", 12), ("ring", 16), ("time", 18))
        ]
        assert (message.height, message.point_step, message.is_dense) == (1, 22, True)
        sweep = recording.lidars[0].sweep(number)
        for name in ("x", "y", "z", "intensity", "ring", "time"):
            np.testing.assert_array_equal(points_of(message)[name], sweep[name])


def test_calibration_and_frames(bag, recording):
    (static,) = messages(bag, "/tf_static")
    mounts = {t.child_frame_id: t for t in static.transforms}
    assert {t.header.frame_id for t in static.transforms} == {"base_link"}
    for name, mount in {"stereo_left_optical": LEFT, "lidar": LIDAR, "imu": IMU}.items():
        moved = mounts[name].transform
        np.testing.assert_allclose(pose_of(moved.translation, moved.rotation), mount, atol=1e-12)
    left, right = (messages(bag, f"/cam{n}/camera_info")[0] for n in (0, 1))
    projection = right.P if bag[2] == "rosbag1" else right.p
    assert projection[3] == pytest.approx(-FOCAL * BASELINE)
    names = [messages(bag, f"/cam{n}/image_raw")[0].header.frame_id for n in (0, 1)]
    assert {left.header.frame_id, right.header.frame_id, *names} == {"stereo_left_optical"}
    assert left.distortion_model == "plumb_bob"
    assert list(left.K if bag[2] == "rosbag1" else left.k)[:3] == [FOCAL, 0, 31.5]


def test_depth_is_of_the_pictures_and_the_lens_beside_it(tmp_path):
    """Of rectified pictures where both were recorded: with no distortion, and the pictures."""
    bent = {"distortion_model": "radial-tangential", "distortion_coefficients": [-0.2, 0, 0, 0]}
    folder = write_recording(tmp_path / "dataset", seconds=0.2, lidar=False, **bent)
    write_dataset(folder, "rosbag2", tmp_path / "raw", {"depth": True})
    found = {topic: m for topic, _, m in read_bag(tmp_path / "raw", False)}
    assert found["/cam0/depth/camera_info"].d[0] == found["/cam0/camera_info"].d[0] == -0.2
    assert {"/cam0/image_raw", "/cam0/depth/image_raw"} < found.keys()
    _add_rectified(folder)
    write_dataset(folder, "rosbag2", tmp_path / "both", {"depth": True})
    found = {topic: m for topic, _, m in read_bag(tmp_path / "both", False)}
    assert {"/cam0/image_raw", "/cam0/image_rect", "/cam0/depth/image_rect"} < found.keys()
    assert "/cam0/depth/image_raw" not in found
    assert found["/cam0/camera_info"].d[0] == -0.2
    for camera in ("cam0", "cam1"):
        info = found[f"/{camera}/depth/camera_info"]
        assert not info.d.any()
        np.testing.assert_array_equal(info.p.reshape(3, 4)[:, :3], info.k.reshape(3, 3))
        assert info.p[3] == 0.0
        assert info.header == found[f"/{camera}/depth/image_rect"].header
    picture = found["/cam0/image_rect"]
    assert set(picture.data) == {77}
    assert set(found["/cam0/image_raw"].data) != {77}
    write_dataset(folder, "rosbag2", tmp_path / "none")
    assert not [t for t, *_ in read_bag(tmp_path / "none", False) if "rect" in t or "depth" in t]


def _add_rectified(folder):
    """Pictures of 77, as if of `images: [raw, rectified]`."""
    from PIL import Image

    for key in ("cam0", "cam1"):
        (folder / f"mav0/{key}/rectified").mkdir()
        for path in (folder / f"mav0/{key}/data").iterdir():
            grey = np.full_like(np.asarray(Image.open(path)), 77)
            Image.fromarray(grey).save(folder / f"mav0/{key}/rectified/{path.name}")
    index = folder / "dataset.json"
    told = index.read_text().replace('"depth": {', '"rectified": {}, "depth": {')
    index.write_text(told)


def test_frames_have_names_of_ros(tmp_path):
    folder = write_recording(tmp_path / "dataset", seconds=0.2)
    index = folder / "dataset.json"
    told = (
        index.read_text().replace('"stereo_left"', '"links-ä"').replace('"imu",', '"gyro-box",', 1)
    )
    index.write_text(told)
    losses = write_dataset(folder, "rosbag2", tmp_path / "bag").losses
    assert any(loss.endswith("own: links-ä (cam0_optical), gyro-box (imu0).") for loss in losses)
    bag = read_bag(tmp_path / "bag", False)
    static = {t.child_frame_id for name, _, m in bag if name == "/tf_static" for t in m.transforms}
    assert static == {"cam0_optical", "stereo_right_optical", "lidar", "imu0"}
    for topic, frame in {"/cam0/image_raw": "cam0_optical", "/imu0": "imu0"}.items():
        assert next(m for name, _, m in bag if name == topic).header.frame_id == frame


@pytest.mark.parametrize(
    ("names", "frames"),
    [
        ({"stereo_left": "ä", "stereo_right": "cam0"}, {"cam0_2_optical", "cam0_optical"}),
        ({"stereo_left": "x", "imu": "x_optical"}, {"x_optical", "imu0"}),
        ({"imu": "i u", "lidar": "imu0"}, {"imu0_2", "imu0"}),
    ],
)
def test_no_two_sensors_share_a_frame(tmp_path, names, frames):
    folder = write_recording(tmp_path / "dataset", seconds=0.2)
    index = json.loads((folder / "dataset.json").read_text())
    for stream in index["streams"]:
        stream["name"] = names.get(stream["name"], stream["name"])
    (folder / "dataset.json").write_text(json.dumps(index))
    write_dataset(folder, "rosbag2", tmp_path / "bag")
    bag = read_bag(tmp_path / "bag", False)
    static = [t.child_frame_id for name, _, m in bag if name == "/tf_static" for t in m.transforms]
    assert len(set(static)) == len(static) == 4
    assert frames <= set(static)
    told = {m.header.frame_id for name, _, m in bag if hasattr(m, "header")}
    assert told - {"map"} <= set(static)


def test_imu_and_truth(bag, recording):
    first = messages(bag, "/imu0")[100]
    assert first.orientation_covariance[0] == -1
    assert (first.angular_velocity.z, first.linear_acceleration.z) == (TURN, GRAVITY)
    assert first.linear_acceleration_covariance[4] == pytest.approx(2e-3**2 * 200)
    odometry, tf = messages(bag, "/ground_truth/odometry"), messages(bag, "/tf")
    for number in (0, 100, 200):
        expected = base_pose(number * 0.005)
        pose = odometry[number].pose.pose
        np.testing.assert_allclose(pose_of(pose.position, pose.orientation), expected, atol=1e-9)
        moved = tf[number].transforms[0].transform
        np.testing.assert_allclose(pose_of(moved.translation, moved.rotation), expected, atol=1e-9)
    assert odometry[0].child_frame_id == "base_link"
    twist = odometry[100].twist.twist
    assert np.hypot(twist.linear.x, twist.linear.y) == pytest.approx(SPEED, abs=1e-4)
    assert twist.linear.x == pytest.approx(SPEED, abs=1e-2)
    assert twist.angular.z == pytest.approx(TURN, abs=2e-3)


@pytest.mark.parametrize("kind", [k for k in KINDS if KINDS[k][0] == "rosbag2" and k != "sqlite3"])
def test_the_library_of_mcap_reads_the_same(kind, recording, tmp_path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    write_dataset(recording, "rosbag2", tmp_path / "bag", KINDS[kind][1])
    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = [(c.topic, m.log_time, d) for _, c, m, d in reader.iter_decoded_messages()]
    assert Counter(topic for topic, _, _ in found) == COUNTS
    theirs = [m for topic, _, m in found if topic == "/velodyne_points"]
    ours = [m for t, _, m in read_bag(tmp_path / "bag", False) if t == "/velodyne_points"]
    for one, other in zip(theirs, ours, strict=True):
        assert bytes(one.data) == other.data.tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_bytes_repeat(kind, recording, tmp_path):
    name, options = KINDS[kind]
    both = [tmp_path / number / "bag" for number in ("one", "two")]
    for folder in both:
        write_dataset(recording, name, folder, options)
    one, two = ({p.name: p.read_bytes() for p in folder.iterdir()} for folder in both)
    assert one == two


def test_layout_of_ouster(recording, tmp_path):
    write_dataset(recording, "rosbag2", tmp_path / "bag", {"cloud": "ouster", "sensors": ["lidar"]})
    found = read_bag(tmp_path / "bag", False)
    assert {t for t, _, _ in found} == {"/tf_static", "/ouster/points", "/ground_truth/odometry"}
    cloud = next(m for t, _, m in found if t == "/ouster/points")
    points, sweep = points_of(cloud), recording.lidars[0].sweep(0)
    assert points.dtype["ring"] == np.uint8
    assert cloud.point_step == 48
    np.testing.assert_allclose(points["t"] * 1e-9, sweep["time"], atol=1e-9)
    reach = np.sqrt(sum(sweep[a].astype(float) ** 2 for a in "xyz"))
    np.testing.assert_allclose(points["range"], 1000 * reach, atol=0.5)
    assert (np.diff(points["t"].astype(np.int64)) >= 0).all()


@pytest.mark.parametrize(
    ("figures", "options", "why"),
    [
        ({"rings": 300}, {}, "lidar has 300 rings, of which Ouster's layout holds 256"),
        ({"rate_hz": 0.2}, {}, "a sweep of lidar lasts 5 s, times of Ouster's layout end at 4.29"),
        ({"rings": 300}, {"ring_bits": 16}, ""),
        ({"rate_hz": 0.2, "snapshot": True}, {}, ""),
        ({"rings": 300, "rate_hz": 0.2}, {"cloud": "velodyne"}, ""),
        ({"rings": 300}, {"sensors": ["imu"]}, ""),
    ],
)
def test_what_the_layout_of_ouster_cannot_hold_is_refused(tmp_path, figures, options, why):
    """Numbers that are too large would begin anew at 0."""
    folder = write_recording(tmp_path / "dataset", seconds=0.4, preset="os1-64")
    path = folder / "mav0" / "lidar0" / "sensor.yaml"
    path.write_text(json.dumps(json.loads(path.read_text()) | figures))
    if not why:
        write_dataset(folder, "rosbag1", tmp_path / "bag", options)
        return
    with pytest.raises(ExportError, match=re.escape(why)):
        write_dataset(folder, "rosbag1", tmp_path / "bag", options)


def test_tables_of_other_sensors(tmp_path):
    folder = write_recording(tmp_path / "dataset", seconds=0.3, lidar=False, extras=True)
    report = write_dataset(folder, "rosbag1", tmp_path / "bag")
    assert not any("No message" in loss for loss in report.losses)
    found = {topic: message for topic, _, message in read_bag(tmp_path / "bag", True)}
    odometry = found["/odometry0"]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    pose = pose_of(odometry.pose.pose.position, odometry.pose.pose.orientation)
    turn = [[np.cos(0.5), -np.sin(0.5), 0], [np.sin(0.5), np.cos(0.5), 0], [0, 0, 1]]
    np.testing.assert_allclose(pose, placed([1, 2, 0], turn), atol=1e-12)
    covariance = odometry.pose.covariance.reshape(6, 6)
    np.testing.assert_array_equal(covariance, covariance.T)
    assert [covariance[0, 1], covariance[5, 5], covariance[2, 2]] == [0.02, 0.06, 1e6]
    assert odometry.twist.twist.angular.z == 0.125
    assert found["/sun0"].vector.z == 0.8
    assert found["/inclinometer0"].vector.y == -0.2


def test_a_rolling_shutter_is_lost(tmp_path):
    folder = write_recording(
        tmp_path / "dataset", seconds=0.2, electronics={"rolling_shutter_s": 0.02}
    )
    losses = write_dataset(folder, "rosbag2", tmp_path / "bag").losses
    assert any("rows of stereo_left, stereo_right are exposed one after" in one for one in losses)
