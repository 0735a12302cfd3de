"""The truth of a recording: exact places of the body and of each sensor, at their own times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import quaternion_from_matrix
from terrain_forge.datasets import Poses, tum_text
from terrain_forge.recording.rig import Folder, body_of
from terrain_forge.recording.texts import table_text
from terrain_forge.sensors import NANOSECONDS, Setting, State

EPOCH = 1_600_000_000 * NANOSECONDS
"""The stamp of time 0 [ns]."""
_LEAST_RATE = 200
"""Of the body's truth [Hz]."""
_HEAD = "# timestamp [s] x y z [m] qx qy qz qw\n"
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
    values = np.hstack(
        [state.position, quaternion_from_matrix(state.rotation), state.velocity, biases]
    )
    table = dict(zip(_COLUMNS, values.T, strict=True))
    return table_text(table, times + EPOCH), _poses(base, times)


def sensor_poses(folder: Folder, times: NDArray[np.int64]) -> bytes:
    """Poses of a sensor's frame at times [ns]."""
    return _poses(folder.state(times), times)


def _poses(state: State, times: NDArray[np.int64]) -> bytes:
    poses = Poses(
        stamps=times + EPOCH,
        position=state.position,
        quaternion=quaternion_from_matrix(state.rotation),
    )
    return (_HEAD + tum_text(poses)).encode()
