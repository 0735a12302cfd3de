"""Calibration of a recording in the words of the SLAM systems that read it."""

from __future__ import annotations

from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.systems.kalibr import kalibr_files
from terrain_forge.datasets.systems.lidars import lidar_files, ros_files
from terrain_forge.datasets.systems.orb_slam import orb_slam_files
from terrain_forge.datasets.systems.rig import Rig, four
from terrain_forge.datasets.systems.vio import vio_files

_SYSTEMS = (orb_slam_files, kalibr_files, vio_files, ros_files, lidar_files)


def calibration_files(recording: Recording) -> dict[str, bytes]:
    """Files by their paths, such as `orbslam3/stereo.yaml`, in the order of their names."""
    rig = Rig(recording=recording)
    found = {name: text for files in _SYSTEMS for name, text in files(rig).items()}
    found["README.txt"] = _readme(rig)
    return {name: found[name].encode() for name in sorted(found)}


def _readme(rig: Rig) -> str:
    recording = rig.recording
    found = [
        f"Calibration of the recording of {recording.name!r}, in the words of the systems that",
        "read it. Pixels: the centre of the first one is 0, 0. Frames: cameras x right, y down,",
        f"z forward; the body is {recording.body_name}. Lengths in metres, angles in radians.",
        "",
        f"Gravity of this dataset: {recording.gravity:g} m/s^2. It stands in the files of OpenVINS",
        "(gravity_mag), VINS-Fusion (g_norm), Kimera (n_gravity) and LIO-SAM (imuGravity).",
        *rig.built_in("ORB-SLAM3, or Basalt,")[1:],
        "",
        "orbslam3/stereo.yaml and stereo_inertial.yaml are of the pictures in mav0/cam0/data, as",
        "are kalibr, openvins, vins_fusion, kimera and basalt; stereo_rectified.yaml and",
        "orbslam2/stereo_kitti.yaml are of pictures without distortion, rgbd.yaml is of the TUM",
        "layout with 5000 values in a metre.",
    ]
    if any(four(camera) is None for camera in rig.cameras):
        found += [
            "",
            "The lenses have a fifth coefficient of distortion, k3, which Kalibr, OpenVINS,",
            "VINS-Fusion and Kimera have no word for: nothing is written for them.",
        ]
    if any(camera.distortion[0] == "equidistant" for camera in rig.cameras[1:]):
        found += [
            "",
            "ORB-SLAM3 reads the second fisheye's k1 to k4 from the first one's: both are alike.",
        ]
    return "\n".join([*found, ""])
