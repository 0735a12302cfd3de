"""VINS-Fusion, Basalt and Kimera: cameras with an IMU."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from terrain_forge.base import Array, quaternion_from_matrix, xyzw
from terrain_forge.datasets.streams import RecordedCamera
from terrain_forge.datasets.systems.rig import Rig, four, model_of
from terrain_forge.datasets.systems.texts import OPENCV, lines, opencv_matrix, remark, row


def vio_files(rig: Rig) -> dict[str, str]:
    """The files of a recording with an IMU and cameras."""
    if not (rig.imu and rig.cameras):
        return {}
    found = {"basalt/calibration.json": _basalt(rig)}
    if all(four(camera) is not None for camera in rig.cameras):
        found["vins_fusion/config.yaml"] = _vins(rig)
        for number, camera in enumerate(rig.cameras):
            found[f"vins_fusion/cam{number}.yaml"] = _vins_camera(camera)
        names = ("LeftCameraParams", "RightCameraParams")
        for name, camera in zip(names, rig.cameras, strict=False):
            found[f"kimera/{name}.yaml"] = _kimera_camera(camera)
        found["kimera/ImuParams.yaml"] = _kimera_imu(rig)
    return found


def _vins(rig: Rig) -> str:
    """Its noise is that of a sample, not a density: density · √rate."""
    assert rig.imu is not None
    root = math.sqrt(rig.imu.rate)
    width, height = rig.cameras[0].size
    topics: dict[str, Any] = {"imu_topic": f'"/{rig.imu.key}"'}
    for number, camera in enumerate(rig.cameras):
        topics |= {
            f"image{number}_topic": f'"/{camera.key}/image_raw"',
            f"cam{number}_calib": f'"cam{number}.yaml"',
        }
    told = {
        "imu": 1, "num_of_cam": len(rig.cameras), **topics, "output_path": '"."',
        "image_width": width, "image_height": height, "estimate_extrinsic": 0,
        "multiple_thread": 1, "max_cnt": 150, "min_dist": 30, "freq": 10, "F_threshold": 1.0,
        "show_track": 0, "flow_back": 1, "max_solver_time": 0.04, "max_num_iterations": 8,
        "keyframe_parallax": 10.0,
        "acc_n": rig.noise.accelerometer * root, "gyr_n": rig.noise.gyroscope * root,
        "acc_w": rig.noise.accelerometer_walk * root, "gyr_w": rig.noise.gyroscope_walk * root,
        "g_norm": rig.recording.gravity, "estimate_td": 0, "td": 0.0,
        "load_previous_pose_graph": 0, "pose_graph_save_path": '"."', "save_image": 0,
    }  # fmt: skip
    poses = "".join(
        opencv_matrix(f"body_T_cam{number}", camera.body_pose)
        for number, camera in enumerate(rig.cameras)
    )
    return (
        OPENCV
        + remark(rig.gravity, "Noise is of a sample: density times root of the rate.")
        + (lines(told) + poses)
    )


def _vins_camera(camera: RecordedCamera) -> str:
    coefficients = four(camera)
    assert coefficients is not None
    width, height = camera.size
    fu, fv, cu, cv = camera.intrinsics.tolist()
    k1, k2, k3, k4 = coefficients.tolist()
    fisheye = model_of(camera) == "equidistant"
    head = {"model_type": "KANNALA_BRANDT" if fisheye else "PINHOLE", "camera_name": camera.key}
    text = OPENCV + "---\n" + lines({**head, "image_width": width, "image_height": height})
    if fisheye:
        told = {"k2": k1, "k3": k2, "k4": k3, "k5": k4, "mu": fu, "mv": fv, "u0": cu, "v0": cv}
        return text + "projection_parameters:\n" + lines(told, "   ")
    bent = {"k1": k1, "k2": k2, "p1": k3, "p2": k4}
    straight = {"fx": fu, "fy": fv, "cx": cu, "cy": cv}
    text += "distortion_parameters:\n" + lines(bent, "   ")
    return text + "projection_parameters:\n" + lines(straight, "   ")


def _basalt(rig: Rig) -> str:
    """JSON has no comments: that 9.81 m/s² is built in stands in README.txt."""
    assert rig.imu is not None
    noise = rig.noise
    value = {
        "T_imu_cam": [_basalt_pose(camera.body_pose) for camera in rig.cameras],
        "intrinsics": [_basalt_lens(camera) for camera in rig.cameras],
        "resolution": [list(camera.size) for camera in rig.cameras],
        "vignette": [],
        "calib_accel_bias": [0.0] * 9,
        "calib_gyro_bias": [0.0] * 12,
        "imu_update_rate": float(rig.imu.rate),
        "accel_noise_std": [noise.accelerometer] * 3,
        "gyro_noise_std": [noise.gyroscope] * 3,
        "accel_bias_std": [noise.accelerometer_walk] * 3,
        "gyro_bias_std": [noise.gyroscope_walk] * 3,
        "cam_time_offset_ns": 0,
        "mocap_time_offset_ns": 0,
        "mocap_to_imu_offset_ns": 0,
    }
    return json.dumps({"value0": value}, indent=2) + "\n"


def _basalt_pose(pose: Array) -> dict[str, float]:
    turn = xyzw(quaternion_from_matrix(pose[:3, :3]))
    values = [*pose[:3, 3].tolist(), *turn.tolist()]
    return dict(zip(("px", "py", "pz", "qx", "qy", "qz", "qw"), values, strict=True))


def _basalt_lens(camera: RecordedCamera) -> dict[str, Any]:
    fu, fv, cu, cv = camera.intrinsics.tolist()
    told = {"fx": fu, "fy": fv, "cx": cu, "cy": cv}
    model, given = camera.distortion
    if model == "none":
        return {"camera_type": "pinhole", "intrinsics": told}
    if model == "equidistant":
        bent = dict(zip(("k1", "k2", "k3", "k4"), given.tolist(), strict=True))
        return {"camera_type": "kb4", "intrinsics": told | bent}
    names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    values = [*given.tolist(), *[0.0] * (8 - len(given))]
    bent = dict(zip(names, values, strict=True))
    return {"camera_type": "pinhole-radtan8", "intrinsics": told | bent | {"rpmax": 0.0}}


def _kimera_camera(camera: RecordedCamera) -> str:
    coefficients = four(camera)
    assert coefficients is not None
    width, height = camera.size
    words = {"radtan": "radial-tangential", "equidistant": "equidistant"}
    pose = row(camera.body_pose.ravel().tolist())
    return (
        OPENCV + f"camera_id: {camera.key}\nT_BS:\n  cols: 4\n  rows: 4\n  data: {pose}\n"
    ) + lines(
        {
            "rate_hz": max(1, round(camera.rate)),
            "resolution": f"[{width}, {height}]",
            "camera_model": "pinhole",
            "intrinsics": row(camera.intrinsics.tolist()),
            "distortion_model": words[model_of(camera)],
            "distortion_coefficients": row(coefficients.tolist()),
        }
    )


def _kimera_imu(rig: Rig) -> str:
    assert rig.imu is not None
    noise = rig.noise
    unit = row(np.eye(4).ravel().tolist())
    return (
        OPENCV
        + remark(rig.gravity)
        + f"T_BS:\n  cols: 4\n  rows: 4\n  data: {unit}\n"
        + lines(
            {
                "rate_hz": float(rig.imu.rate),
                "gyroscope_noise_density": noise.gyroscope,
                "gyroscope_random_walk": noise.gyroscope_walk,
                "accelerometer_noise_density": noise.accelerometer,
                "accelerometer_random_walk": noise.accelerometer_walk,
                "imu_integration_sigma": 1.0e-8,
                "imu_time_shift": 0.0,
                "n_gravity": row([0.0, 0.0, -rig.recording.gravity]),
            }
        )
    )
