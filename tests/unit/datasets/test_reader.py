"""Reading the master recording: what is there, and one clear line for what is broken."""

from __future__ import annotations

import json
import shutil
from functools import partial

import numpy as np
import pytest
from PIL import Image

from terrain_forge.base import DataError
from terrain_forge.datasets import open_recording
from terrain_forge.datasets.reader import BASE
from tests.helpers.recordings import (
    BASELINE,
    EPOCH,
    FACTOR,
    IMU,
    LIDAR,
    base_pose,
    on_plane,
    pixel_rays,
)


def test_what_was_recorded_is_read(recording):
    assert [one.key for one in recording.sensors] == ["cam0", "cam1", "lidar0", "imu0"]
    assert recording.sensor("stereo_left") is recording.sensor("cam0")
    assert recording.gravity == 3.711
    assert recording.body_name == "imu0"
    (pair,) = recording.pairs
    assert pair.rectified
    assert pair.baseline == pytest.approx(BASELINE, abs=1e-12)
    assert recording.imus[0].stamps[1] == EPOCH + 5_000_000
    np.testing.assert_allclose(recording.base_from_body, IMU, atol=1e-15)
    pose = recording.base_poses.matrices[40]
    np.testing.assert_allclose(pose, base_pose(0.2), atol=1e-12)


def test_exposures_are_those_of_the_pictures(recording, tmp_path):
    shutil.copytree(recording.folder, tmp_path / "dataset")
    (camera, _) = open_recording(tmp_path).cameras
    path, stamps = camera.folder / "exposure.csv", camera.stamps.tolist()
    head = "#timestamp [ns],exposure [s],gain []"
    rows = [f"{stamp},{0.001 * (n + 1)},1.0" for n, stamp in enumerate(stamps)]
    for lines, message in (
        (None, "no such file: cam0/exposure.csv"),
        ([head, *rows[1:]], "cam0/exposure.csv has no time and gain above 0 at each stamp"),
        ([head, rows[0].replace("1.0", "nan"), *rows[1:]], "no time and gain above 0"),
    ):
        if lines:
            path.write_text("\n".join(lines))
        with pytest.raises(DataError, match=message):
            _ = camera.exposures
    path.write_text("\n".join([head, *rows]))
    np.testing.assert_allclose(camera.exposures[:, 0], 0.001 * np.arange(1, 6))
    assert (camera.exposures[:, 1] == 1.0).all()


@pytest.mark.parametrize("number", [-1, 100, 1.5, None])
def test_a_measurement_that_is_not_there_is_told(recording, number):
    with pytest.raises(DataError, match=rf"^cam1 has no measurement {number}: 0 to \d+$"):
        recording.cameras[1].image(number)


def test_depth_is_on_the_plane(recording):
    camera = recording.cameras[1]
    depth, pose = camera.depth(2), recording.truth_of(camera).matrices[2]
    expected = np.nan_to_num(on_plane(pose, pixel_rays()))
    near = depth > 0
    assert near.sum() > 2000
    assert np.abs(depth - expected)[near].max() <= 0.5 / FACTOR + 1e-12


def test_poses_between_samples_are_those_of_the_motion(recording):
    """At times of their own: a cubic through samples 5 ms apart."""
    stamps = EPOCH + np.arange(1_234_567, 990_000_000, 7_654_321)
    found = recording.body_poses.carrying(recording.lidars[0].body_pose).at(stamps).matrices
    expected = np.array([base_pose((t - EPOCH) * 1e-9) @ LIDAR for t in stamps.tolist()])
    np.testing.assert_allclose(found, expected, atol=1e-8)
    assert not recording.body_poses.covers(EPOCH, EPOCH + 1_000_000_001)


def test_a_gap_of_the_truth_is_not_bridged(recording):
    poses = recording.body_poses
    half = type(poses)(
        stamps=np.delete(poses.stamps, slice(80, 90)),
        position=np.delete(poses.position, slice(80, 90), 0),
        quaternion=np.delete(poses.quaternion, slice(80, 90), 0),
    )
    assert half.covers(EPOCH, EPOCH + 390_000_000)
    with pytest.raises(DataError, match="does not tell all of them"):
        half.at(np.array([EPOCH + 420_000_000]))


def _cut(path, lines):
    path.write_text("\n".join(path.read_text().split("\n")[:lines]))


def _index(folder, **changes):
    about = json.loads((folder / "dataset.json").read_text())
    (folder / "dataset.json").write_text(json.dumps(about | changes))


def _stream(folder, **changes):
    about = json.loads((folder / "dataset.json").read_text())
    about["streams"][0] |= changes
    (folder / "dataset.json").write_text(json.dumps(about))


def _swap(path, old, new, *, count=1):
    path.write_text(path.read_text().replace(old, new, count))


BROKEN = {
    "no index": (lambda f: (f / "dataset.json").unlink(), "holds no recording .no dataset.json."),
    "index cut": (lambda f: _cut(f / "dataset.json", 5), "dataset.json cannot be read"),
    "version": (lambda f: _index(f, version=9), "version 9, this terrain-forge reads 1"),
    "world without a name": (lambda f: _index(f, world={"Wame": "x"}), "no name of the world"),
    "sensors": (lambda f: _index(f, sensors=[3]), "its sensors are no tables"),
    **{
        f"{key}: {odd}": (partial(_index, **{key: odd}), f"{key!r} is not of the kind")
        for key, odd in (
            ("sensors", 3),
            ("links", []),
            ("moving_links", 3),
            ("motion", "x"),
            ("profile", {}),
        )
    },
    "class": (lambda f: _index(f, classes={"rock": "1"}), "its classes are no numbers"),
    "channels": (
        lambda f: _index(
            f,
            streams=[{"folder": "mav0/imu0", "name": "a", "kind": "imu", "channels": {"data": 3}}],
        ),
        "stream 0: channel 'data' is no table of keys",
    ),
    "channel": (
        lambda f: _index(
            f,
            streams=[
                {
                    "folder": "mav0/imu0",
                    "name": "a",
                    "kind": "imu",
                    "channels": {"data": {"suffix": 3}},
                }
            ],
        ),
        "stream 0: channel 'data': its 'suffix' is not of the kind that it must be",
    ),
    **{
        f"stream's {key}": (
            partial(_stream, **{key: odd}),
            f"stream 0: its {key!r} is not of the kind",
        )
        for key, odd in (("count", "3"), ("last_ns", 0.5), ("channels", [1]), ("name", 3))
    },
    "motion's duration": (
        lambda f: _index(f, motion={"duration_s": "x"}),
        "motion: its 'duration_s' is not of the kind",
    ),
    "outside": (
        lambda f: _index(f, streams=[{"folder": "../x", "name": "a", "kind": "imu"}]),
        "lies outside of the dataset",
    ),
    "no calibration": (
        lambda f: (f / "mav0/cam0/sensor.yaml").unlink(),
        "no such file: cam0/sensor.yaml",
    ),
    "model": (
        lambda f: _swap(f / "mav0/cam0/sensor.yaml", '"none"', '"fov"'),
        "distortion_model of cam0/sensor.yaml: 'fov', there are: radtan, equidistant, none",
    ),
    "no picture": (
        lambda f: (f / f"mav0/cam0/data/{EPOCH}.png").unlink(),
        f"no such file: cam0/data/{EPOCH}.png",
    ),
    "picture cut": (
        lambda f: (f / f"mav0/cam0/data/{EPOCH}.png").write_bytes(b"\x89PNG"),
        f"cam0/data/{EPOCH}.png cannot be read",
    ),
    "sweep cut": (
        lambda f: (f / f"mav0/lidar0/data/{EPOCH}.npy").write_bytes(b"\x93NUMPY"),
        f"lidar0/data/{EPOCH}.npy cannot be read",
    ),
    "sweep of objects": (
        lambda f: np.save(f / f"mav0/lidar0/data/{EPOCH}.npy", np.array([{}]), allow_pickle=True),
        f"lidar0/data/{EPOCH}.npy cannot be read",
    ),
    "sweep that claims more": (
        lambda f: np.lib.format.open_memmap(
            f / f"mav0/lidar0/data/{EPOCH}.npy", "w+", "f4", (10**6,)
        ).base.resize(200),
        f"lidar0/data/{EPOCH}.npy cannot be read",
    ),
    "endless CRS": (
        lambda f: _index(f, world={"name": "plane", "crs": "a" * 70_000}),
        "dataset.json: the world's CRS is no WKT of at most 60000 bytes",
    ),
    "stream twice": (
        lambda f: _index(f, streams=2 * [{"folder": "mav0/imu0", "name": "a", "kind": "imu"}]),
        "the stream 'mav0/imu0' is listed 2 times",
    ),
    "stamp of 20 digits": (
        lambda f: _swap(f / "mav0/cam0/data.csv", f"\n{EPOCH},", f"\n9{EPOCH},"),
        "cam0/data.csv cannot be read",
    ),
    "order": (
        lambda f: _swap(f / "mav0/imu0/data.csv", f"{EPOCH + 5_000_000},", f"{EPOCH - 5},"),
        "imu0/data.csv: the stamp of row 2 is not after",
    ),
    "before 0": (
        lambda f: _swap(f / "mav0/imu0/data.csv", f"\n{EPOCH},", "\n-5,"),
        "imu0/data.csv: the stamp -5 is before 0",
    ),
    "grey among colours": (
        lambda f: Image.new("RGB", (64, 48)).save(f / f"mav0/cam0/data/{EPOCH + 200_000_000}.png"),
        "is of mode RGB, others beside it L",
    ),
    "words": (
        lambda f: _swap(f / "mav0/imu0/data.csv", "0.02", "much"),
        "imu0/data.csv cannot be read",
    ),
    "name": (
        lambda f: _swap(f / "mav0/cam0/data.csv", f",{EPOCH}.png", ",../../secret.png"),
        r"cam0/data.csv:2: '\.\./\.\./secret\.png' is no file's name",
    ),
    "bytes": (
        lambda f: (f / "mav0/imu0/data.csv").write_bytes(b"#timestamp,a\n\xc3\x28"),
        "imu0/data.csv cannot be read: .*invalid continuation byte",
    ),
    "line": (
        lambda f: (f / "mav0/imu0/data.csv").write_text("#timestamp,a\n" + "1" * 20_000),
        "imu0/data.csv: a line has more than 10,000 characters",
    ),
    "line of names": (
        lambda f: (f / "mav0/cam0/data.csv").write_bytes(bytes(20_000)),
        "cam0/data.csv: a line has more than 10,000 characters",
    ),
    "line of truth": (
        lambda f: (f / "truth/cam0.tum").write_bytes(bytes(20_000)),
        "truth/cam0.tum: a line has more than 10,000 characters",
    ),
    "truth": (
        lambda f: _cut(f / "truth/cam0.tum", 3),
        "truth/cam0.tum is not at the stamps of cam0",
    ),
}


def _read_all(folder):
    found = open_recording(folder)
    for camera in found.cameras:
        camera.distortion, camera.image(0), camera.image(1), camera.depth(0), found.truth_of(camera)
    found.lidars[0].sweep(0)
    assert len(found.imus[0].table[0]) == len(found.body_poses)


def test_a_key_of_null_says_no_more_than_none(recording, tmp_path):
    folder = tmp_path / "dataset"
    shutil.copytree(recording.folder, folder)
    index = json.loads((folder / "dataset.json").read_text())
    left_out = dict.fromkeys(("sensors", "links", "moving_links", "motion", "profile"))
    streams = [one | {"channels": None} for one in index["streams"]]
    (folder / "dataset.json").write_text(json.dumps(index | left_out | {"streams": streams}))
    found = open_recording(folder)
    assert {found.link_of(one.key) for one in found.sensors} == {BASE}
    assert not found.recipe_of(found.sensors[0])
    assert left_out.keys().isdisjoint(found.about)
    assert [*found.sensors[0].channels] == ["data"]


@pytest.mark.parametrize("what", BROKEN)
def test_what_is_broken_is_told_in_one_line(recording, tmp_path, what):
    folder = tmp_path / "dataset"
    shutil.copytree(recording.folder, folder)
    _read_all(tmp_path)
    spoil, message = BROKEN[what]
    spoil(folder)
    with pytest.raises(DataError, match=message) as caught:
        _read_all(folder)
    assert "\n" not in str(caught.value)
