"""Calibration files as their readers parse them: OpenCV's, PyYAML's words, JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest
from ruamel.yaml import YAML

from terrain_forge.base import ExportError
from terrain_forge.datasets import calibration_files, open_recording, write_dataset
from terrain_forge.datasets.clouds import LidarMotion
from tests.helpers.recordings import BASELINE, FOCAL, GRAVITY, IMU, LEFT, LIDAR, write_recording

BENT = {
    "distortion_model": "radial-tangential",
    "distortion_coefficients": [-0.17, 0.02, 1e-5, 0.0],
}
FISHEYE = {
    "distortion_model": "equidistant",
    "distortion_coefficients": [-0.01, 1e-3, 1e-5, 1e-7],
}


@pytest.fixture(scope="module", params=["straight", "bent", "fisheye"])
def rig(request, tmp_path_factory):
    """Lens, and the files of a recording through it."""
    changes = {"straight": {}, "bent": BENT, "fisheye": FISHEYE}[request.param]
    folder = write_recording(tmp_path_factory.mktemp("rig"), seconds=0.3, **changes)
    return request.param, calibration_files(open_recording(folder))


def opencv(text):
    import cv2

    return cv2.FileStorage(text.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)


def plain(text):
    body = text.decode().removeprefix("%YAML:1.0\n").removeprefix("---\n")
    loader = YAML(typ="safe", pure=True)
    loader.version = (1, 1)  # PyYAML's, to which 1e-05 is a word
    return loader.load(body)


def test_every_number_is_a_number(rig):
    for name, text in rig[1].items():
        if not name.endswith(".yaml") or b"!!opencv-matrix" in text:
            continue

        def walk(value, name=name):
            for one in value.values() if isinstance(value, dict) else value:
                if isinstance(one, dict | list):
                    walk(one)
                elif isinstance(one, str) and one != "1.0":  # ORB-SLAM3's File.version
                    assert not one[:1].isdigit(), (name, one)

        walk(plain(text))


def test_orb_slam(rig):
    lens, files = rig
    stereo = opencv(files["orbslam3/stereo.yaml"])
    kinds = {"straight": "PinHole", "bent": "PinHole", "fisheye": "KannalaBrandt8"}
    assert stereo.getNode("Camera.type").string() == kinds[lens]
    assert stereo.getNode("File.version").string() == "1.0"
    assert [stereo.getNode(f"Camera1.{n}").real() for n in ("fx", "cx")] == [FOCAL, 31.5]
    assert stereo.getNode("Camera.fps").isInt()
    apart = stereo.getNode("Stereo.T_c1_c2").mat()
    assert apart[0, 3] == pytest.approx(BASELINE)
    assert apart.dtype == np.float32  # ORB-SLAM3 reads its bytes as floats, whatever they are
    second = {"straight": 0.0, "bent": 0.02, "fisheye": 1e-3}
    assert stereo.getNode("Camera2.k2").real() == second[lens]
    inertial = opencv(files["orbslam3/stereo_inertial.yaml"])
    pose = inertial.getNode("IMU.T_b_c1").mat()
    np.testing.assert_allclose(IMU @ pose, LEFT, atol=1e-6)
    assert inertial.getNode("IMU.GyroWalk").real() == 1.9e-5
    assert b"has 9.81 m/s^2 built in" in files["orbslam3/stereo_inertial.yaml"]
    assert files["orbslam3/times.txt"] == b"1600000000000000000\n1600000000200000000\n"
    assert ("orbslam3/rgbd.yaml" in files) == (lens != "fisheye")
    second = opencv(files["orbslam2/stereo_kitti.yaml"])
    assert second.getNode("Camera.bf").real() == pytest.approx(FOCAL * BASELINE)


def test_kalibr_and_openvins(rig):
    lens, files = rig
    chain = plain(files["kalibr/camchain-imucam.yaml"])
    np.testing.assert_allclose(
        np.linalg.inv(chain["cam0"]["T_cam_imu"]), np.linalg.inv(IMU) @ LEFT, atol=1e-12
    )
    step = np.array(chain["cam1"]["T_cn_cnm1"])
    assert step[0, 3] == pytest.approx(-BASELINE)
    model = chain["cam0"]["distortion_model"], chain["cam0"]["distortion_coeffs"]
    assert model == {
        "straight": ("radtan", [0.0] * 4),
        "bent": ("radtan", BENT["distortion_coefficients"]),
        "fisheye": ("equidistant", FISHEYE["distortion_coefficients"]),
    }[lens]  # fmt: skip
    vins = plain(files["openvins/kalibr_imucam_chain.yaml"])
    np.testing.assert_allclose(IMU @ np.array(vins["cam0"]["T_imu_cam"]), LEFT, atol=1e-12)
    assert plain(files["openvins/estimator_config.yaml"])["gravity_mag"] == GRAVITY


def test_other_systems(rig):
    lens, files = rig
    vins = opencv(files["vins_fusion/config.yaml"])
    assert vins.getNode("g_norm").real() == GRAVITY
    assert vins.getNode("acc_n").real() == pytest.approx(2e-3 * 200**0.5)
    np.testing.assert_allclose(IMU @ vins.getNode("body_T_cam0").mat(), LEFT, atol=1e-12)
    value = json.loads(files["basalt/calibration.json"])["value0"]
    kinds = {"straight": "pinhole", "bent": "pinhole-radtan8", "fisheye": "kb4"}
    assert value["intrinsics"][0]["camera_type"] == kinds[lens]
    assert plain(files["kimera/ImuParams.yaml"])["n_gravity"] == [0, 0, -GRAVITY]
    right = plain(files["rtabmap/stereo_right.yaml"])
    assert right["projection_matrix"]["data"][3] == pytest.approx(-FOCAL * BASELINE)
    assert right["camera_name"] == "stereo_right"
    kiss = plain(files["kiss_icp/config.yaml"])
    assert kiss == {
        "data": {"deskew": False, "max_range": 100.0, "min_range": 0.5},
        "mapping": {"voxel_size": 0.5},
    }
    lio = plain(files["lio_sam/params.yaml"])["lio_sam"]
    place = np.linalg.inv(LIDAR) @ IMU
    np.testing.assert_allclose(lio["extrinsicTrans"], place[:3, 3], atol=1e-12)
    np.testing.assert_allclose(lio["extrinsicRot"], place[:3, :3].ravel(), atol=1e-12)
    assert lio["imuGravity"] == GRAVITY


def test_gravity_of_the_earth_needs_no_warning(tmp_path):
    folder = write_recording(tmp_path, seconds=0.2, lidar=False)
    index = folder / "dataset.json"
    index.write_text(index.read_text().replace("3.711", "9.81"))
    files = calibration_files(open_recording(folder))
    assert b"built in" not in b"".join(files.values())
    assert "lio_sam/params.yaml" not in files


def told(files):
    """README.txt in one line."""
    return " ".join(files["README.txt"].decode().split())


def test_readme_names_what_is_written_alone(tmp_path, rig):
    every = told(rig[1])
    assert "OpenVINS (gravity_mag), VINS-Fusion (g_norm), Kimera (n_gravity), LIO-SAM" in every
    assert "Each of ORB-SLAM3 and Basalt has 9.81 m/s^2 built in" in every
    folder = write_recording(tmp_path, seconds=0.2, lidar=False)
    index = json.loads((folder / "dataset.json").read_text())
    index["streams"] = [one for one in index["streams"] if one["kind"] == "camera"]
    (folder / "dataset.json").write_text(json.dumps(index))
    files = calibration_files(open_recording(folder))
    text = told(files)
    for word in ("OpenVINS", "VINS", "Kimera", "LIO-SAM", "Basalt", "inertial", "stands in"):
        assert word not in text
    assert "mav0/cam0/data: orbslam3/mono.yaml, stereo.yaml, kalibr." in text


def test_factor_of_depth(tmp_path):
    folder = write_recording(tmp_path / "dataset", seconds=0.2, lidar=False)
    for factor in (1000, 5000):
        options = {"depth_factor": factor}
        write_dataset(folder, "calibration", tmp_path / str(factor), options)
        files = {"README.txt": (tmp_path / str(factor) / "README.txt").read_bytes()}
        assert f"the TUM layout of cam0 with {factor} values in a metre: orbslam3/rgbd" in told(
            files
        )
        rgbd = opencv((tmp_path / str(factor) / "orbslam3" / "rgbd.yaml").read_bytes())
        assert rgbd.getNode("RGBD.DepthMapFactor").real() == factor


def test_an_imu_without_noise_is_told(tmp_path):
    folder = write_recording(tmp_path / "dataset", seconds=0.2, lidar=False)
    assert write_dataset(folder, "calibration", tmp_path / "noisy").losses == ()
    path = folder / "mav0" / "imu0" / "sensor.yaml"
    about = json.loads(path.read_text()) | {"gyroscope_random_walk": 0.0}
    path.write_text(json.dumps(about))
    (loss,) = write_dataset(folder, "calibration", tmp_path / "out").losses
    assert loss.startswith("imu0 has no noise of gyroscope_walk: the files say 0, which estimators")
    assert "imu0 has no noise of gyroscope_walk" in told(calibration_files(open_recording(folder)))


def test_a_fifth_coefficient_is_told(tmp_path):
    bent = {**BENT, "distortion_coefficients": [-0.2, 0.02, 0.0, 0.0, 0.01]}
    folder = write_recording(tmp_path, seconds=0.2, lidar=False, **bent)
    files = calibration_files(open_recording(folder))
    assert {name.split("/")[0] for name in files} == {
        *("README.txt", "basalt", "kalibr", "orbslam2", "orbslam3", "ros", "rtabmap")
    }
    assert b"k3, which Kalibr, OpenVINS" in files["README.txt"]
    assert opencv(files["orbslam3/stereo.yaml"]).getNode("Camera1.k3").real() == 0.01


def changed(folder, key, about=(), channels=None):
    """Changes what a recording tells of a sensor."""
    path = folder / "mav0" / key / "sensor.yaml"
    path.write_text(json.dumps(json.loads(path.read_text()) | dict(about)))
    if channels is not None:
        index = json.loads((folder / "dataset.json").read_text())
        (stream,) = [one for one in index["streams"] if one["folder"].endswith(key)]
        stream["channels"] = channels
        (folder / "dataset.json").write_text(json.dumps(index))


def test_rgbd_is_of_the_camera_whose_pictures_tum_has(tmp_path):
    """Not of the pair's left one, if that has no depth, or where another one is named."""
    folder = write_recording(tmp_path / "dataset", seconds=0.4, lidar=False)
    changed(folder, "cam1", {"intrinsics": [44.0, 45.0, 30.0, 20.0]})

    def focal(name, **options):
        write_dataset(folder, "calibration", tmp_path / name, options)
        text = (tmp_path / name / "README.txt").read_text()
        key = {FOCAL: "cam0", 44.0: "cam1"}
        found = opencv((tmp_path / name / "orbslam3" / "rgbd.yaml").read_bytes())
        assert f"TUM layout of {key[found.getNode('Camera1.fx').real()]} with" in text
        return found.getNode("Camera1.fx").real()

    assert focal("default") == FOCAL
    assert focal("named", camera="stereo_right") == 44.0
    changed(folder, "cam0", channels={"data": {}})
    assert focal("other") == 44.0
    with pytest.raises(ExportError, match="no camera with depth 'stereo_left'"):
        write_dataset(folder, "calibration", tmp_path / "none", {"camera": "stereo_left"})


def test_a_pair_of_unequal_lenses_has_no_files_of_equal_ones(tmp_path):
    folder = write_recording(tmp_path / "dataset", seconds=0.4, lidar=False)
    changed(folder, "cam1", {"intrinsics": [44.0, 45.0, 30.0, 20.0]})
    recording = open_recording(folder)
    files = calibration_files(recording)
    assert not {"orbslam3/stereo_rectified.yaml", "orbslam2/stereo_kitti.yaml"} & files.keys()
    assert "Focal lengths or principal points of cam0 and cam1 differ" in told(files)
    assert opencv(files["orbslam3/stereo.yaml"]).getNode("Camera2.fx").real() == 44.0
    with pytest.raises(ExportError, match="those of stereo_left and stereo_right differ"):
        write_dataset(recording, "kitti", tmp_path / "kitti")


def test_a_look_has_the_columns_and_the_length_of_each_of_its_sweeps(tmp_path):
    """It has every other sweep, and none takes longer for that."""
    folder = write_recording(tmp_path / "dataset", seconds=0.4)

    def told():
        recording = open_recording(folder)
        lio = plain(calibration_files(recording)["lio_sam/params.yaml"])["lio_sam"]
        return lio["Horizon_SCAN"], LidarMotion(recording, recording.lidars[0]).length

    assert told() == (90, 100_000_000)
    changed(folder, "lidar0", {"rate_hz": 5.0, "sweep_s": 0.1})
    assert told() == (90, 100_000_000)
