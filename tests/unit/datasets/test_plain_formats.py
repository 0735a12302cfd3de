"""Folders of plain files, read by few lines of our own and by the clouds' own libraries."""

from __future__ import annotations

import json
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from rasterio.crs import CRS

from terrain_forge.base import ExportError, RecipeError
from terrain_forge.datasets import (
    calibration_files,
    dataset_kind,
    open_recording,
    pair_of,
    write_dataset,
)
from terrain_forge.datasets.clouds import LidarMotion
from terrain_forge.datasets.point_files import PointFile, points_of
from terrain_forge.writers import write_png
from tests.helpers.recordings import (
    BASELINE,
    EPOCH,
    FOCAL,
    ON_ROVER,
    base_pose,
    pixel_rays,
    write_recording,
)

ON_PLANE = 1e-5
"""How far a point in 32 bits may be off the plane [m]."""


def test_formats_and_calibration_take_one_pair(tmp_path):
    """The second, as the pictures of the first have distortion."""
    dataset = write_recording(tmp_path / "dataset", lidar=False)
    index = json.loads((dataset / "dataset.json").read_text())
    for side, (was, now) in enumerate({"cam0": "cam2", "cam1": "cam3"}.items()):
        shutil.copytree(dataset / "mav0" / was, dataset / "mav0" / now)
        shutil.copy(dataset / "truth" / f"{was}.tum", dataset / "truth" / f"{now}.tum")
        about = json.loads((dataset / "mav0" / now / "sensor.yaml").read_text())
        about["T_BS"]["data"][11] += 0.5  # higher up
        about["intrinsics"][0] = about["intrinsics"][1] = 2.0 * FOCAL
        (dataset / "mav0" / now / "sensor.yaml").write_text(json.dumps(about))
        bent = json.loads((dataset / "mav0" / was / "sensor.yaml").read_text())
        bent |= {"distortion_model": "radtan", "distortion_coefficients": [-0.1, 0.01, 0, 0]}
        (dataset / "mav0" / was / "sensor.yaml").write_text(json.dumps(bent))
        stream = {"folder": f"mav0/{now}", "name": now, "kind": "camera", "channels": {"data": {}}}
        index["streams"].insert(2 + side, stream)
        index["transforms"][now] = index["transforms"][was]
    (dataset / "dataset.json").write_text(json.dumps(index))
    recording = open_recording(dataset)
    assert recording.pairs[0].left.key == "cam0"
    assert pair_of(recording).left.key == "cam2"
    write_dataset(recording, "kitti", tmp_path / "kitti")
    assert f"P0: {2.0 * FOCAL:.12e}" in (tmp_path / "kitti/sequences/00/calib.txt").read_text()
    files = calibration_files(recording)
    words = {"orbslam2/stereo_kitti.yaml": "Camera", "orbslam3/stereo.yaml": "Camera1"}
    for name, word in words.items():
        (line,) = [one for one in files[name].decode().splitlines() if one.startswith(f"{word}.fx")]
        assert float(line.split()[1]) == 2.0 * FOCAL
    assert "mav0/cam2/data" in files["README.txt"].decode().replace("\n", " ")


def read_tum(path):
    """Stamps [s] and poses, shape [n, 4, 4]."""
    from scipy.spatial.transform import Rotation

    rows = np.loadtxt(path, ndmin=2)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(rows[:, 4:]).as_matrix()
    poses[:, :3, 3] = rows[:, 1:4]
    return rows[:, 0], poses


def lifted(points, pose):
    """Points in the world."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def depth_points(depth):
    """Points of the pixels that have depth, in the optical frame."""
    return (pixel_rays() * depth[..., None])[depth > 0]


def test_kitti(recording, tmp_path):
    """Scans, by Tr and the poses, lie on the plane at the pictures' times."""
    losses = write_dataset(recording, "kitti", tmp_path / "out").losses
    assert any("nearest to its picture" in loss for loss in losses)
    place = tmp_path / "out" / "sequences" / "00"
    rows = dict(line.split(": ") for line in (place / "calib.txt").read_text().splitlines())
    matrices = {k: np.array(v.split(), float).reshape(3, 4) for k, v in rows.items()}
    np.testing.assert_allclose(matrices["P0"][:, :3], recording.cameras[0].matrix)
    assert matrices["P1"][0, 3] == pytest.approx(-FOCAL * BASELINE)
    times = np.loadtxt(place / "times.txt")
    np.testing.assert_allclose(times, 0.2 * np.arange(5), atol=1e-9)
    poses = np.loadtxt(tmp_path / "out" / "poses" / "00.txt").reshape(-1, 3, 4)
    first = recording.truth_of(recording.cameras[0]).matrices[0]
    for number in range(5):
        for side, camera in enumerate(recording.cameras):
            picture = np.asarray(Image.open(place / f"image_{side}" / f"{number:06d}.png"))
            np.testing.assert_array_equal(picture, camera.image(number))
        scan = np.fromfile(place / "velodyne" / f"{number:06d}.bin", "<f4").reshape(-1, 4)
        own = np.abs(scan[:, :3] - np.float32(ON_ROVER)).max(axis=1) < 1e-6
        assert own.sum() == 1
        pose = np.vstack([poses[number], [0, 0, 0, 1]])
        seen = first @ pose @ np.vstack([matrices["Tr"], [0, 0, 0, 1]])
        assert np.abs(lifted(scan[~own, :3].astype(float), seen)[:, 2]).max() < ON_PLANE
        assert 0.09 < scan[:, 3].min() <= scan[:, 3].max() < 0.14


def test_a_snapshot_lidar_scans_at_a_sweep_s_begin(tmp_path):
    """A sweep at a picture's own time is that picture's scan, and the truth needs reach no more."""
    recording = open_recording(write_recording(tmp_path / "recording", snapshot=True))
    write_dataset(recording, "kitti", tmp_path / "out")
    (lidar,), camera = recording.lidars, recording.cameras[0]
    for number, stamp in enumerate(camera.stamps.tolist()):
        path = tmp_path / "out" / "sequences" / "00" / "velodyne" / f"{number:06d}.bin"
        scan = np.fromfile(path, "<f4").reshape(-1, 4)
        sweep = lidar.sweep(lidar.stamps.tolist().index(stamp))
        own = np.stack([sweep[name] for name in "xyz"], axis=-1)
        np.testing.assert_allclose(scan[:, :3], own, atol=1e-5)
    motion, end = LidarMotion(recording, lidar), recording.body_poses.stamps[-1]
    assert motion.covers(int(end))
    assert not motion.covers(int(end) + 1)


@pytest.mark.parametrize("factor", [5000, 1000])
def test_tum(recording, tmp_path, factor):
    options = {"depth_factor": factor, "camera": "stereo_right"}
    write_dataset(recording, "tum", tmp_path / "out", options)
    stamps, poses = read_tum(tmp_path / "out" / "groundtruth.txt")
    lists = {
        kind: [
            line.split()
            for line in (tmp_path / "out" / f"{kind}.txt").read_text().splitlines()
            if line[0] != "#"
        ]
        for kind in ("rgb", "depth", "associations")
    }
    assert [a + b for a, b in zip(lists["rgb"], lists["depth"], strict=True)] == lists[
        "associations"
    ]
    assert lists["rgb"][1][0] == "1600000000.200000000"
    for (_, name), stamp, pose in zip(lists["depth"], stamps, poses, strict=True):
        picture = Image.open(tmp_path / "out" / name)
        assert picture.mode.startswith("I")
        seen = lifted(depth_points(np.asarray(picture) / factor), pose)
        assert len(seen) > 2000
        assert np.abs(seen[:, 2]).max() < 1.5e-3  # half a millimetre along a slanted ray
        assert f"{stamp:.1f}" in name


def test_what_is_too_far_for_tum_is_told(tmp_path):
    folder = write_recording(tmp_path / "dataset", seconds=0.2, lidar=False)
    path = folder / f"mav0/cam0/depth/{EPOCH}.png"
    depth = np.array(Image.open(path))
    depth[:3] = 20_000
    Image.fromarray(depth).save(path)
    losses = write_dataset(folder, "tum", tmp_path / "out").losses
    assert "6.2% of the pixels are farther than 13.107 m: 0." in losses
    written = np.asarray(Image.open(next((tmp_path / "out" / "depth").iterdir())))
    assert not written[:3].any()


def test_lusnar_takes_the_first_pair_that_has_what_it_needs():
    def pair(name, *channels):
        left, right = (SimpleNamespace(key=k, name=k, channels=channels) for k in (name, "right"))
        return SimpleNamespace(left=left, right=right)

    bare, deep = pair("bare", "depth"), pair("deep", "class", "depth")
    rig = SimpleNamespace(pairs=(bare, deep))
    writer = dataset_kind("lusnar")()
    writer.check(rig, writer.Options())
    writer.check(rig, writer.Options(camera="deep"))
    for wrong, options in ((rig, {"camera": "bare"}), (SimpleNamespace(pairs=(bare,)), {})):
        with pytest.raises(ExportError, match="lusnar needs class of bare: record with"):
            writer.check(wrong, writer.Options(**options))


def test_lusnar(recording, tmp_path):
    write_dataset(recording, "lusnar", tmp_path / "out")
    place = tmp_path / "out"
    label = np.asarray(Image.open(place / "image1" / "Label" / f"{EPOCH}.png"))
    assert [label[0, 0], label[-10, 30], label[-1, 0], label[-1, -1], label[-1, 25]] == [
        *(4, 0, 2, 1, 255)
    ]
    points = np.loadtxt(place / "LiDAR" / f"{EPOCH}.txt")
    assert set(points[:, 3].astype(int)) == {0, 2, 255}
    assert len(points) == len(recording.lidars[0].sweep(0))
    pose = np.loadtxt(place / "Rover_pose.txt")
    assert pose.shape == (201, 17)
    np.testing.assert_allclose(pose[:, 1:4], recording.body_poses.position, atol=1e-15)
    assert np.loadtxt(place / "IMU.txt")[7, 1] == pytest.approx(0.07)
    write_dataset(recording, "lusnar", tmp_path / "own", {"labels": "lusnar"})
    colours = np.asarray(Image.open(tmp_path / "own" / "image2" / "Label" / f"{EPOCH}.png"))
    assert colours[-1, 0].tolist() == [0xE8, 0xFA, 0x50]
    points = np.loadtxt(tmp_path / "own" / "LiDAR" / f"{EPOCH}.txt")
    assert set(points[:, 3].astype(int)) == {-1, 174}


PLY = {"float": "<f4", "double": "<f8", "ushort": "<u2", "int": "<i4"}


def read_ply(path):
    head, _, body = path.read_bytes().partition(b"end_header\n")
    text = head.decode()
    names = re.findall(r"property (\w+) (\w+)", text)
    found = np.frombuffer(body, [(name, PLY[kind]) for kind, name in names])
    assert len(found) == int(re.search(r"element vertex (\d+)", text)[1])
    return found


def read_pcd(path):
    from pypcd4 import PointCloud

    return PointCloud.from_path(path).pc_data


def read_laz(path):
    import laspy

    cloud = laspy.read(path)
    assert set(cloud.return_number) == set(cloud.number_of_returns) == {1}  # as LAS counts
    kinds = [(name, "<f8") for name in ("x", "y", "z", "intensity", "ring", "time", "instance")]
    found = np.zeros(len(cloud.points), kinds)
    for name in found.dtype.names:
        found[name] = cloud["gps_time" if name == "time" else name]
    return found


READERS = {"ply": read_ply, "pcd": read_pcd, "laz": read_laz}


@pytest.mark.parametrize("encoding", READERS)
def test_sweeps_as_files(recording, tmp_path, encoding):
    for deskew in (False, True):
        folder = tmp_path / f"{encoding}{deskew}"
        options = {"encoding": encoding, "deskew": deskew}
        write_dataset(recording, "clouds", folder, options)
        stamps, poses = read_tum(folder / "lidar0.tum")
        assert len(stamps) == len(list((folder / "lidar0").iterdir())) == 9
        off = []
        for number, stamp in enumerate(recording.lidars[0].stamps):
            points = READERS[encoding](folder / "lidar0" / f"{stamp}.{encoding}")
            sweep = recording.lidars[0].sweep(number)
            np.testing.assert_array_equal(points["ring"], sweep["ring"])
            np.testing.assert_array_equal(points["instance"], sweep["instance"])
            np.testing.assert_allclose(points["time"], sweep["time"], atol=1e-9)
            places = np.stack([points[axis] for axis in "xyz"], -1).astype(float)
            on_ground = sweep["instance"] != -4
            off.append(np.abs(lifted(places[on_ground], poses[number])[:, 2]).max())
            if not deskew:
                own = np.stack([sweep[axis] for axis in "xyz"], -1)
                assert np.abs(places - own).max() <= 5.1e-5
        assert max(off) < 2e-4 if deskew else max(off) > 0.01


def test_sweeps_that_are_left_out_have_no_pose(recording, tmp_path, monkeypatch):
    first = int(recording.lidars[0].stamps[0])
    monkeypatch.setattr(LidarMotion, "covers", lambda motion, begin: begin != first)
    write_dataset(recording, "clouds", tmp_path / "out", {"deskew": True})
    rows = [one for one in (tmp_path / "out/lidar0.tum").read_text().splitlines() if one[0] != "#"]
    names = sorted(path.stem for path in (tmp_path / "out/lidar0").iterdir())
    assert [one.split()[0].replace(".", "") for one in rows] == names
    assert len(names) == 8


def test_intensities_of_laz_keep_what_is_below_one(recording, tmp_path):
    import laspy

    sweep = recording.lidars[0].sweep(0)
    sweep["intensity"] = np.geomspace(0.004, 5000.0, len(sweep))
    with PointFile(tmp_path / "sweep.laz", "laz", wide=False) as file:
        file.add(points_of(sweep, np.zeros((len(sweep), 3)), 0.0))
    cloud = laspy.read(tmp_path / "sweep.laz")
    np.testing.assert_array_equal(cloud["intensity_float"], sweep["intensity"])
    held = np.minimum(100.0 * sweep["intensity"], 65_535)
    assert np.abs(cloud.intensity - held).max() <= 0.5
    (told,) = (d.description for d in cloud.header.point_format if d.name == "intensity_float")
    assert told == "16-bit intensity is 100 times it"
    losses = write_dataset(recording, "clouds", tmp_path / "out", {"encoding": "laz"}).losses
    assert any("intensity is 100 times ours" in loss for loss in losses)


@pytest.mark.parametrize("encoding", READERS)
def test_a_map_of_all_sweeps_lies_on_the_plane(recording, tmp_path, encoding):
    write_dataset(recording, "clouds", tmp_path / "out", {"encoding": encoding, "map": True})
    points = READERS[encoding](tmp_path / "out" / f"lidar0.{encoding}")
    assert len(points) == sum(len(recording.lidars[0].sweep(n)) - 1 for n in range(9))
    assert np.abs(points["z"]).max() < 6e-5
    if encoding == "pcd":  # as in the point types of PCL
        assert points.dtype["x"] == np.float32
    assert points["time"].min() == pytest.approx(EPOCH * 1e-9, abs=1e-6)
    middle = [points[axis].mean() for axis in "xy"]
    assert np.linalg.norm(middle - base_pose(0.45)[:2, 3]) < 0.5
    again = tmp_path / "again"
    write_dataset(recording, "clouds", again, {"encoding": encoding, "map": True})
    one, two = ((f / f"lidar0.{encoding}").read_bytes() for f in (again, tmp_path / "out"))
    assert one == two


def test_a_map_as_laz_names_its_crs(recording, tmp_path, monkeypatch):
    import laspy

    crs = CRS.from_proj4("+proj=tmerc +lat_0=-4.6 +lon_0=137.4 +R=3396190 +units=m")
    monkeypatch.setitem(recording.about["world"], "crs", crs.to_wkt())
    for name in ("map", "sweeps"):
        options = {"encoding": "laz", "map": name == "map"}
        write_dataset(recording, "clouds", tmp_path / name, options)
    with laspy.open(tmp_path / "map/lidar0.laz") as file:
        (told,) = file.header.vlrs.get("WktCoordinateSystemVlr")
        assert file.header.global_encoding.wkt
        assert CRS.from_wkt(told.string) == crs
        assert len(file.read().points) == file.header.point_count > 0
    with laspy.open(next((tmp_path / "sweeps/lidar0").iterdir())) as file:  # in the lidar's frame
        assert not file.header.vlrs.get("WktCoordinateSystemVlr")


def test_colours_and_more_bits(tmp_path):
    """KITTI's grey is of the colours; 12 bits become the upper 8."""
    folder = write_recording(tmp_path / "dataset", seconds=0.2, lidar=False)
    grey = np.arange(48 * 64).reshape(48, 64) % 4096
    rgb = np.stack([grey % 256, grey // 16, 255 - grey % 256], -1).astype(np.uint8)
    for key, picture in (("cam0", rgb), ("cam1", grey.astype(np.uint16))):
        Image.fromarray(picture).save(folder / f"mav0/{key}/data/{EPOCH}.png")
    index = folder / "dataset.json"
    index.write_text(index.read_text().replace('"data": {}', '"data": {"bits": 12}'))
    assert open_recording(folder).cameras[1].image(0).max() > 255
    write_dataset(folder, "kitti", tmp_path / "out")
    place = tmp_path / "out" / "sequences" / "00"
    weighed = rgb @ np.array([0.299, 0.587, 0.114])
    found = np.asarray(Image.open(place / "image_0" / "000000.png"))
    assert np.abs(found - weighed).max() <= 0.51
    np.testing.assert_array_equal(np.asarray(Image.open(place / "image_2" / "000000.png")), rgb)
    found = np.asarray(Image.open(place / "image_1" / "000000.png"))
    np.testing.assert_array_equal(found, grey // 16)


def test_colours_of_more_bits_come_as_the_upper_8(tmp_path):
    folder = write_recording(tmp_path / "dataset", seconds=0.2, lidar=False)
    values = np.arange(48 * 64).reshape(48, 64, 1) % 4096
    deep = np.concatenate([values, values // 2, 4095 - values], axis=-1).astype(np.uint16)
    for key in ("cam0", "cam1"):
        write_png(folder / f"mav0/{key}/data/{EPOCH}.png", deep)
    index = folder / "dataset.json"
    index.write_text(index.read_text().replace('"data": {}', '"data": {"bits": 12}'))
    np.testing.assert_array_equal(open_recording(folder).cameras[0].image(0), deep)
    for kind, name in {
        "kitti": "sequences/00/image_2/000000.png",
        "tum": "rgb/1600000000.000000000.png",
        "lusnar": f"image1/RGB/{EPOCH}.png",
    }.items():
        report = write_dataset(folder, kind, tmp_path / kind)
        np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / kind / name)), deep // 16)
        assert "only the 8 upper bits" in " ".join(report.losses)
    assert open_recording(folder).cameras[0].image(0).dtype == np.uint16


def test_a_sequence_s_number_may_be_a_number(recording, tmp_path):
    write_dataset(recording, "kitti", tmp_path / "out", {"sequence": 7})
    assert (tmp_path / "out/poses/07.txt").is_file()
    with pytest.raises(RecipeError, match="sequence"):
        write_dataset(recording, "kitti", tmp_path / "other", {"sequence": 100})
