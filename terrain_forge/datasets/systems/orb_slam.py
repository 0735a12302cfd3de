"""ORB-SLAM2 and ORB-SLAM3: settings files, and the list of stamps of the EuRoC programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from terrain_forge.base import Array
from terrain_forge.datasets.pictures import straight_stream
from terrain_forge.datasets.reader import StereoPair
from terrain_forge.datasets.streams import RecordedCamera
from terrain_forge.datasets.systems.rig import Rig
from terrain_forge.datasets.systems.texts import OPENCV, lines, opencv_matrix, remark

ORB_FEATURES = 2000
"""Features of a picture, as of ORB-SLAM2's settings for KITTI."""
_TUNING: dict[str, Any] = {
    "ORBextractor.nFeatures": ORB_FEATURES,
    "ORBextractor.scaleFactor": 1.2,
    "ORBextractor.nLevels": 8,
    "ORBextractor.iniThFAST": 20,
    "ORBextractor.minThFAST": 7,
    "Viewer.KeyFrameSize": 0.05,
    "Viewer.KeyFrameLineWidth": 1.0,
    "Viewer.GraphLineWidth": 0.9,
    "Viewer.PointSize": 2.0,
    "Viewer.CameraSize": 0.08,
    "Viewer.CameraLineWidth": 3.0,
    "Viewer.ViewpointX": 0.0,
    "Viewer.ViewpointY": -0.7,
    "Viewer.ViewpointZ": -3.5,
    "Viewer.ViewpointF": 500.0,
}
_THRESHOLD = 40.0
"""Baselines that a near point is nearer than."""


def orb_slam_files(rig: Rig) -> dict[str, str]:
    """The settings that a recording has cameras for."""
    found: dict[str, str] = {}
    for camera in rig.cameras[:1]:
        stamps = camera.stamps.tolist()
        found["orbslam3/times.txt"] = "".join(f"{stamp}\n" for stamp in stamps)
        own = lines(_pinhole(camera, 1, straight=False))
        found["orbslam3/mono.yaml"] = OPENCV + _head(_kind(camera)) + own + _end(camera)
    if (deep := rig.deep) and (straight_stream(deep) or _kind(deep) == "PinHole"):
        found["orbslam3/rgbd.yaml"] = _rgbd(rig, deep)
    if pair := rig.pair:
        found["orbslam3/stereo.yaml"] = OPENCV + _stereo(pair) + _end(pair.left)
        if pair.alike:
            found["orbslam3/stereo_rectified.yaml"] = OPENCV + _rectified(pair) + _end(pair.left)
            found["orbslam2/stereo_kitti.yaml"] = _second(pair)
        if rig.imu:
            text = remark(*rig.built_in("ORB-SLAM3")) + _stereo(pair) + _inertial(rig, pair)
            found["orbslam3/stereo_inertial.yaml"] = OPENCV + text + _end(pair.left)
    return found


def _pinhole(camera: RecordedCamera, number: int, *, straight: bool) -> dict[str, Any]:
    fu, fv, cu, cv = camera.intrinsics.tolist()
    name = f"Camera{number}"
    found = {f"{name}.fx": fu, f"{name}.fy": fv, f"{name}.cx": cu, f"{name}.cy": cv}
    model, values = camera.distortion
    if straight or model == "none":
        return found
    words = ("k1", "k2", "k3", "k4") if model == "equidistant" else ("k1", "k2", "p1", "p2", "k3")
    return found | {f"{name}.{word}": v for word, v in zip(words, values.tolist(), strict=False)}


def _head(kind: str) -> str:
    return lines({"File.version": '"1.0"', "Camera.type": f'"{kind}"'})


def _kind(camera: RecordedCamera) -> str:
    return "KannalaBrandt8" if camera.distortion[0] == "equidistant" else "PinHole"


def _rectified(pair: StereoPair) -> str:
    """Two equal cameras; with the word `Rectified` ORB-SLAM3 prints a second one that it lacks."""
    zero = dict.fromkeys(("k1", "k2", "p1", "p2"), 0.0)
    found: dict[str, Any] = {}
    for number in (1, 2):
        found |= _pinhole(pair.left, number, straight=True)
        found |= {f"Camera{number}.{word}": value for word, value in zero.items()}
    return _head("PinHole") + lines({**found, "Stereo.ThDepth": _THRESHOLD}) + _apart(pair)


def _apart(pair: StereoPair) -> str:
    apart = np.eye(4)
    apart[0, 3] = pair.baseline
    return opencv_matrix("Stereo.T_c1_c2", apart, "f")


def _stereo(pair: StereoPair) -> str:
    """Of the pictures in `data`: rectified, or as they come through the lenses."""
    if pair.rectified:
        return _rectified(pair)
    found = {**_pinhole(pair.left, 1, straight=False), **_pinhole(pair.right, 2, straight=False)}
    if _kind(pair.left) == "KannalaBrandt8":
        for name in ("Camera1", "Camera2"):
            found |= {
                f"{name}.overlappingBegin": 0,
                f"{name}.overlappingEnd": pair.left.size[0] - 1,
            }
    return _head(_kind(pair.left)) + lines({**found, "Stereo.ThDepth": _THRESHOLD}) + _apart(pair)


def _inertial(rig: Rig, pair: StereoPair) -> str:
    assert rig.imu is not None
    noise = {
        "IMU.NoiseGyro": rig.noise.gyroscope,
        "IMU.NoiseAcc": rig.noise.accelerometer,
        "IMU.GyroWalk": rig.noise.gyroscope_walk,
        "IMU.AccWalk": rig.noise.accelerometer_walk,
        "IMU.Frequency": float(rig.imu.rate),
    }
    return opencv_matrix("IMU.T_b_c1", pair.left.body_pose, "f") + lines(noise)


def _end(camera: RecordedCamera) -> str:
    width, height = camera.size
    fps = max(1, round(camera.rate))
    size = {"Camera.width": width, "Camera.height": height, "Camera.fps": fps, "Camera.RGB": 1}
    return lines({**size, **_TUNING, "Viewer.imageViewScale": 1.0})


def _rgbd(rig: Rig, camera: RecordedCamera) -> str:
    """Of the TUM layout; the baseline, of which there is none, sets what is near."""
    text = _head("PinHole") + lines(_pinhole(camera, 1, straight=bool(straight_stream(camera))))
    factor = float(rig.depth_factor)
    depth = {"RGBD.DepthMapFactor": factor, "Stereo.b": 0.1, "Stereo.ThDepth": _THRESHOLD}
    return OPENCV + text + lines(depth) + _end(camera)


def _second(pair: StereoPair) -> str:
    """ORB-SLAM2's older words, for its program `stereo_kitti`."""
    camera: Array = pair.left.intrinsics
    fu, fv, cu, cv = camera.tolist()
    found = {
        "Camera.fx": fu, "Camera.fy": fv, "Camera.cx": cu, "Camera.cy": cv,
        "Camera.k1": 0.0, "Camera.k2": 0.0, "Camera.p1": 0.0, "Camera.p2": 0.0,
        "Camera.width": pair.left.size[0], "Camera.height": pair.left.size[1],
        "Camera.fps": float(pair.left.rate), "Camera.bf": fu * pair.baseline, "Camera.RGB": 1,
        "ThDepth": _THRESHOLD,
    }  # fmt: skip
    return OPENCV + lines({**found, **_TUNING})
