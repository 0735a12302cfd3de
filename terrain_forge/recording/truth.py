"""The truth of a recording: exact places of the body and of each sensor, at their own times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable
from terrain_forge.recording.rig import Folder, body_of
from terrain_forge.recording.texts import poses_text, table_text
from terrain_forge.sensors import NANOSECONDS, Setting, State

EPOCH = 1_600_000_000 * NANOSECONDS
"""The stamp of time 0 [ns]."""
_LEAST_RATE = 200
"""Of the body's truth [Hz]."""
_COLUMNS = (
    *("p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]"),
    *("q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
    *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
    *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
    *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
)


def body_times(setting: Setting, folders: Sequence[Folder]) -> NDArray[np.int64]:
    """When the body's truth is told, from 0 [ns]: with the first IMU, or 200 times a second."""
    body = body_of(folders)
    if body is not None and body.sensor.rate_hz >= _LEAST_RATE:
        return body.instrument.times
    step = NANOSECONDS // _LEAST_RATE
    return np.arange(int(setting.motion.end * NANOSECONDS / step + 1e-6) + 1, dtype=np.int64) * step


def body_table(
    setting: Setting, folders: Sequence[Folder], times: NDArray[np.int64]
) -> tuple[bytes, bytes]:
    """EuRoC's table of the body's truth, and base_link's poses, at times [ns]."""
    body, base = body_of(folders), setting.motion.base.at(times / NANOSECONDS)
    state = base if body is None else body.state(times)
    biases = np.zeros((len(times), 6))
    if body is not None and (told := getattr(body.instrument, "biases", None)) is not None:
        biases = told(times)
    values = np.hstack([state.position, quaternions(state.rotation), state.velocity, biases])
    table = dict(zip(_COLUMNS, values.T, strict=True))
    return table_text(table, times + EPOCH), _poses(base, times)


def sensor_poses(folder: Folder, times: NDArray[np.int64]) -> bytes:
    """Poses of a sensor's frame at times [ns]."""
    return _poses(folder.state(times), times)


def _poses(state: State, times: NDArray[np.int64]) -> bytes:
    return poses_text(times + EPOCH, state.position, quaternions(state.rotation))


def quaternions(rotation: Array) -> Array:
    """Unit quaternions (w, x, y, z), w not negative, shape [n, 4], of rotations, shape [n, 3, 3].

    Each is a row of q qᵀ, the longest one (Shepperd 1978, doi:10.2514/3.55767b).
    """
    r = rotation
    trace = r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    squares = np.empty((len(r), 4, 4))
    squares[:, 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        squares[:, i + 1, i + 1] = 1.0 - trace + 2.0 * r[:, i, i]
        squares[:, 0, i + 1] = squares[:, i + 1, 0] = r[:, k, j] - r[:, j, k]
        squares[:, j + 1, k + 1] = squares[:, k + 1, j + 1] = r[:, j, k] + r[:, k, j]
    longest = np.argmax(np.diagonal(squares, axis1=1, axis2=2), axis=1)
    row = squares[np.arange(len(r)), longest]
    unit = row / portable.norm(row)[:, None]
    return np.asarray(np.where(unit[:, :1] < 0.0, -unit, unit))
