"""ROS's camera_info as RTAB-Map reads it, and what lidar systems want: KISS-ICP, LIO-SAM."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inverse_pose, portable
from terrain_forge.datasets.clouds import layout_of
from terrain_forge.datasets.ros_cameras import projection_of
from terrain_forge.datasets.ros_frames import frames_of
from terrain_forge.datasets.streams import RecordedCamera, RecordedLidar
from terrain_forge.datasets.systems.rig import Rig
from terrain_forge.datasets.systems.texts import lines, remark, row
from terrain_forge.writers import yaml_number


def ros_files(rig: Rig) -> dict[str, str]:
    """A camera_info of each camera, under RTAB-Map's names for the pair."""
    names = {camera.key: camera for camera in rig.recording.cameras}
    found = {f"ros/{key}.yaml": _camera_info(rig, camera) for key, camera in names.items()}
    if pair := rig.pair:
        found["rtabmap/stereo_left.yaml"] = _camera_info(rig, pair.left)
        found["rtabmap/stereo_right.yaml"] = _camera_info(rig, pair.right)
    return found


def _camera_info(rig: Rig, camera: RecordedCamera) -> str:
    width, height = camera.size
    model, given = camera.distortion
    bent = np.zeros(4 if model == "equidistant" else 5)
    bent[: len(given)] = given
    name = camera.key
    for side in ("left", "right"):
        if rig.pair and getattr(rig.pair, side) is camera:
            name = f"stereo_{side}"  # RTAB-Map's file is called as what stands in it
    matrices = {
        "camera_matrix": camera.matrix,
        "distortion_coefficients": bent[None],
        "rectification_matrix": np.eye(3),
        "projection_matrix": projection_of(rig.recording, camera),
    }
    text = lines({"image_width": width, "image_height": height, "camera_name": name})
    text += f"distortion_model: {'equidistant' if model == 'equidistant' else 'plumb_bob'}\n"
    for word, values in matrices.items():
        rows, columns = values.shape
        text += (
            f"{word}:\n  rows: {rows}\n  cols: {columns}\n  data: {row(values.ravel().tolist())}\n"
        )
    return text


def lidar_files(rig: Rig) -> dict[str, str]:
    """The files of a recording with a lidar."""
    found: dict[str, str] = {}
    for lidar in rig.recording.lidars[:1]:
        near, far = _reach(lidar)
        found["kiss_icp/config.yaml"] = (
            remark(
                "Deskewing is off: at a rover's speeds KISS-ICP's model of constant velocity feeds",
                "its own jitter back (at 0.16 m/s over 60 m: 8 m off with it, 0.08 m without).",
            )
            + f"data:\n  deskew: false\n  max_range: {yaml_number(far)}\n"
            + f"  min_range: {yaml_number(near)}\nmapping:\n  voxel_size: 0.5\n"
        )
        if rig.imu:
            found["lio_sam/params.yaml"] = _lio_sam(rig, lidar)
    return found


def _reach(lidar: RecordedLidar) -> tuple[float, float]:
    names = ("range_min_m", "range_max_m")
    near, far = (float(lidar.numbers(name, (1,))[0]) for name in names)
    return near, far


def _lio_sam(rig: Rig, lidar: RecordedLidar) -> str:
    assert rig.imu is not None
    near, far = _reach(lidar)
    layout = layout_of(rig.recording, lidar)
    turn = portable.product(inverse_pose(lidar.body_pose), rig.imu.body_pose)
    topic = "/velodyne_points" if layout == "velodyne" else "/ouster/points"
    columns = int(lidar.sweep_s / float(lidar.numbers("column_period_s", (1,))[0]) + 1e-6)
    told = {
        "pointCloudTopic": f'"{topic}"',
        "imuTopic": f'"/{rig.imu.key}"',
        "lidarFrame": f'"{frames_of(rig.recording)[lidar.key]}"',
        "baselinkFrame": '"base_link"',
        "sensor": layout,
        "N_SCAN": int(lidar.numbers("rings", (1,))[0]),
        "Horizon_SCAN": columns,
        "downsampleRate": 1,
        "lidarMinRange": near,
        "lidarMaxRange": far,
        "imuAccNoise": rig.noise.accelerometer,
        "imuGyrNoise": rig.noise.gyroscope,
        "imuAccBiasN": rig.noise.accelerometer_walk,
        "imuGyrBiasN": rig.noise.gyroscope_walk,
        "imuGravity": rig.recording.gravity,
        "imuRPYWeight": 0.0,
        "extrinsicTrans": row(turn[:3, 3].tolist()),
        "extrinsicRot": row(turn[:3, :3].ravel().tolist()),
        "extrinsicRPY": row(turn[:3, :3].ravel().tolist()),
    }
    head = remark(
        rig.gravity,
        "Beside the file of your version: ROS 1 has these under `lio_sam:`, ROS 2 under",
        "`/**: ros__parameters:`. The IMU measures no orientation: its messages hold the identity.",
    )
    return head + "lio_sam:\n" + lines(told, "  ")
