"""A pipeline of evalio, such as LOAM or LioSAM: RECORDING TRAJECTORY LIDAR PIPELINE [key=value …].

Points go in as an organised sweep, ring by ring, which some of its pipelines ask for.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from evalio import pipelines, types
from evalio.datasets import loaders as helpers  # what its own datasets read clouds with
from recorded import (
    about,
    figure,
    own_work,
    quaternion_of,
    sweep_s,
    sweeps,
    table,
    tell_own_work,
    transform,
    write_pose,
)  # fmt: skip


def pose_of(matrix: Any) -> Any:
    """Evalio's pose of a matrix, shape [4, 4]."""
    x, y, z, w = quaternion_of(matrix[:3, :3])
    turn = types.SO3(qx=x, qy=y, qz=z, qw=w)
    return types.SE3(turn, np.ascontiguousarray(matrix[:3, 3]))


class Grid:
    """Organised sweeps: all cells, of which those without a return are at the origin."""

    def __init__(self, rings: int, columns: int, column_s: float) -> None:
        self._columns, self._column_s = columns, column_s
        names = "x", "y", "z", "intensity", "range", "t", "ring"
        kinds = "f4", "f4", "f4", "f4", "u4", "u4", "u4"
        self._kind = np.dtype(list(zip(names, kinds, strict=True)))
        empty = np.zeros((rings, columns), self._kind)
        empty["ring"] = np.arange(rings)[:, None]
        empty["t"] = np.arange(columns) * column_s * 1e9
        self._empty = empty.view("u4").reshape(rings, columns, len(names))  # quicker than records
        told = {"f4": helpers.DataType.FLOAT32, "u4": helpers.DataType.UINT32}
        self._fields = [
            helpers.Field(name=name, datatype=told[kind], offset=4 * n)
            for n, (name, kind) in enumerate(zip(names, kinds, strict=True))
        ]

    def filled(self, stamp: int, points: Any) -> Any:
        """Evalio's sweep, ring by ring."""
        cells = self._empty.copy()
        columns = points["time"].astype(np.float64) / self._column_s
        x, y, z = (points[axis].astype(np.float64) for axis in "xyz")
        if not columns.any():  # all at one time: clockwise from behind, as it turns
            columns = (0.5 - np.arctan2(y, x) / (2.0 * np.pi)) * self._columns
        given = np.zeros(len(points), self._kind)
        for name in "x", "y", "z", "intensity", "ring":
            given[name] = points[name]
        given["range"] = 1000.0 * np.sqrt(x * x + y * y + z * z)
        given["t"] = points["time"].astype(np.float64) * 1e9
        places = np.floor(columns + 0.01).astype(int) % self._columns
        cells[points["ring"], places] = given.view("u4").reshape(-1, cells.shape[2])
        about = helpers.PointCloudMetadata(
            stamp=types.Stamp.from_nsec(stamp), height=cells.shape[0], width=cells.shape[1],
            point_step=self._kind.itemsize, row_step=cells.strides[0], is_bigendian=0, is_dense=1,
        )  # fmt: skip
        sweep = helpers.pc2_to_evalio(about, self._fields, cells.tobytes())
        helpers.fill_col_row_major(sweep)
        return sweep


def prepared(
    kind: str, words: list[str], dataset: Path, lidar: str, *, rings: int, columns: int
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
            num_rows=rings,
            num_columns=columns,
            min_range=figure(dataset, lidar, "range_min_m"),
            max_range=figure(dataset, lidar, "range_max_m"),
            rate=1.0 / sweep_s(dataset, lidar),
        )
    )
    body = told["body"]  # the IMU's frame in a recording that lacks its readings too
    base = transform(dataset, body) if body in told["transforms"] else np.eye(4)
    if imu := imu_of(dataset):

        def noise(name: str, least: float) -> float:
            return float(max(figure(dataset, imu, name), least))

        pipeline.set_imu_params(
            types.ImuParams(
                gyro=noise("gyroscope_noise_density", 1e-6),
                accel=noise("accelerometer_noise_density", 1e-5),
                gyro_bias=noise("gyroscope_random_walk", 1e-8),
                accel_bias=noise("accelerometer_random_walk", 1e-7),
                gravity=np.array([0.0, 0.0, float(told["gravity_m_s2"])]),
                rate=figure(dataset, imu, "rate_hz"),
            )
        )
    pipeline.set_imu_T_lidar(pose_of(np.linalg.inv(base) @ transform(dataset, lidar)))
    pipeline.initialize()
    return pipeline


def imu_of(dataset: Path) -> str:
    """The folder of the IMU whose frame the body's is; empty where none was recorded."""
    body: str = about(dataset)["body"]
    return body if (dataset / "mav0" / body / "data.csv").is_file() else ""


def main(dataset: Path, output: Path, lidar: str, kind: str, words: list[str]) -> None:
    """Lead all sweeps, and what the IMU felt until their ends, through the pipeline."""
    turn_s, column_s = sweep_s(dataset, lidar), figure(dataset, lidar, "column_period_s")
    rings, columns = int(figure(dataset, lidar, "rings")), int(turn_s / column_s + 1e-6)
    pipeline = prepared(kind, words, dataset, lidar, rings=rings, columns=columns)
    grid = Grid(rings, columns, column_s)
    imu = imu_of(dataset)
    stamps, felt = table(dataset, imu) if imu else ([], [])
    row = 0
    with output.open("w", encoding="utf-8") as file:
        for stamp, points in sweeps(dataset, lidar):
            while row < len(stamps) and stamps[row] <= stamp + 1e9 * turn_s:
                when = types.Stamp.from_nsec(int(stamps[row]))
                gyro, force = felt[row, :3].copy(), felt[row, 3:6].copy()
                pipeline.add_imu(types.ImuMeasurement(when, gyro, force))
                row += 1
            with own_work():
                sweep = grid.filled(stamp, points)
            pipeline.add_lidar(sweep)
            for when, where in pipeline.saved_estimates():
                turn = where.rot
                write_pose(file, when.to_nsec(), where.trans, (turn.qx, turn.qy, turn.qz, turn.qw))
    tell_own_work()


main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4], sys.argv[5:])
