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


def pose_of(matrix: Any) -> Any:
    """Evalio's pose of a matrix, shape [4, 4]."""
    x, y, z, w = quaternion_of(matrix[:3, :3])
    turn = types.SO3(qx=x, qy=y, qz=z, qw=w)
    return types.SE3(turn, np.ascontiguousarray(matrix[:3, 3]))


class Grid:
    """Organised sweeps: all cells, of which those without a return are at the origin."""

    def __init__(self, rings: int, columns: int, period: float) -> None:
        self.columns, self._period = columns, period
        times = [types.Duration.from_nsec(int(n * period / columns)) for n in range(columns)]
        self._empty = [
            [types.Point(row=ring, col=column, t=time) for column, time in enumerate(times)]
            for ring in range(rings)
        ]

    def filled(self, points: Any) -> list[Any]:
        """The cells of a sweep, ring by ring."""
        cells = [ring[:] for ring in self._empty]
        turns = points["time"] * 1e9 / self._period
        if not turns.any():  # all at one time: clockwise from behind, as it turns
            turns = 0.5 - np.arctan2(points["y"], points["x"]) / (2.0 * np.pi)
        places = np.round(turns * self.columns, 3).astype(int) % self.columns
        for column, (x, y, z, light, ring, time, _) in zip(
            places.tolist(), points.tolist(), strict=True
        ):
            cells[ring][column] = types.Point(
                x=x, y=y, z=z, intensity=light, t=types.Duration.from_nsec(int(time * 1e9)),
                range=int(1000 * (x * x + y * y + z * z) ** 0.5), row=ring, col=column,
            )  # fmt: skip
        return [point for ring in cells for point in ring]


def prepared(
    kind: str, words: list[str], dataset: Path, *, rings: int, columns: int, rate: float
) -> Any:
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
            num_rows=rings, num_columns=columns, min_range=0.5, max_range=100.0, rate=rate
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
    firing = 1e-6 * float(lidar["firing_period_us"])
    columns = int(1.0 / (rate * firing) + 1e-6) if firing else int(lidar["horizontal_samples"])
    pipeline = prepared(kind, words, dataset, rings=rings, columns=columns, rate=rate)
    grid = Grid(rings, columns, period)
    stamps, felt = table(dataset, "imu0") if "imu0" in streams else ([], [])
    row = 0
    with output.open("w", encoding="utf-8") as file:
        for stamp, points in sweeps(dataset, "lidar0"):
            while row < len(stamps) and stamps[row] <= stamp + period:
                when = types.Stamp.from_nsec(int(stamps[row]))
                gyro, force = felt[row, :3].copy(), felt[row, 3:6].copy()
                pipeline.add_imu(types.ImuMeasurement(when, gyro, force))
                row += 1
            whole = grid.filled(points)
            pipeline.add_lidar(types.LidarMeasurement(types.Stamp.from_nsec(stamp), whole))
            for when, where in pipeline.saved_estimates():
                turn = where.rot
                write_pose(file, when.to_nsec(), where.trans, (turn.qx, turn.qy, turn.qz, turn.qw))


main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4:])
