"""A small recording in closed form, written by hand: a rover that turns on a level plane.

Its rays end on the plane z = 0, so that whatever is read back, by whatever road, must lie there.
"""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from terrain_forge.base import placed

EPOCH = 1_600_000_000 * 10**9
GRAVITY = 3.711
SPEED, TURN, HEIGHT = 0.5, 0.6, 0.4
WIDTH, ROWS, FOCAL = 64, 48, 40.0
BASELINE = 0.12
FACTOR = 1000.0
CLASSES = {
    str(number): name
    for number, name in enumerate(
        ("ground", "crater", "rock", "ripple", "track", "rover", "sky", "beyond")
    )
}
ON_ROVER = (0.25, 0.0, -0.375)
"""A point on the rover that each sweep has, in the lidar's frame."""
OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
FIELDS = np.dtype(
    [
        *(("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4")),
        *(("ring", "u2"), ("time", "f4"), ("instance", "i4")),
    ]
)


ODOMETRY = (
    "ticks_left [],x [m],y [m],yaw [rad],v [m s^-1],w [rad s^-1],cov_x_x [m^2],cov_x_y [m^2],"
    "cov_x_yaw [m rad],cov_y_y [m^2],cov_y_yaw [m rad],cov_yaw_yaw [rad^2],cov_v_v [],cov_w_w []",
    (7, 1.0, 2.0, 0.5, 0.25, 0.125, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08),
)
SUN = ("s_x [],s_y [],s_z [],seen []", (0.6, 0.0, 0.8, 1))
INCLINOMETER = ("roll [rad],pitch [rad]", (0.1, -0.2))
"""Tables of one row again and again."""


IMU = placed([0.1, 0.02, 0.3], Rotation.from_euler("xyz", [2, -3, 5], True).as_matrix())
LIDAR = placed([0.2, 0.0, 0.6], Rotation.from_euler("y", 2, True).as_matrix())
LEFT = placed([0.3, 0.06, 0.5], Rotation.from_euler("y", 35, True).as_matrix() @ OPTICAL)
RIGHT = LEFT @ placed([BASELINE, 0, 0], np.eye(3))


@cache
def base_pose(time: float) -> np.ndarray:
    """base_link in the world: a circle, on an even ground, with a little roll."""
    angle = TURN * time
    radius = SPEED / TURN
    place = [radius * math.sin(angle), radius * (1 - math.cos(angle)), HEIGHT]
    turn = Rotation.from_euler("xyz", [0.05 * math.sin(3 * time), 0.02 * math.cos(time), angle])
    return placed(place, turn.as_matrix())


@cache
def rocking_pose(time: float) -> np.ndarray:
    """A link that rocks about a joint, in base_link; at rest the two are one frame."""
    turn = Rotation.from_euler("y", 0.2 * math.sin(2 * time)).as_matrix()
    joint = np.array([0.1, 0.3, 0.2])
    return placed(joint - turn @ joint, turn)


def on_plane(pose: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """How far along rays of a posed frame the plane z = 0 is; NaN where it is not met."""
    down = rays @ pose[2, :3]
    with np.errstate(divide="ignore"):
        found = -pose[2, 3] / down
    return np.where(down < -0.05, found, np.nan)


def write_recording(
    folder: Path,
    *,
    seconds: float = 1.0,
    lidar: bool = True,
    preset="vlp-16",
    extras=False,
    rocking=(),
    snapshot=False,
    **changes,
) -> Path:
    """Write the recording; `changes` are of the cameras' sensor.yaml.

    The sensors of the folders `rocking` sit on a link that rocks against base_link.
    """

    def carrier(key, time):
        return base_pose(time) @ rocking_pose(time) if key in rocking else base_pose(time)

    mav, stamps = folder / "mav0", {}
    streams = []
    cameras = {"cam0": ("stereo_left", LEFT), "cam1": ("stereo_right", RIGHT)}
    for key, (name, mount) in cameras.items():
        times = np.arange(0.0, seconds - 0.099, 0.2)
        stamps[key] = [_stamp(t) for t in times]
        for time in times:
            _picture(mav / key, time, carrier(key, time) @ mount)
        about = {
            "sensor_type": "camera", "rate_hz": 5.0, "resolution": [WIDTH, ROWS],
            "camera_model": "pinhole", "distortion_model": "none", "distortion_coefficients": [],
            "intrinsics": [FOCAL, FOCAL, WIDTH / 2 - 0.5, ROWS / 2 - 0.5],
        }  # fmt: skip
        _sensor(mav / key, {**about, **changes}, mount, [(s, f"{s}.png") for s in stamps[key]])
        channels = {"data": {}, "depth": {"values_per_metre": FACTOR}, "class": {}}
        streams.append(
            {"folder": f"mav0/{key}", "name": name, "kind": "camera"} | {"channels": channels}
        )
    if lidar:
        times = np.arange(0.0, seconds - 0.15, 0.1)
        stamps["lidar0"] = [_stamp(t) for t in times]
        for time in times:
            _sweep(mav / "lidar0" / "data", time, lambda t: carrier("lidar0", t), snapshot)
        about = {"sensor_type": "lidar", "rate_hz": 10.0, "rings": 4, "column_period_s": 0.1 / 90}
        about |= {"range_min_m": 0.5, "range_max_m": 100.0, "snapshot": snapshot}
        _sensor(mav / "lidar0", about, LIDAR, [(s, f"{s}.npy") for s in stamps["lidar0"]])
        codes = {"instance": {"rock": "its id", "ground": -1, "beyond the site": -3, "rover": -4}}
        streams.append({"folder": "mav0/lidar0", "name": "lidar", "kind": "lidar"})
        streams[-1]["channels"] = {"data": codes}
    ticks = np.arange(0.0, seconds + 1e-9, 0.005)
    stamps["imu0"] = [_stamp(t) for t in ticks]
    noise = {
        "gyroscope_noise_density": 1.7e-4, "gyroscope_random_walk": 1.9e-5,
        "accelerometer_noise_density": 2e-3, "accelerometer_random_walk": 3e-3,
    }  # fmt: skip
    rows = [(s, 0.01 * n, 0.02, TURN, 0.1, -0.2, GRAVITY) for n, s in enumerate(stamps["imu0"])]
    head = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    head += "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    about = {"sensor_type": "imu", "rate_hz": 200.0, **noise}
    _sensor(mav / "imu0", about, IMU, rows, head)
    streams.append({"folder": "mav0/imu0", "name": "imu", "kind": "imu"})
    tables = {"odometry": ODOMETRY, "sun": SUN, "inclinometer": INCLINOMETER}
    for name, (head, row) in tables.items() if extras else ():
        stamps[f"{name}0"] = [_stamp(t) for t in ticks[::20]]
        rows = [(stamp, *row) for stamp in stamps[f"{name}0"]]
        about = {"sensor_type": name, "rate_hz": 10.0}
        _sensor(mav / f"{name}0", about, IMU, rows, f"#timestamp [ns],{head}")
        streams.append({"folder": f"mav0/{name}0", "name": name, "kind": name})
    mounts = {"cam0": LEFT, "cam1": RIGHT, "lidar0": LIDAR}
    mounts = {key: mounts.get(key, IMU) for key in stamps}
    _truth(folder, ticks, mounts, stamps, carrier)
    about = {
        "version": 1, "world": {"name": "plane", "seed": 7}, "gravity_m_s2": GRAVITY,
        "motion": {"path": "circle", "source": "path"}, "body": "imu0", "classes": CLASSES,
        "transforms": {key: mount.ravel().tolist() for key, mount in mounts.items()},
        "sensors": [{"name": "lidar", "kind": "lidar", "preset": preset}], "streams": streams,
        "links": {key: "rocker" if key in rocking else "base_link" for key in stamps},
        "moving_links": ["rocker"] if rocking else [],
    }  # fmt: skip
    (folder / "dataset.json").write_text(json.dumps(about, indent=1))
    return folder


def _stamp(time: float) -> int:
    return EPOCH + round(time * 1e9)


def _sensor(folder: Path, about, mount, rows, head="#timestamp [ns],filename") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    data = (np.linalg.inv(IMU) @ mount).ravel().tolist()
    about = {"comment": "test", "T_BS": {"cols": 4, "rows": 4, "data": data}, **about}
    (folder / "sensor.yaml").write_text(json.dumps(about))  # JSON is YAML
    lines = [",".join(map(str, row)) for row in rows]
    (folder / "data.csv").write_text("\n".join([head, *lines, ""]))


def pixel_rays() -> np.ndarray:
    """Rays of all pixels, z = 1, in the optical frame, shape [rows, columns, 3]."""
    v, u = np.mgrid[:ROWS, :WIDTH].astype(float)
    return np.stack([(u - WIDTH / 2 + 0.5) / FOCAL, (v - ROWS / 2 + 0.5) / FOCAL, u * 0 + 1], -1)


def _picture(folder: Path, time: float, pose: np.ndarray) -> None:
    depth = on_plane(pose, pixel_rays())
    depth[:4, :8] = np.nan  # as of the sky
    seen = np.isfinite(depth) & (depth * FACTOR < 65_000)
    units = np.where(seen, np.round(np.nan_to_num(depth) * FACTOR), 0).astype(np.uint16)
    grey = np.where(seen, 60 + 10 * np.nan_to_num(depth) % 100, 200).astype(np.uint8)
    kind = np.where(seen, 0, 6).astype(np.uint8)
    kind[-8:, :8], kind[-8:, -8:], kind[-4:, 20:30] = 2, 1, 5
    for name, image in (("data", grey), ("depth", units), ("class", kind)):
        (folder / name).mkdir(parents=True, exist_ok=True)
        Image.fromarray(image).save(folder / name / f"{_stamp(time)}.png")


def _sweep(folder: Path, begin: float, carrier, snapshot=False) -> None:
    """Four rings of 90 columns, clockwise, each column at its own time and pose, or all at once."""
    points = []
    for column in range(90):
        time = np.float32(0.0 if snapshot else column / 90 * 0.1)
        azimuth, pose = -2 * math.pi * column / 90, carrier(begin + float(time)) @ LIDAR
        for ring, elevation in enumerate(np.radians([-25.0, -18.0, -11.0, 5.0])):
            level = math.cos(elevation)
            ray = np.array(
                [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)]
            )
            reach = on_plane(pose, ray)
            if np.isfinite(reach):
                points.append((*(ray * reach), 10.0 + ring, ring, time, 7 if column < 3 else -1))
    points.append((*ON_ROVER, 10.0, 0, time, -4))
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / f"{_stamp(begin)}.npy", np.array(points, FIELDS))


def _truth(folder: Path, ticks, mounts, stamps, carrier) -> None:
    place = folder / "mav0" / "state_groundtruth_estimate0"
    place.mkdir(parents=True)
    (folder / "truth").mkdir()
    lines = ["#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m]" + ", value" * 13]
    step = 1e-5
    for time in ticks:
        pose = carrier("imu0", time) @ IMU
        around = [carrier("imu0", time + late) @ IMU for late in (-step, step)]
        speed = (around[1] - around[0])[:3, 3] / (2 * step)
        turn = np.roll(Rotation.from_matrix(pose[:3, :3]).as_quat(), 1)
        row = [*pose[:3, 3], *turn, *speed, *[0.0] * 6]
        lines.append(",".join([str(_stamp(time)), *(repr(float(v)) for v in row)]))
    (place / "data.csv").write_text("\n".join([*lines, ""]))
    frames = {"base_link": (np.eye(4), [_stamp(t) for t in ticks])}
    frames |= {key: (mounts[key], stamps[key]) for key in stamps}
    for name, (mount, when) in frames.items():
        rows = []
        for stamp in when:
            pose = carrier(name, (stamp - EPOCH) * 1e-9) @ mount
            turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
            rows.append(
                f"{stamp // 10**9}.{stamp % 10**9:09d} "
                + " ".join(map(repr, map(float, [*pose[:3, 3], *turn])))
            )
        (folder / "truth" / f"{name}.tum").write_text("\n".join([*rows, ""]))
