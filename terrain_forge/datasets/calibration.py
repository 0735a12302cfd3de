"""Calibration of a recording in the words of the SLAM systems that read it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from textwrap import fill

from terrain_forge.base import inverse_pose, portable, quaternion_from_matrix
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.streams import RecordedSensor
from terrain_forge.datasets.systems.kalibr import kalibr_files
from terrain_forge.datasets.systems.lidars import lidar_files, ros_files
from terrain_forge.datasets.systems.orb_slam import orb_slam_files
from terrain_forge.datasets.systems.rig import Rig, four
from terrain_forge.datasets.systems.vio import vio_files

_SYSTEMS = (orb_slam_files, kalibr_files, vio_files, ros_files, lidar_files)


_GRAVITY = {
    "openvins/estimator_config.yaml": "OpenVINS (gravity_mag)",
    "vins_fusion/config.yaml": "VINS-Fusion (g_norm)",
    "kimera/ImuParams.yaml": "Kimera (n_gravity)",
    "lio_sam/params.yaml": "LIO-SAM (imuGravity)",
}
"""Files that the dataset's gravity stands in."""
_EARTHBOUND = {"orbslam3/stereo_inertial.yaml": "ORB-SLAM3", "basalt/calibration.json": "Basalt"}
"""Files of systems that have the Earth's built in."""
_AS_RECORDED = {
    "orbslam3/mono.yaml": "orbslam3/mono.yaml",
    "orbslam3/stereo.yaml": "stereo.yaml",
    "orbslam3/stereo_inertial.yaml": "stereo_inertial.yaml",
    "kalibr/camchain.yaml": "kalibr",
    "openvins/estimator_config.yaml": "openvins",
    "vins_fusion/config.yaml": "vins_fusion",
    "kimera/ImuParams.yaml": "kimera",
    "basalt/calibration.json": "basalt",
}
_STRAIGHT = {
    "orbslam3/stereo_rectified.yaml": "orbslam3/stereo_rectified.yaml",
    "orbslam2/stereo_kitti.yaml": "orbslam2/stereo_kitti.yaml",
}
_USUAL = "1.7e-4, 1.9e-5, 2.0e-3 and 3.0e-3"
"""Densities of the EuRoC dataset's IMU, in the order of `Noise`; SI units."""


def calibration_files(
    recording: Recording, depth_factor: float = 5000.0, depth_camera: str = ""
) -> dict[str, bytes]:
    """Files by their paths, such as `orbslam3/stereo.yaml`, in the order of their names.

    Args:
        recording: The recording.
        depth_factor: Values in a metre of the TUM layout that is read with `orbslam3/rgbd.yaml`.
        depth_camera: Its camera, by its name or folder; by default that which it has by default.
    """
    rig = Rig(recording=recording, depth_factor=depth_factor, depth_camera=depth_camera)
    found = {name: text for files in _SYSTEMS for name, text in files(rig).items()}
    found["README.txt"] = _readme(rig, found)
    return {name: found[name].encode() for name in sorted(found)}


def calibration_losses(recording: Recording) -> tuple[str, ...]:
    """What no calibration file can say: sensors that move against the body, an IMU of no noise."""
    body = recording.link_of(recording.body_name)
    mounted = (one for one in recording.sensors if "T_BS" in one.about and one.span)
    moving = [one for one in mounted if recording.link_of(one.key) != body]
    found = [_moves(recording, sensor) for sensor in moving]
    rig = Rig(recording=recording)
    if rig.imu is not None:
        names = [one.name for one in fields(rig.noise) if not getattr(rig.noise, one.name)]
        if names:
            found.append(
                f"{rig.imu.key} has no noise of {', '.join(names)}: the files say 0, which "
                "estimators take for infinite weight. Set values above 0 before use; those of the "
                f"EuRoC dataset's IMU (gyroscope, its walk, accelerometer, its walk) are {_USUAL}."
            )
    return tuple(found)


def _moves(recording: Recording, sensor: RecordedSensor) -> str:
    """How far a sensor gets from where it is at rest."""
    truth, body = recording.truth_of(sensor), recording.body_poses
    truth = truth[body.covering(truth.stamps, truth.stamps)]
    there = portable.product(inverse_pose(body.at(truth.stamps).matrices), truth.matrices)
    off = portable.product(inverse_pose(sensor.body_pose), there)
    far = portable.norm(off[:, :3, 3]).max(initial=0.0)
    turned = portable.norm(quaternion_from_matrix(off[:, :3, :3])[:, 1:]).max(initial=0.0)
    angle = math.degrees(2.0 * math.asin(min(turned, 1.0)))
    return (
        f"{sensor.key} moves against {recording.body_name} by up to {far:.3f} m, {angle:.1f}°: "
        "its calibration is that at rest."
    )


def _readme(rig: Rig, files: Mapping[str, str]) -> str:
    recording = rig.recording

    def written(names: Mapping[str, str]) -> str:
        return ", ".join(word for name, word in names.items() if name in files)

    left = rig.cameras[0].key if rig.cameras else ""
    deep = rig.deep.key if rig.deep else ""
    found = [
        f"Calibration of the recording of {recording.name!r}, in the words of the systems that "
        "read it. Pixels: the centre of the first one is 0, 0. Frames: cameras x right, y down, "
        f"z forward; the body is {recording.body_name}. Lengths in metres, angles in radians.",
        rig.gravity + f" It stands in the files of {written(_GRAVITY)}." * bool(written(_GRAVITY)),
    ]
    if systems := written(_EARTHBOUND).replace(", ", " and "):
        each = "Each of " * (" and " in systems) + systems
        found.append(" ".join(rig.built_in(each)[1:]))
    for what, names in (
        (f"the pictures in mav0/{left}/data", _AS_RECORDED),
        ("pictures without distortion", _STRAIGHT),
        (
            f"the TUM layout of {deep} with {rig.depth_factor:g} values in a metre",
            {"orbslam3/rgbd.yaml": "orbslam3/rgbd.yaml"},
        ),
    ):
        found += [f"Of {what}: {written(names)}."] * bool(written(names))
    if rig.pair and not rig.pair.alike:
        right = rig.pair.right.key
        found.append(
            f"Focal lengths or principal points of {left} and {right} differ: nothing is written "
            "for pairs without distortion, which are of two equal cameras."
        )
    if any(four(camera) is None for camera in rig.cameras):
        found.append(
            "The lenses have a fifth coefficient of distortion, k3, which Kalibr, OpenVINS, "
            "VINS-Fusion and Kimera have no word for: nothing is written for them."
        )
    if any(camera.distortion[0] == "equidistant" for camera in rig.cameras[1:]):
        found.append(
            "ORB-SLAM3 reads the second fisheye's k1 to k4 from the first one's: both are alike."
        )
    found += calibration_losses(recording)
    return "\n\n".join(fill(one, 88, break_on_hyphens=False) for one in found if one) + "\n"
