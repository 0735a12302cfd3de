"""Kalibr's camera chain and IMU, and OpenVINS, which reads the same words with more beside them."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, inverse_pose, portable
from terrain_forge.datasets.streams import RecordedCamera
from terrain_forge.datasets.systems.rig import Rig, four, model_of
from terrain_forge.datasets.systems.texts import OPENCV, lines, nested, remark, row
from terrain_forge.writers import yaml_number

_IDENTITY = "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"


def kalibr_files(rig: Rig) -> dict[str, str]:
    """Kalibr's and OpenVINS's files; none of cameras whose lens has more than they can say."""
    found: dict[str, str] = {}
    cameras = rig.cameras
    if cameras and all(four(camera) is not None for camera in cameras):
        found["kalibr/camchain.yaml"] = _chain(rig, imu=False)
    if rig.imu:
        found["kalibr/imu.yaml"] = remark(rig.gravity) + lines(_noise(rig))
    if rig.imu and "kalibr/camchain.yaml" in found:
        found["kalibr/camchain-imucam.yaml"] = _chain(rig, imu=True)
        found["openvins/kalibr_imucam_chain.yaml"] = OPENCV + _openvins_cameras(rig)
        found["openvins/kalibr_imu_chain.yaml"] = OPENCV + _openvins_imu(rig)
        found["openvins/estimator_config.yaml"] = OPENCV + _estimator(rig)
    return found


def _lens(camera: RecordedCamera, others: list[int]) -> str:
    coefficients = four(camera)
    assert coefficients is not None
    width, height = camera.size
    return lines(
        {
            "cam_overlaps": others,
            "camera_model": "pinhole",
            "distortion_coeffs": row(coefficients.tolist()),
            "distortion_model": model_of(camera),
            "intrinsics": row(camera.intrinsics.tolist()),
            "resolution": f"[{width}, {height}]",
            "rostopic": f"/{camera.key}/image_raw",
        },
        "  ",
    )


def _chain(rig: Rig, *, imu: bool) -> str:
    text, before = "", None
    for number_, camera in enumerate(rig.cameras):
        text += f"cam{number_}:\n"
        if imu:
            text += nested("T_cam_imu", inverse_pose(camera.body_pose), "    ")
        if before is not None:
            step = portable.product(inverse_pose(camera.body_pose), before.body_pose)
            text += nested("T_cn_cnm1", step, "    ")
        text += _lens(camera, _others(rig, number_))
        text += "  timeshift_cam_imu: 0.0\n" if imu else ""
        before = camera
    return text


def _others(rig: Rig, number_: int) -> list[int]:
    return [other for other in range(len(rig.cameras)) if other != number_]


def _noise(rig: Rig) -> dict[str, object]:
    assert rig.imu is not None
    return {
        "accelerometer_noise_density": rig.noise.accelerometer,
        "accelerometer_random_walk": rig.noise.accelerometer_walk,
        "gyroscope_noise_density": rig.noise.gyroscope,
        "gyroscope_random_walk": rig.noise.gyroscope_walk,
        "rostopic": f"/{rig.imu.key}",
        "update_rate": float(rig.imu.rate),
    }


def _openvins_cameras(rig: Rig) -> str:
    text = ""
    for number_, camera in enumerate(rig.cameras):
        pose: Array = camera.body_pose
        text += f"cam{number_}:\n" + nested("T_imu_cam", pose, "    ")
        text += _lens(camera, _others(rig, number_)) + "  timeshift_cam_imu: 0.0\n"
    return text


def _openvins_imu(rig: Rig) -> str:
    more = {name: _IDENTITY for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC")}
    zeros = "[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]"
    return (
        "imu0:\n"
        + nested("T_i_b", np.eye(4), "    ")
        + lines({**_noise(rig), "time_offset": 0.0, "model": '"kalibr"'}, "  ")
        + lines({**more, "Tg": zeros}, "  ")
    )


def _estimator(rig: Rig) -> str:
    cameras = len(rig.cameras)
    return (
        remark(rig.gravity, "What is not said here is OpenVINS's default for EuRoC.")
        + f"gravity_mag: {yaml_number(rig.recording.gravity)}\n"
        + lines(
            {
                "verbosity": '"INFO"',
                "use_fej": True,
                "use_stereo": cameras > 1,
                "max_cameras": cameras,
                "calib_cam_extrinsics": False,
                "calib_cam_intrinsics": False,
                "calib_cam_timeoffset": False,
                "init_window_time": 2.0,
                "init_imu_thresh": 0.1,
                "init_max_disparity": 1.0,
                "init_dyn_use": False,
                "relative_config_imu": '"kalibr_imu_chain.yaml"',
                "relative_config_imucam": '"kalibr_imucam_chain.yaml"',
            }
        )
    )
