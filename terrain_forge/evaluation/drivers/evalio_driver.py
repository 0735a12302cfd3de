"""A pipeline of evalio, such as LOAM or LioSAM: RECORDING TRAJECTORY PIPELINE [key=value …].

Points go in as an organised sweep, ring by ring, which some of its pipelines ask for.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from evalio import pipelines, types
from recorded import about, quaternion_of, sweeps, table, transform, write_pose

COLUMNS = 1800


def pose_of(matrix: Any) -> Any:
    """Evalio's pose of a matrix, shape [4, 4]."""
    x, y, z, w = quaternion_of(matrix[:3, :3])
    turn = types.SO3(qx=x, qy=y, qz=z, qw=w)
    return types.SE3(turn, np.ascontiguousarray(matrix[:3, 3]))


def organised(points: Any, rings: int, period: float) -> list[Any]:
    """All cells of a sweep; those without a return are at the origin."""

    def cell(ring: int, column: int) -> Any:
        time = types.Duration.from_nsec(int(column * period / COLUMNS))
        return types.Point(row=ring, col=column, t=time)

    cells = [[cell(ring, column) for column in range(COLUMNS)] for ring in range(rings)]
    columns = np.clip(points["time"] * 1e9 / period * COLUMNS, 0, COLUMNS - 1).astype(int)
    for column, (x, y, z, light, ring, time, _) in zip(
        columns.tolist(), points.tolist(), strict=True
    ):
        cells[ring][column] = types.Point(
            x=x, y=y, z=z, intensity=light, t=types.Duration.from_nsec(int(time * 1e9)),
            range=int(1000 * (x * x + y * y + z * z) ** 0.5), row=ring, col=column,
        )  # fmt: skip
    return [point for ring in cells for point in ring]


def prepared(kind: str, words: list[str], dataset: Path, rings: int, rate: float) -> Any:
    """The pipeline with its parameters, sensors and frames told."""
    told = about(dataset)
    pipeline = getattr(pipelines, kind)()
    parameters = pipeline.default_params()
    for word in words:
        key, _, value = word.partition("=")
        known = parameters[key]
        parameters[key] = value == "true" if isinstance(known, bool) else type(known)(value)
    if "gravity" in parameters:
        parameters["gravity"] = float(told["gravity_m_s2"])
    pipeline.set_params(parameters)
    pipeline.set_lidar_params(
        types.LidarParams(
            num_rows=rings, num_columns=COLUMNS, min_range=0.5, max_range=100.0, rate=rate
        )
    )
    imus = [one for one in told["sensors"] if one["kind"] == "imu"]
    lidar = transform(dataset, "lidar0")
    base = transform(dataset, "imu0") if imus else np.eye(4)
    for imu in imus[:1]:
        pipeline.set_imu_params(
            types.ImuParams(
                gyro=max(imu["gyro_noise"], 1e-6),
                accel=max(imu["accelerometer_noise"], 1e-5),
                gyro_bias=max(imu["gyro_walk"], 1e-8),
                accel_bias=max(imu["accelerometer_walk"], 1e-7),
                gravity=np.array([0.0, 0.0, float(told["gravity_m_s2"])]),
                rate=float(imu["rate_hz"]),
            )
        )
    pipeline.set_imu_T_lidar(pose_of(np.linalg.inv(base) @ lidar))
    pipeline.initialize()
    return pipeline


def main(dataset: Path, output: Path, kind: str, words: list[str]) -> None:
    """Lead all sweeps, and what the IMU felt until their ends, through the pipeline."""
    streams = {Path(one["folder"]).name: one for one in about(dataset)["streams"]}
    rate = float(streams["lidar0"]["rate_hz"])
    period = 1e9 / rate
    name = streams["lidar0"]["name"]
    lidar = next(one for one in about(dataset)["sensors"] if one["name"] == name)
    rings = len(lidar["elevations_deg"]) or int(lidar["channels"])
    pipeline = prepared(kind, words, dataset, rings, rate)
    stamps, felt = table(dataset, "imu0") if "imu0" in streams else ([], [])
    row = 0
    with output.open("w", encoding="utf-8") as file:
        for stamp, points in sweeps(dataset, "lidar0"):
            while row < len(stamps) and stamps[row] <= stamp + period:
                when = types.Stamp.from_nsec(int(stamps[row]))
                gyro, force = felt[row, :3].copy(), felt[row, 3:6].copy()
                pipeline.add_imu(types.ImuMeasurement(when, gyro, force))
                row += 1
            whole = organised(points, rings, period)
            pipeline.add_lidar(types.LidarMeasurement(types.Stamp.from_nsec(stamp), whole))
            for when, where in pipeline.saved_estimates():
                turn = where.rot
                write_pose(file, when.to_nsec(), where.trans, (turn.qx, turn.qy, turn.qz, turn.qw))


main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4:])
